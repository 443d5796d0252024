"""Recording in emulation: same seed same bytes, resuming, honest failure; datasets survive writing and reading."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from geometry import Arm, Compliance, Compliant, DhRobot, Pose
from tests.workbench.helpers import Cli, edit
from workbench.emulate.recipe import recipe_name
from workbench.files import read_cell, read_robot, write_cell

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


def test_a_changed_robot_is_recorded_anew(cli: Cli, plan: Path, tmp_path: Path) -> None:
    """A β that was not there before, the same readings and the same seed: no image of the old arm is kept."""
    for name in ("sensor.toml", "jig.toml", "robot.toml", "frames.csv", "cell.toml"):
        (tmp_path / name).write_bytes((plan / name).read_bytes())
    resumed, fresh = tmp_path / "resumed", tmp_path / "fresh"
    assert cli("render", tmp_path, "--out", resumed, *SMALL).code == 0
    before, views = _digest(resumed), tmp_path / "views.csv"
    views.write_bytes((resumed / "frames.csv").read_bytes())
    edit(tmp_path / "robot.toml", "min_deg = -170.0", "beta_deg = 0.05\nmin_deg = -170.0")
    for out in (resumed, fresh):
        assert cli("render", tmp_path, "--out", out, "--joints", views, "--seed", 5).code == 0
    assert _digest(resumed) == _digest(fresh)
    assert _digest(resumed)["images/000.png"] != before["images/000.png"]
    dh = json.loads((resumed / "truth.json").read_text())["dh"]
    assert dh[0]["beta_deg"] == pytest.approx(0.05, abs=1e-9)


CHANGES: dict[str, Callable[[DhRobot], Arm]] = {
    "beta": lambda r: r.with_changes(beta=1e-3 * np.eye(6)[1]),
    "sign": lambda r: replace(r, sign=r.sign * [1, 1, 1, -1, 1, 1]),
    "coupling": lambda r: replace(r, coupling=np.eye(6)[[0, 1, 2, 3, 5, 4]]),
    "convention": lambda r: replace(r, convention="modified"),
    "hand": lambda r: replace(r, T_last_hand=Pose.exp([0, 0, 1e-3, 0, 0, 0])),
    "compliance": lambda r: Compliant(r),
    "masses": lambda r: Compliant(r, Compliance(payload_kg=1.0)),
}


def test_a_recipe_holds_the_whole_robot(plan: Path) -> None:
    robot = read_robot(plan / "robot.toml")
    names = {recipe_name(robot), *(recipe_name(change(robot)) for change in CHANGES.values())}
    assert len(names) == 1 + len(CHANGES)
    assert recipe_name(read_robot(plan / "robot.toml")) == recipe_name(robot)


def test_last_bits_are_no_part_of_a_recipe(plan: Path) -> None:
    """What another processor computes; the digits above are."""
    robot = read_robot(plan / "robot.toml")
    bits = replace(robot, d=np.nextafter(robot.d, np.inf), T_last_hand=Pose.exp(np.full(6, -1e-17)))
    assert recipe_name(bits) == recipe_name(robot)
    assert recipe_name(replace(robot, d=robot.d * (1 + 1e-10))) != recipe_name(robot)
    assert recipe_name(0.1 + 0.2, -0.0, np.array([1.0])) == recipe_name(0.3, 0.0, np.array([np.nextafter(1.0, 0.0)]))
    with pytest.raises(TypeError, match="a recipe can not hold object"):
        recipe_name(object())


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


def test_what_a_killed_recording_left_is_noticed_and_made_anew(
    cli: Cli, plan: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Emptied, cut and damaged images and parts, a leftover among them: the result is the same, byte by byte."""
    whole, killed = tmp_path / "whole", tmp_path / "killed"
    assert cli("render", plan, "--out", whole, *SMALL).code == 0
    with monkeypatch.context() as patched:
        patched.setattr("workbench.emulate.recording.write_cell", _killed)
        assert cli("render", plan, "--out", killed, *SMALL).code == 130
    parts = sorted((killed / ".parts").glob("*.json"))
    images = sorted((killed / "images").glob("*.png"))
    parts[0].write_text("")
    parts[1].write_bytes(parts[1].read_bytes()[:40])
    images[2].write_bytes(b"")
    images[3].write_bytes(images[3].read_bytes()[:-200])
    (killed / ".parts" / ".000.json.abc.part").write_text("half")
    assert cli("render", plan, "--out", killed, *SMALL).code == 0
    assert _digest(killed) == _digest(whole)
    (killed / "truth.json").write_text("{")
    images[1].write_bytes(b"")
    assert cli("render", plan, "--out", killed, *SMALL).code == 0
    assert _digest(killed) == _digest(whole)


def _killed(*_: object) -> None:
    raise KeyboardInterrupt


def test_a_starter_that_was_killed_half_way_is_completed(cli: Cli, plan: Path, tmp_path: Path) -> None:
    (tmp_path / "images").mkdir()
    (tmp_path / "robot.toml").write_bytes((plan / "robot.toml").read_bytes())
    (tmp_path / ".sensor.toml.x1.part").write_text("half")
    assert cli("init", tmp_path).code == 0
    assert (tmp_path / "cell.toml").read_bytes() == (plan / "cell.toml").read_bytes()
    other = tmp_path / "other"
    other.mkdir()
    (other / "robot.toml").write_text("# my own\n")
    assert cli("init", other).code == 2
    assert (other / "robot.toml").read_text() == "# my own\n"
