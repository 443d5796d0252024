"""`extract` and `pose`: the CSV's columns, datasets and bare images, overlays, candidates."""

from __future__ import annotations

import csv
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from geometry.sensor import calibration_covariance
from tests.workbench.helpers import Cli
from workbench.files import read_points, read_sensor

COLUMNS = "frame,label,u_px,v_px,y_surface_mm,z_surface_mm,y_mm,z_mm,sigma_y_mm,sigma_z_mm,cov_yz_mm2,score,flag"
LABELS = {"A", "B", "C", "B'", "C'"}


def _rows(text: str) -> list[dict[str, str]]:
    assert text.splitlines()[0] == COLUMNS
    return list(csv.DictReader(text.splitlines()))


def test_a_dataset_with_overlays(cli: Cli, recording: Path, tmp_path: Path, answer: Any) -> None:
    words = ("--csv", tmp_path / "p.csv", "--overlay", tmp_path / "pictures", "--json")
    result = cli("extract", recording, *words)
    assert result.code == 0
    rows = _rows((tmp_path / "p.csv").read_text())
    labelled = [r for r in rows if r["label"]]
    assert {r["label"] for r in labelled} == LABELS
    assert all(r["y_mm"] and r["z_mm"] and r["u_px"] for r in labelled)
    assert all(not r["y_mm"] and not r["z_mm"] and r["y_surface_mm"] for r in rows if not r["label"])
    assert len(labelled) == sum(len(f["points"]) for f in answer["frames"])
    told = [{"frame": f["frame"]} | p for f in result.json["frames"] for p in f["points"]]
    assert [(p["frame"], p["label"]) for p in told] == [(int(r["frame"]), r["label"]) for r in rows]
    assert [p["u_px"] for p in told] == pytest.approx([float(r["u_px"]) for r in rows], abs=1e-5)
    pictures = sorted((tmp_path / "pictures").iterdir())
    assert len(pictures) == len(answer["frames"])
    assert cv2.imread(str(pictures[0])).shape[0] == 1024


def test_the_sensors_own_part_stands_beside_the_random_one(cli: Cli, dataset: Path, tmp_path: Path) -> None:
    """And `calibrate` reads the file back without a remark: it takes that part from sensor.toml."""
    sensor = dataset / "sensor.toml"
    sensor.write_text(sensor.read_text() + '[uncertainty]\nsource = "calibrated"\n')
    image = dataset / "images" / "000.png"
    result = cli("extract", image, "--sensor", sensor, "--jig", dataset / "jig.toml", "--csv", tmp_path / "p.csv")
    assert result.code == 0, result.err
    text = (tmp_path / "p.csv").read_text()
    assert text.splitlines()[0] == COLUMNS + ",sigma_sensor_y_mm,sigma_sensor_z_mm,cov_sensor_yz_mm2"
    rows = list(csv.DictReader(text.splitlines()))
    yz = np.array([[float(r["y_mm"] or r["y_surface_mm"]), float(r["z_mm"] or r["z_surface_mm"])] for r in rows])
    expected = calibration_covariance(read_sensor(sensor), yz)
    stated = [[float(r["sigma_sensor_y_mm"]), float(r["sigma_sensor_z_mm"])] for r in rows]
    np.testing.assert_allclose(stated, np.sqrt(np.diagonal(expected, axis1=1, axis2=2)), rtol=1e-4)
    assert len(rows) >= 5
    said: list[str] = []
    read_points(tmp_path / "p.csv", tuple(LABELS), said.append)
    assert not said


def test_every_stage_can_be_looked_at(cli: Cli, recording: Path, tmp_path: Path) -> None:
    image, sensor, jig = recording / "images" / "000.png", recording / "sensor.toml", recording / "jig.toml"
    call = ("extract", image, "--sensor", sensor, "--jig", jig, "--csv", tmp_path / "p.csv", "--stages")
    assert cli(*call).code == 2
    assert cli(*call, "--overlay", tmp_path / "pictures").code == 0
    names = ["1_raw", "2_background", "3_mask", "4_candidates", "5_spots", "6_labels", "regions"]
    assert [p.stem for p in sorted((tmp_path / "pictures" / "000").iterdir())] == names
    regions = list(csv.DictReader((tmp_path / "pictures" / "000" / "regions.csv").read_text().splitlines()))
    assert sum(r["reason"] == "" for r in regions) == len(_rows((tmp_path / "p.csv").read_text()))
    assert all(0 < float(r["solidity"]) <= 1 and float(r["area_px"]) >= 1 for r in regions)


def test_bare_images(cli: Cli, recording: Path) -> None:
    """Labels from the jig alone agree with those through the chain wherever a frame is labelled at all."""
    through_chain = _rows(cli("extract", recording).out)
    alone = _rows(
        cli("extract", recording / "images", "--sensor", recording / "sensor.toml", "--jig", recording / "jig.toml").out
    )
    spots = {(r["frame"], r["u_px"]): r["label"] for r in through_chain}
    half_turn = {"A": "A", "B": "C", "C": "B", "B'": "C'", "C'": "B'", "": ""}
    for frame in {r["frame"] for r in alone}:
        mine = [r for r in alone if r["frame"] == frame and r["label"]]
        same = all(spots[(frame, r["u_px"])] in (r["label"], "") for r in mine)
        turned = all(spots[(frame, r["u_px"])] in (half_turn[r["label"]], "") for r in mine)
        assert same or turned
    unlabelled = _rows(cli("extract", recording / "images" / "000.png", "--sensor", recording / "sensor.toml").out)
    assert not any(r["label"] for r in unlabelled)
    assert len(unlabelled) >= 5


def test_bad_images_do_not_stop_the_others(cli: Cli, dataset: Path) -> None:
    (dataset / "images" / "001.png").write_bytes(b"not an image")
    sensor = dataset / "sensor.toml"
    result = cli("extract", dataset / "images", "--sensor", sensor)
    assert result.code == 0
    assert "001.png" in result.err
    assert {r["frame"] for r in _rows(result.out)} >= {"0", "2"}
    alone = cli("extract", dataset / "images" / "001.png", "--sensor", sensor)
    assert alone.code == 2
    assert "PNG" in alone.err
    empty = dataset / "empty"
    empty.mkdir()
    assert cli("extract", empty, "--sensor", sensor).code == 2


def test_blank_and_noise_give_no_points(cli: Cli, dataset: Path) -> None:
    rng = np.random.default_rng(0)
    folder = dataset / "other"
    folder.mkdir()
    cv2.imwrite(str(folder / "blank.png"), np.zeros((1024, 1280), np.uint8))
    cv2.imwrite(str(folder / "noise.png"), rng.normal(20, 3, (1024, 1280)).clip(0, 255).astype(np.uint8))
    cv2.imwrite(str(folder / "white.png"), np.full((1024, 1280), 255, np.uint8))
    result = cli("extract", folder, "--sensor", dataset / "sensor.toml", "--jig", dataset / "jig.toml")
    assert result.code == 0
    assert not [r for r in _rows(result.out) if r["label"]]


def test_poses_of_a_frame(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """The most likely candidate is the pose that made the image; unlabelled points do as well."""
    import json

    from geometry import Pose

    points = tmp_path / "p.csv"
    cli("extract", recording, "--csv", points)
    for name in ("jig.toml", "sensor.toml"):
        (tmp_path / name).write_bytes((recording / name).read_bytes())
    answer = cli("pose", points, "--json").json
    truth = {f["frame"]: f for f in json.loads((recording / "truth.json").read_text())["frames"]}
    for frame in answer["frames"]:
        candidates = [Pose.from_matrix(c["T_sensor_jig"]) for c in frame["candidates"]]
        true = Pose.from_matrix(truth[frame["frame"]]["T_sensor_jig"])
        assert min(np.linalg.norm((c.inverse() @ true).log()[3:]) for c in candidates) < np.deg2rad(2)
        assert abs(sum(c["likelihood"] for c in frame["candidates"]) - 1) < 1e-6
    text = cli("pose", points, "--frame", 0)
    assert "likelihood" in text.out
    assert cli("pose", points, "--frame", 99).code == 2


def test_spots_beyond_a_limit_are_said_by_every_command(cli: Cli, dataset: Path, tmp_path: Path) -> None:
    """With the number and the setting; the images of a dataset in one sentence."""
    (tmp_path / "few.toml").write_text("[localise]\nmax_spots = 4\n")
    image = dataset / "images" / "000.png"
    alone = cli("extract", image, "--sensor", dataset / "sensor.toml", "--config", tmp_path / "few.toml")
    assert f"remark: {image}: 7 spots were found and the 4 best kept, 3 left out: max_spots of [loc" in alone.err
    for command in ("extract", "calibrate"):
        told = cli(command, dataset, "--config", tmp_path / "few.toml")
        words = " ".join((told.out + told.err).split())
        assert " left out: max_spots of [localise] may be raised; the like of " in words, command
    (tmp_path / "few.toml").write_text("[calib.labelling]\nmax_candidates = 4\n")
    told = cli("calibrate", dataset, "--config", tmp_path / "few.toml")
    assert "the 4 best of a frame are considered as strings, the others left out; " in " ".join(told.out.split())
