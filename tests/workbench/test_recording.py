"""Recording in emulation: same seed same bytes, resuming, honest failure; datasets survive writing and reading."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

from tests.workbench.helpers import Cli, edit
from workbench.files import read_cell, write_cell

SMALL = ("--per-location", 1, "--seed", 5)


def _digest(folder: Path) -> dict[str, str]:
    files = [p for p in sorted(folder.rglob("*")) if p.is_file()]
    return {str(p.relative_to(folder)): hashlib.sha256(p.read_bytes()).hexdigest() for p in files}


@pytest.fixture(scope="module")
def plan(recording: Path) -> Path:
    return recording.parent / "plan"


def test_same_seed_same_bytes_and_resumes(cli: Cli, plan: Path, tmp_path: Path) -> None:
    """A recording that lost images and its truth is completed to the same bytes; another seed gives others."""
    first, second, other = tmp_path / "a", tmp_path / "b", tmp_path / "c"
    assert cli("render", plan, "--out", first, *SMALL).code == 0
    assert cli("render", plan, "--out", second, *SMALL).code == 0
    assert _digest(first) == _digest(second)
    whole = _digest(first)
    (first / "truth.json").unlink()
    (first / "images" / "002.png").unlink()
    assert cli("render", plan, "--out", first, *SMALL).code == 0
    assert _digest(first) == whole
    views = first / "frames.csv"
    assert cli("render", plan, "--out", other, "--joints", views, "--seed", 6).code == 0
    assert _digest(other)["images/000.png"] != whole["images/000.png"]


def test_all_strings_are_visible_where_planned(recording: Path) -> None:
    """What the planner promises holds for the true cell too, whose sensor sits elsewhere than designed."""
    frames = json.loads((recording / "truth.json").read_text())["frames"]
    visible = [p["visible_fraction"] for f in frames for p in f["points"]]
    assert np.mean(np.array(visible) >= 0.9) > 0.97


def test_views_are_given_by_csv(cli: Cli, plan: Path, recording: Path, tmp_path: Path) -> None:
    lines = (recording / "frames.csv").read_text().splitlines()
    (tmp_path / "views.csv").write_text("\n".join([lines[0], lines[2]]) + "\n")
    out = tmp_path / "out"
    assert cli("render", plan, "--out", out, "--joints", tmp_path / "views.csv", "--exact").code == 0
    truth = json.loads((out / "truth.json").read_text())
    cell = read_cell(out)
    assert len(cell.frames) == len(truth["frames"]) == 1
    assert np.allclose(truth["T_hand_sensor"], cell.T_hand_sensor_design.matrix, rtol=0, atol=1e-9)


def test_a_jig_out_of_reach_is_said(cli: Cli, plan: Path, tmp_path: Path) -> None:
    text = (plan / "cell.toml").read_text().replace("1560.0", "9560.0")
    (tmp_path / "far").mkdir()
    for name in ("sensor.toml", "jig.toml", "robot.toml", "frames.csv"):
        (tmp_path / "far" / name).write_bytes((plan / name).read_bytes())
    (tmp_path / "far" / "cell.toml").write_text(text)
    result = cli("render", tmp_path / "far", "--out", tmp_path / "out")
    assert result.code == 3
    assert "reach" in result.err
    assert not (tmp_path / "out" / "images").exists()


def test_a_place_is_needed(cli: Cli, plan: Path, tmp_path: Path) -> None:
    for name in ("sensor.toml", "jig.toml", "robot.toml", "frames.csv", "cell.toml"):
        (tmp_path / name).write_bytes((plan / name).read_bytes())
    text = (tmp_path / "cell.toml").read_text()
    (tmp_path / "cell.toml").write_text(text[: text.index("[locations.A]")])
    result = cli("render", tmp_path, "--out", tmp_path / "out")
    assert result.code == 2
    assert "T_base_jig" in result.err


def test_a_cell_survives_writing(recording: Path, tmp_path: Path) -> None:
    cell = read_cell(recording)
    write_cell(cell, tmp_path, decimals=4)
    (tmp_path / "images").mkdir()
    again = read_cell(tmp_path)
    for name in ("jig.toml", "robot.toml", "frames.csv", "truth.json"):
        assert (tmp_path / name).read_bytes() == (recording / name).read_bytes()
    assert np.array_equal(again.robot.alpha, cell.robot.alpha)
    assert np.allclose(again.sensor.camera.T_sensor_camera.R, cell.sensor.camera.T_sensor_camera.R, rtol=0, atol=1e-15)
    assert again.emulator == cell.emulator


def test_init_refuses_a_full_folder(cli: Cli, recording: Path) -> None:
    result = cli("init", recording)
    assert result.code == 2
    assert "not empty" in result.err


def test_bit_depths_and_tiff(cli: Cli, plan: Path, tmp_path: Path) -> None:
    """12 bits in a 16-bit container, right-aligned; a level above the depth is refused, frame by frame."""
    import cv2

    for name in ("sensor.toml", "jig.toml", "robot.toml", "frames.csv", "cell.toml"):
        (tmp_path / name).write_bytes((plan / name).read_bytes())
    edit(tmp_path / "sensor.toml", "bit_depth = 8", "bit_depth = 12")
    out = tmp_path / "out"
    assert cli("render", tmp_path, "--out", out, *SMALL).code == 0
    image = cv2.imread(str(out / "images" / "000.png"), cv2.IMREAD_UNCHANGED)
    assert image.dtype == np.uint16
    assert 255 < image.max() <= 4095
    cv2.imwrite(str(out / "images" / "000.tiff"), image)
    cv2.imwrite(str(out / "images" / "001.png"), image * 16)
    edit(out / "frames.csv", "images/000.png", "images/000.tiff")
    from workbench.files import read_image

    cell = read_cell(out)
    assert np.array_equal(read_image(out / "images" / "000.tiff", cell.sensor), image)
    frames = {f["frame"]: f for f in cli("calibrate", out, "--json").json["frames"]}
    assert frames[0]["reason"] != "image_unreadable"
    assert frames[1]["reason"] == "image_unreadable"
    assert "4095" in frames[1]["complaint"]
