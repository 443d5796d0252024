"""verify, compare, calibrate --daily and --export, hand poses without a robot file."""

from __future__ import annotations

import csv
import hashlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from geometry import Pose, quaternion_wxyz
from tests.workbench.helpers import Cli, edit
from workbench.files import read_cell
from workbench.files.tables.controller import CONTROLLERS, controller_text

ATOL_MM, ATOL_DEG = 1e-3, 1e-5  # digits that the controllers' files hold
NUMBER = r"(-?\d+\.\d+)"


@pytest.fixture
def reference(answer: Any, tmp_path: Path) -> Path:
    path = tmp_path / "reference.json"
    path.write_text(json.dumps(answer))
    return path


def _moved(answer: Any, path: Path, mm: float, **changes: Any) -> Path:
    other = json.loads(json.dumps(answer)) | changes
    other["T_hand_sensor"][0][3] += mm
    path.write_text(json.dumps(other))
    return path


def test_inputs_are_named_with_their_hashes(answer: Any, recording: Path) -> None:
    found = {row["file"]: row["sha256"] for row in answer["inputs"]}
    assert {"cell.toml", "sensor.toml", "jig.toml", "robot.toml", "frames.csv"} <= found.keys()
    for name, digits in found.items():
        assert digits == hashlib.sha256((recording / name).read_bytes()).hexdigest()


def test_compare_judges_by_sigma_and_by_millimetres(cli: Cli, answer: Any, reference: Path, tmp_path: Path) -> None:
    sigma = np.sqrt(2) * answer["sigma_translation_mm"][0]
    same = cli("compare", reference, reference, "--json")
    assert same.code == 0
    assert same.json["distance_mm"] == 0
    near = _moved(answer, tmp_path / "near.json", float(2 * sigma))
    done = cli("compare", reference, near, "--json")
    assert done.code == 0, done.json
    assert done.json["translation_mm"][0] == pytest.approx(2 * sigma, abs=1e-6)
    assert done.json["sigma_translation_mm"][0] == pytest.approx(sigma, rel=1e-3)
    assert cli("compare", reference, near, "--max-mm", sigma).code == 1
    far = cli("compare", reference, _moved(answer, tmp_path / "far.json", float(5 * sigma)), "--json")
    assert far.code == 1
    assert far.json["verdict"]["code"] == "different"
    assert far.json["sigmas"] > 4


def test_results_of_other_sensor_files_are_not_compared_silently(
    cli: Cli, answer: Any, reference: Path, tmp_path: Path
) -> None:
    inputs = [row | {"sha256": "0" * 64} if row["file"] == "sensor.toml" else row for row in answer["inputs"]]
    other = _moved(answer, tmp_path / "other.json", 0.0, inputs=inputs)
    done = cli("compare", reference, other, "--json")
    assert done.code == 3
    assert done.json["verdict"]["code"] == "other_sensor"
    assert "sensor.toml" in done.json["verdict"]["text"]
    assert cli("compare", reference, other, "--other-sensor").code == 0


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("{", "is no JSON"),
        ("[1]", "holds no T_hand_sensor"),
        ('{"T_hand_sensor": [[1, 2], [3, 4]]}', "must be 4 × 4 finite numbers"),
        (json.dumps({"T_hand_sensor": [[10**400, 0, 0, 0]] * 4}), "must be 4 × 4 finite numbers"),
        ('{"T_hand_sensor": [[2,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}', "T_hand_sensor"),
    ],
)
def test_files_that_are_no_result_are_said_to_be_none(
    cli: Cli, reference: Path, tmp_path: Path, text: str, words: str
) -> None:
    (tmp_path / "bad.json").write_text(text)
    done = cli("compare", reference, tmp_path / "bad.json")
    assert done.code == 2
    assert words in done.err
    assert "bad.json" in done.err
    assert cli("compare", reference, tmp_path / "none.json").code == 2


def test_a_withheld_scp_is_nothing_to_compare(cli: Cli, answer: Any, reference: Path, tmp_path: Path) -> None:
    empty = tmp_path / "empty.json"
    empty.write_text(json.dumps(answer | {"T_hand_sensor": None, "covariance": None}))
    assert cli("compare", reference, empty).code == 3


def test_verify_judges_without_solving(cli: Cli, answer: Any, reference: Path, recording: Path) -> None:
    limit = 1.2 * max(p["point_rms_mm"]["nominal"] for p in answer["locations"].values())
    design = cli("verify", recording, "--json", "--max-rms-mm", limit)
    assert design.code == 1
    assert design.json["verdict"]["code"] == "above_limit"
    solved = cli("verify", recording, "--scp", reference, "--json", "--max-rms-mm", limit)
    assert solved.code == 0, solved.json["verdict"]
    # the robot's file is as it was; a rotation is made orthogonal where it is read
    np.testing.assert_allclose(solved.json["T_hand_sensor"], answer["T_hand_sensor_nominal"], rtol=0, atol=2e-9)
    for name, place in solved.json["locations"].items():
        assert place["point_rms_mm"]["solved"] < design.json["locations"][name]["point_rms_mm"]["solved"]
        assert place["point_rms_mm"]["design"] == pytest.approx(
            answer["locations"][name]["point_rms_mm"]["design"], abs=0.05
        )
        assert solved.json["left_out"]["point_rms_mm"][name] > place["point_rms_mm"]["solved"]


def test_verify_refuses_another_sensor(cli: Cli, reference: Path, dataset: Path) -> None:
    with (dataset / "sensor.toml").open("a") as file:
        file.write("\n# another\n")
    done = cli("verify", dataset, "--scp", reference)
    assert done.code == 2
    assert "another sensor.toml" in done.err


def test_daily_and_export_in_one_run(cli: Cli, answer: Any, reference: Path, recording: Path, tmp_path: Path) -> None:
    tool = tmp_path / "tool.script"
    done = cli("calibrate", recording, "--daily", reference, "--export", "ur", tool, "--json")
    assert done.code == 0
    assert done.json["daily"]["verdict"]["code"] == "same"
    numbers = [float(v) for v in re.findall(NUMBER, tool.read_text().splitlines()[-1])]
    entered = np.array(answer["T_hand_sensor_nominal"])[:3, 3]  # the controller's own table is the nominal one
    np.testing.assert_allclose(np.array(numbers[:3]) * 1000, entered, atol=ATOL_MM)
    far = _moved(answer, tmp_path / "far.json", 50.0)
    assert cli("calibrate", recording, "--daily", far).code == 1


@pytest.mark.parametrize("maker", CONTROLLERS)
def test_tool_frames_are_what_scipy_makes_of_them(maker: str) -> None:
    """The numbers of every maker, read by scipy's Rotation by its own conventions, give the matrix again."""
    rng = np.random.default_rng(4)
    for _ in range(5):
        R = Rotation.random(random_state=rng).as_matrix()
        pose = Pose(R, rng.uniform(-300, 300, 3))
        text = controller_text(pose, maker, "a test")
        assert text.isascii()
        body = [line for line in text.splitlines() if not line.startswith(CONTROLLERS[maker][0])]
        values = [float(v) for v in re.findall(NUMBER, "\n".join(body))]
        t, angles = np.array(values[:3]), np.array(values[3:7])
        if maker == "ur":
            t, found = t * 1000, Rotation.from_rotvec(angles[:3])
        elif maker == "abb":
            found = Rotation.from_quat(angles[[1, 2, 3, 0]])
        elif maker == "kuka":
            found = Rotation.from_euler("ZYX", angles[:3], degrees=True)
        else:
            found = Rotation.from_euler("xyz", angles[:3], degrees=True)
        np.testing.assert_allclose(t, pose.t, atol=ATOL_MM)
        apart = np.rad2deg((found.inv() * Rotation.from_matrix(R)).magnitude())
        assert apart < (2e-4 if maker == "yaskawa" else ATOL_DEG)


def test_hand_poses_need_no_robot_file(cli: Cli, answer: Any, dataset: Path) -> None:
    """The answer differs by what the nominal table's own errors are; σ carry a floor for them."""
    cell = read_cell(dataset)
    rows = []
    for frame in cell.frames:
        assert frame.joints_rad is not None
        hand = cell.arm.pose(frame.joints_rad)
        rows.append([frame.number, frame.image, frame.location, frame.role, *hand.t, *quaternion_wxyz(hand.R)])
    head = ["frame", "image", "location", "role", "x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz"]
    with (dataset / "frames.csv").open("w", newline="") as file:
        csv.writer(file).writerows([head, *rows])
    edit(dataset / "cell.toml", 'robot = "robot.toml"', "")
    done = cli("calibrate", dataset, "--json")
    assert done.code == 0, done.err
    apart = np.array(done.json["translation_mm"]) - answer["translation_mm"]
    assert np.all(np.abs(apart) < 4 * np.hypot(done.json["sigma_translation_mm"], answer["sigma_translation_mm"]))
    assert cli("plan", dataset).code == 2


def test_joints_need_a_robot_file(cli: Cli, dataset: Path) -> None:
    edit(dataset / "cell.toml", 'robot = "robot.toml"', "")
    done = cli("calibrate", dataset)
    assert done.code == 2
    assert "names no robot" in done.err
