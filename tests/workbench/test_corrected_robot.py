"""`calibrate --out` writes a robot that the model corrected, in the form in which it was given."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from calib import CalibConfig
from calib.result import CalibrationResult
from calib.synthetic.cell import Noise, calibrated, made_cell, observe, random_cell
from calib.synthetic.problem import CALIBRATE_ONLY
from geometry import Compliance, Compliant
from tests.workbench.helpers import Cli
from tests.workbench.test_urdf import SIX, urdf_text
from workbench.files import Cell, read_cell, read_robot
from workbench.files.robots.urdf import read_urdf
from workbench.report.robot import write_corrected_robot

COMPLIANCE_ATOL = 1e-5  # [mm]: six digits of compliance
COMPLIANCE_ATOL = 1e-4  # mm: six digits of compliance
ATOL = 1e-6  # mm, and of rotation matrices


def _result(model: str) -> CalibrationResult:
    rng = np.random.default_rng(3)
    cell = random_cell(rng, CALIBRATE_ONLY)
    observed = observe(cell, made_cell(cell, rng, Noise()), rng, Noise())
    return calibrated(observed, cell.jig, cell.robot, CalibConfig(model=model))


def test_a_table_is_written_as_a_table(recording: Path, tmp_path: Path) -> None:
    cell: Cell = read_cell(recording)
    result = _result("full")
    write_corrected_robot(tmp_path, cell, result)
    again, q = read_robot(tmp_path / "robot_corrected.toml"), np.linspace(-1, 1, 6)
    assert result.robot is not None
    np.testing.assert_allclose(again.pose(q).matrix, result.robot.pose(q).matrix, rtol=0, atol=ATOL)
    assert np.abs(again.pose(q).t - result.robot.corrected(-result.robot_delta).pose(q).t).max() > 0.01


def test_compliance_is_kept(recording: Path, tmp_path: Path) -> None:
    """Solved compliance stands in the file's [compliance]: read back, the arm is the one that was solved."""
    cell, result = read_cell(recording), _result("scp")
    arm = Compliant(cell.arm, Compliance(), sigma=1e-7)
    delta = np.zeros(len(arm.parameters))
    delta[-1] = 2.5e-8
    assert result.estimate is not None
    solved = arm.corrected(delta)
    made = replace(result, estimate=replace(result.estimate, robot=solved, robot_delta=delta))
    write_corrected_robot(tmp_path, cell, made)
    again = read_robot(tmp_path / "robot_corrected.toml")
    assert isinstance(again, Compliant)
    assert again.load.stiffness[-1] == pytest.approx(1 / (1 / Compliance().stiffness[-1] + 2.5e-8), rel=1e-5)
    q = np.linspace(-1, 1, 6)
    np.testing.assert_allclose(again.pose(q).matrix, solved.pose(q).matrix, rtol=0, atol=COMPLIANCE_ATOL)


def test_a_urdf_is_written_as_a_urdf(recording: Path, tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(urdf_text(SIX))
    (tmp_path / "robot.toml").write_text('urdf = "arm.urdf"\nbase = "L0"\ntip = "L9"\n')
    nominal = read_urdf(tmp_path / "arm.urdf", "L0", "L9")
    made = nominal.with_changes(theta=np.full(nominal.n_joints, 1e-3), a=np.full(nominal.n_joints, 0.2))
    cell = replace(read_cell(recording), robot=nominal, robot_path=tmp_path / "robot.toml")
    result = _result("scp")
    assert result.estimate is not None
    result = replace(result, estimate=replace(result.estimate, robot=made, robot_delta=np.ones(24)))
    write_corrected_robot(tmp_path, cell, result)
    again, q = read_urdf(tmp_path / "robot_corrected.urdf", "L0", "L9"), np.linspace(-1, 1, nominal.n_joints)
    np.testing.assert_allclose(again.pose(q).matrix, made.pose(q).matrix, atol=ATOL)


def test_a_robot_that_did_not_change_is_not_written(cli: Cli, recording: Path, tmp_path: Path) -> None:
    write_corrected_robot(tmp_path, read_cell(recording), _result("scp"))
    assert not list(tmp_path.iterdir())
    out = tmp_path / "out"
    assert cli("calibrate", recording, "--model", "full", "--out", out).code == 0
    kept = json.loads((out / "result.json").read_text())["model"]
    assert (out / "robot_corrected.toml").exists() == (kept == "full")
