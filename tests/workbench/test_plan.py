"""`plan`: proposals beat random choices, keep to the limits, are the same for the same seed, and can be rendered."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

import workbench.plan.proposal
from calib.bundle.information import scp_covariance
from geometry import Frame, Pose, Sensor, Sheet
from geometry.sensor import ProfileOutput
from jig_cad import Jig
from tests.workbench.helpers import Cli
from workbench.files import read_cell, read_frames
from workbench.plan import expected_points
from workbench.plan.expected import SURFACE_SIGMA_MM, view_information
from workbench.plan.next_view import with_file


@pytest.fixture(autouse=True)
def small_pool(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(workbench.plan.proposal, "POOL", 24)


def test_a_proposal(cli: Cli, recording: Path, tmp_path: Path) -> None:
    plan = recording.parent / "plan"
    call = ("plan", plan, "--per-location", 3, "--json", "--out", tmp_path / "views.csv")
    result = cli(*call)
    assert result.code == 0, result.err
    answer = result.json
    assert cli(*call).out == result.out
    assert answer["ratio_to_random"] < 0.8
    assert len(answer["frames"]) == 12
    assert max(abs(f["roll_deg"]) for f in answer["frames"]) > 90
    robot = read_cell(plan, recorded=False).robot
    rows = read_frames(tmp_path / "views.csv", robot.n_joints)
    assert all(robot.within_limits(row.joints_rad) for row in rows)
    assert {row.location: row.role for row in rows}["D"] == "verify"


def test_a_recording_without_places_is_solved_for_them(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """A copy without [locations]: its own frames tell where the jig stands and which places only verify."""
    shutil.copytree(recording, tmp_path / "cell")
    file = tmp_path / "cell" / "cell.toml"
    file.write_text(file.read_text().split("[locations")[0])
    result = cli("plan", file, "--per-location", 1, "--json")
    assert result.code == 0, result.err
    frames = result.json["frames"]
    assert {f["location"]: f["role"] for f in frames}["D"] == "verify"
    assert min(f["frame"] for f in frames) == len(read_cell(recording).frames)


@pytest.mark.slow
def test_frames_already_taken_count(cli: Cli, recording: Path) -> None:
    """With the recording's frames in hand the same number of further views knows every direction better.

    Of noise alone: the σ with the robot's own errors need not fall, since scp does not weigh by them.
    """
    alone = cli("plan", recording.parent / "plan", "--per-location", 2, "--json").json
    further = cli("plan", recording, "--per-location", 2, "--json").json
    assert further["observability"]["O3"] > alone["observability"]["O3"]
    taken = len(read_cell(recording).frames)
    assert min(f["frame"] for f in further["frames"]) == taken


def test_the_prediction_is_what_calibration_reports(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """Predicted against reported σ, the noise as stated: the views that are seen differ, and so do the points' σ."""
    config = tmp_path / "given.toml"
    config.write_text('[calib]\nnoise = "given"\nmodel = "scp"\n', encoding="utf-8")
    answer = cli("calibrate", recording, "--config", config, "--json").json
    cell = read_cell(recording)
    rows = [row for row in cell.frames if row.role == "calibrate"]
    names = list(dict.fromkeys(row.location for row in rows))
    from geometry import stack_poses

    info = view_information(
        cell.robot,
        cell.sensor,
        cell.jig,
        cell.T_hand_sensor_design,
        stack_poses([cell.T_base_jig[name] for name in names]),
        np.array([row.joints_rad for row in rows]),
        np.array([names.index(row.location) for row in rows]),
    )
    predicted = np.sqrt(np.diag(scp_covariance(info, range(len(rows)))))
    reported = np.sqrt(np.diag(np.array(answer["covariance"])))
    assert np.all(np.abs(np.log(predicted / reported)) < np.log(1.8)), predicted / reported


FIELD_MM = [[-80.0, 200.0], [80.0, 200.0], [140.0, 450.0], [-140.0, 450.0]]


def test_a_profile_sensor_is_planned_for(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """By its field of view and its stated noise; without them it is said which key is missing."""
    plan = recording.parent / "plan"
    for name in ("cell.toml", "jig.toml", "robot.toml", "frames.csv"):
        (tmp_path / name).write_bytes((plan / name).read_bytes())
    text = f"[profile]\nsigma_y_mm = 0.02\nsigma_z_mm = 0.01\nfield_of_view_mm = {FIELD_MM}\n"
    (tmp_path / "sensor.toml").write_text(text)
    result = cli("plan", tmp_path, "--per-location", 3, "--json")
    assert result.code == 0, result.err
    assert len(result.json["frames"]) == 12
    for key in ("sigma_z_mm = 0.01\n", f"field_of_view_mm = {FIELD_MM}\n"):
        (tmp_path / "sensor.toml").write_text(text.replace(key, ""))
        result = cli("plan", tmp_path, "--per-location", 3)
        assert result.code == 2
        assert key.split()[0] in result.err


@pytest.mark.parametrize(("column", "file"), [("image", "images/004.png"), ("profile", "profiles/004.csv")])
def test_a_plan_names_what_frames_csv_asks_for(recording: Path, tmp_path: Path, column: str, file: str) -> None:
    """A file that is not filled yet says by its header what is recorded."""
    folder = shutil.copytree(recording, tmp_path / "cell")
    frames = folder / "frames.csv"
    header = f"# a remark\nframe;{column};location;role;" + ";".join(f"j{i}_deg" for i in range(1, 7))
    frames.write_text(f"{header}\n", encoding="utf-8")
    row = with_file(read_cell(folder, recorded=False), Frame(4, "A", "calibrate", np.zeros(6)))
    assert file in (row.image, row.profile)


def test_points_of_a_profile_sensor_have_its_noise() -> None:
    sensor = Sensor(Sheet(), profile=ProfileOutput(sigma_y_mm=0.02, sigma_z_mm=0.01))
    jig, turn = Jig.nominal(), Pose.from_fixed_xyz_deg((0.0, 90.0, 0.0), (0.0, 0.0, 300.0))
    [axis] = expected_points(sensor, jig, Pose(turn.R[None], turn.t[None]))
    expected = np.diag([0.02**2, 0.01**2]) + SURFACE_SIGMA_MM**2 * np.eye(2)
    np.testing.assert_allclose(axis.cov_yz_mm2, np.broadcast_to(expected, (5, 2, 2)), rtol=0, atol=1e-15)


def test_an_unreachable_place_is_said(cli: Cli, recording: Path, tmp_path: Path) -> None:
    plan = recording.parent / "plan"
    for name in ("sensor.toml", "jig.toml", "robot.toml", "frames.csv"):
        (tmp_path / name).write_bytes((plan / name).read_bytes())
    (tmp_path / "cell.toml").write_text((plan / "cell.toml").read_text().replace("1560.0", "9560.0"))
    result = cli("plan", tmp_path)
    assert result.code == 3
    assert "location A" in result.err
