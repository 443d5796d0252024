"""`calibrate` on an emulated recording: the answer against the truth, the JSON's shape, frames left out, exit codes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from geometry import Pose
from tests.workbench.helpers import Cli, edit
from workbench.files import read_cell

CHI2_6_9999 = 27.9  # 99.99 % of true errors lie below, six degrees of freedom
VERDICTS = {"ok", "model_misfit", "weak"}


def test_solves_the_recording_within_its_own_uncertainty(answer: Any, recording: Path) -> None:
    """The error of the SCP is what its covariance says. One draw alone: coverage is tested in calib."""
    assert answer["verdict"]["code"] in VERDICTS
    truth = json.loads((recording / "truth.json").read_text())
    xi = (Pose.from_matrix(answer["T_hand_sensor"]).inverse() @ Pose.from_matrix(truth["T_hand_sensor"])).log()
    assert xi @ np.linalg.solve(np.array(answer["covariance"]), xi) < CHI2_6_9999
    assert np.linalg.norm(xi[:3]) < 1.5


def test_json_has_what_the_format_names(answer: Any) -> None:
    assert {"method", "model", "verdict", "chi2_per_dof", "T_hand_sensor", "rotation_deg", "translation_mm"} <= set(
        answer
    )
    assert np.shape(answer["T_hand_sensor"]) == (4, 4)
    assert np.shape(answer["covariance"]) == (6, 6)
    assert len(answer["sigma_rotation_deg"]) == len(answer["sigma_translation_mm"]) == 3
    assert list(answer["locations"]) == ["A", "B", "C", "D"]
    for location in answer["locations"].values():
        for figure in ("max_deviation_mm", "spread_3d_mm", "point_rms_mm"):
            assert set(location[figure]) == {"design", "solved", "nominal"}
    assert answer["locations"]["D"]["role"] == "verify"
    frame = answer["frames"][0]
    assert {"frame", "location", "role", "used", "reason", "points"} <= set(frame)
    point = {"label", "u_px", "v_px", "y_mm", "z_mm", "sigma_y_mm", "sigma_z_mm", "residual_mm", "flag"}
    assert set(frame["points"][0]) == point


def test_every_spot_is_labelled_right(answer: Any, recording: Path) -> None:
    """Against the emulator's truth: no label on another string's spot."""
    truth = {f["frame"]: f for f in json.loads((recording / "truth.json").read_text())["frames"]}
    labelled = 0
    for frame in answer["frames"]:
        where = {p["label"]: p["axis_mm"] for p in truth[frame["frame"]]["points"]}
        for point in frame["points"]:
            assert np.hypot(*np.subtract([point["y_mm"], point["z_mm"]], where[point["label"]])) < 0.5
            labelled += 1
    assert labelled >= 0.95 * 5 * len(answer["frames"])


def test_readable_result_and_files(cli: Cli, recording: Path, tmp_path: Path, answer: Any) -> None:
    result = cli("calibrate", recording, "--out", tmp_path / "out")
    assert result.code == 0
    for words in ("rotation X [°]", "verify", "verdict:", "point rms"):
        assert words in result.out
    assert {p.name for p in (tmp_path / "out").iterdir()} >= {"result.json", "points.csv", "fig7.png", "settings.toml"}
    assert json.loads((tmp_path / "out" / "result.json").read_text()) == answer
    assert (
        cli("extract", recording, "--config", tmp_path / "out" / "settings.toml").out.splitlines()
        == (tmp_path / "out" / "points.csv").read_text().splitlines()
    )


@pytest.mark.parametrize("options", [("--method", "paper"), ("--model", "full")])
def test_methods_and_models_answer(cli: Cli, recording: Path, options: tuple[str, str]) -> None:
    result = cli("calibrate", recording, "--json", *options)
    assert result.code in (0, 3)
    assert result.json[options[0][2:]] == options[1]


def test_bad_images_are_left_out_and_named(cli: Cli, dataset: Path) -> None:
    """Five ways to break an image: each frame is left out with its sentence; so many of a few are no answer."""
    images = dataset / "images"
    (images / "000.png").unlink()
    (images / "004.png").write_bytes(b"")
    whole = (images / "009.png").read_bytes()
    (images / "009.png").write_bytes(whole[: len(whole) // 2])
    cv2.imwrite(str(images / "011.png"), np.zeros((480, 640), np.uint8))
    cv2.imwrite(str(images / "010.png"), np.zeros((1024, 1280), np.uint16))
    result = cli("calibrate", dataset, "--json")
    assert result.code == 3, result.err
    assert result.json["verdict"]["code"] == "frames_contradict"
    assert "5 image_unreadable (images unreadable: " in result.json["verdict"]["text"]
    frames = {f["frame"]: f for f in result.json["frames"]}
    for number, word in ((0, "no such image"), (4, "0 bytes"), (9, "cut short"), (11, "640 × 480"), (10, "16 bits")):
        assert frames[number]["used"] is False
        assert frames[number]["reason"] == "image_unreadable"
        assert word in frames[number]["complaint"]
        assert f"{number:03d}.png" in frames[number]["complaint"]
    assert sum(f["used"] for f in frames.values()) == len(frames) - 5


def test_a_frame_without_spots_is_left_out(cli: Cli, dataset: Path) -> None:
    image = cv2.imread(str(dataset / "images" / "003.png"), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(dataset / "images" / "003.png"), np.zeros_like(image))
    few = cv2.imread(str(dataset / "images" / "004.png"), cv2.IMREAD_UNCHANGED)
    few[:, 400:] = 0
    few[:700] = 0
    cv2.imwrite(str(dataset / "images" / "004.png"), few)
    frames = {f["frame"]: f for f in cli("calibrate", dataset, "--json").json["frames"]}
    assert frames[3]["reason"] == "no_spots"
    assert frames[4]["used"] is False
    assert frames[4]["reason"] in ("no_spots", "too_few_spots", "not_labelled")


def test_too_few_frames_give_no_answer(cli: Cli, dataset: Path) -> None:
    """Exit code 3, and the JSON is printed all the same."""
    lines = (dataset / "frames.csv").read_text().splitlines()
    (dataset / "frames.csv").write_text("\n".join(lines[:3]) + "\n")
    result = cli("calibrate", dataset, "--json")
    assert result.code == 3
    assert result.json["verdict"]["code"] == "too_few_poses"


def test_joints_out_of_range_are_named(cli: Cli, dataset: Path) -> None:
    lines = (dataset / "frames.csv").read_text().splitlines()
    cells = lines[2].split(",")
    cells[4] = "171.5"
    lines[2] = ",".join(cells)
    (dataset / "frames.csv").write_text("\n".join(lines) + "\n")
    answer = cli("calibrate", dataset, "--json").json
    frames = {f["frame"]: f for f in answer["frames"]}
    assert frames[1]["reason"] == "robot_out_of_range"
    assert any("joint 1 reads 171.5° in frame 1" in note and "170°" in note for note in answer["notes"])


def test_points_stand_in_place_of_images(cli: Cli, dataset: Path, answer: Any) -> None:
    """Extract's CSV, put in place of the images, gives the same answer as they do to the digits of the file."""
    with_images = answer
    assert cli("extract", dataset, "--csv", dataset / "points.csv").code == 0
    for image in (dataset / "images").iterdir():
        image.unlink()
    with_points = cli("calibrate", dataset / "cell.toml", "--json")
    assert with_points.code == 0, with_points.err
    assert np.allclose(with_points.json["T_hand_sensor"], with_images["T_hand_sensor"], rtol=0, atol=0.02)
    table = (dataset / "points.csv").read_text().splitlines()
    unlabelled = [table[0]]
    for line in table[1:]:
        cells = line.split(",")
        cells[1] = cells[6] = cells[7] = ""
        unlabelled.append(",".join(cells))
    (dataset / "points.csv").write_text("\n".join(unlabelled) + "\n")
    bare = cli("calibrate", dataset, "--json")
    assert bare.code == 0, bare.err
    assert np.allclose(bare.json["T_hand_sensor"], with_images["T_hand_sensor"], rtol=0, atol=0.1)


def test_a_result_beside_the_images_is_no_input(dataset: Path) -> None:
    """`demo` writes points.csv into its dataset: its second run must give the same bytes."""
    before = read_cell(dataset).files
    (dataset / "points.csv").write_text("what `calibrate --out` wrote\n")
    cell = read_cell(dataset)
    assert cell.points is None
    assert cell.files == before
    assert {"cell.toml", "sensor.toml", "jig.toml", "robot.toml", "frames.csv"} == {p.name for p in before}


def test_points_that_the_camera_can_not_see_are_told(cli: Cli, dataset: Path) -> None:
    """Points in millimetres need no camera: it is checked all the same, for its place's unit and for another's file."""
    assert cli("extract", dataset, "--csv", dataset / "points.csv").code == 0
    for image in (dataset / "images").iterdir():
        image.unlink()
    plain = (dataset / "sensor.toml").read_text()
    edit(dataset / "sensor.toml", "fx_px = 2300", "fx_px = 2400")
    other = cli("calibrate", dataset, "--json")
    assert any("measured by another sensor.toml" in note for note in other.json["notes"])
    (dataset / "sensor.toml").write_text(plain)
    edit(dataset / "sensor.toml", "translation_mm = [120.0, 0.0, 0.0]", "translation_mm = [4.72, 0.0, 0.0]")
    inches = cli("calibrate", dataset)
    assert inches.code == 2
    assert "nearly all if translation_mm of [camera.pose] holds inches" in inches.err


def test_hand_poses_stand_in_place_of_joints(cli: Cli, dataset: Path) -> None:
    """Without a table that the readings are known by, the default is the SCP alone, and the notes say so."""
    from geometry import quaternion_wxyz
    from workbench.files import read_cell

    cell = read_cell(dataset)
    lines = ["frame,image,location,role,x_mm,y_mm,z_mm,qw,qx,qy,qz"]
    for row in cell.frames:
        pose = cell.robot.pose(row.joints_rad)
        numbers = ",".join(f"{v:.9g}" for v in [*pose.t, *quaternion_wxyz(pose.R)])
        lines.append(f"{row.number},{row.image},{row.location},{row.role},{numbers}")
    (dataset / "frames.csv").write_text("\n".join(lines) + "\n")
    result = cli("calibrate", dataset, "--json")
    assert result.code == 0, result.err
    assert np.all(np.isfinite(result.json["T_hand_sensor"]))
    assert [f["frame"] for f in result.json["frames"] if f["reason"] == "outlier"] == []
    assert (result.json["model"], result.json["model_asked"]) == ("scp", "auto")
    assert any("the SCP alone was solved" in note for note in result.json["notes"])


def test_duplicate_image_content_does_not_crash(cli: Cli, dataset: Path) -> None:
    """Every frame shows the same image: an answer of some kind, with its exit code."""
    source = (dataset / "images" / "000.png").read_bytes()
    for image in (dataset / "images").iterdir():
        image.write_bytes(source)
    result = cli("calibrate", dataset, "--json")
    assert result.code in (0, 3)
    assert result.json["verdict"]["text"]


def test_cell_path_and_folder_are_the_same(cli: Cli, recording: Path, answer: Any) -> None:
    assert cli("calibrate", recording / "cell.toml", "--json").json == answer


def test_unknown_settings_key_is_named(cli: Cli, recording: Path, tmp_path: Path) -> None:
    settings = tmp_path / "settings.toml"
    settings.write_text("[detect]\nthreshold = 7.0\n[calib]\nmodle = 'scp'\n")
    result = cli("calibrate", recording, "--config", settings)
    assert result.code == 2
    assert "settings.toml, line 4" in result.err
    assert 'did you mean "model"' in result.err


def test_robot_comes_with_wrong_joint_count(cli: Cli, dataset: Path) -> None:
    edit(dataset / "frames.csv", ",j6_deg", ",j7_deg")
    result = cli("calibrate", dataset)
    assert result.code == 2
    assert "frames.csv, line 1" in result.err
    assert "robot of 6 joints" in result.err
