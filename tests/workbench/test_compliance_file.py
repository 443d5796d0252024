"""[compliance] of robot.toml: read, written, in one sentence where it is wrong, and estimated by calibrate."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import assets
from geometry import Compliant, InputError, assumed_compliance
from tests.workbench.helpers import Cli
from workbench.files import read_cell, read_robot, robot_text

STATED = """
[compliance]
compliance_urad_nm = [0.0, 2.5, 1.1, 2.5, 0.0, -0.2]
mass_kg = [0.0, 250.0, 120.0, 180.0, 40.0, 20.0]
payload_kg = 12.5
balanced = [0.0, 0.8, 0.0, 0.0, 0.0, 0.0]
up = [0.0, 0.0, -2.0]
"""
ATOL_POSE = 1e-6


def _robot(path: Path, table: str) -> Path:
    path.write_text(assets.path("robots", "abb_irb6640_180_255").read_text() + table)
    return path


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    robot = read_robot(_robot(tmp_path / "robot.toml", STATED))
    assert isinstance(robot, Compliant)
    assert robot.load.up == (0.0, 0.0, -1.0)
    assert robot.load.stiffness[0] == np.inf
    assert 1 / robot.load.stiffness[1] == pytest.approx(2.5e-6)
    sigma = np.asarray(robot.sigma)
    np.testing.assert_allclose(sigma[[1, 2, 5]], [1.25e-6, 0.55e-6, 0.1e-6], rtol=1e-12)  # half of what is stated
    assert sigma[0] == pytest.approx(1 / assumed_compliance(robot).stiffness[0])
    (tmp_path / "again.toml").write_text(robot_text(robot))
    again = read_robot(tmp_path / "again.toml")
    q = np.random.default_rng(0).uniform(-1, 1, (5, 6))
    np.testing.assert_allclose(again.pose(q).matrix, robot.pose(q).matrix, rtol=0, atol=ATOL_POSE)
    assert [p.name for p in again.parameters] == [p.name for p in robot.parameters]
    assert robot_text(again) == robot_text(robot)


def test_an_empty_table_is_an_arm_that_may_bend(tmp_path: Path) -> None:
    robot = read_robot(_robot(tmp_path / "robot.toml", "\n[compliance]\n"))
    assert sum(p.group == "compliance" for p in robot.parameters) == 6
    exact = read_robot(_robot(tmp_path / "robot.toml", "\n[compliance]\nsigma_urad_nm = 0.0\n"))
    assert not any(p.group == "compliance" for p in exact.parameters)


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("compliance_urad_nm = [1.0, 2.0]", "compliance_urad_nm has 2 values for 6 joints"),
        ("mass_kg = [1.0, 2.0, 3.0, 4.0, 5.0, -6.0]", "mass_kg"),
        ("balanced = [0.0, 80.0, 0.0, 0.0, 0.0, 0.0]", "must be a share"),
        ("up = [0.0, 0.0, 0.0]", "must point against gravity"),
        ("stiffness = [1.0]", "unknown key"),
        ("sigma_urad_nm = -1.0", "sigma_urad_nm"),
        ("payload_kg = nan", "payload_kg"),
    ],
)
def test_bad_tables_are_one_sentence(table: str, words: str, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"robot\.toml") as error:
        read_robot(_robot(tmp_path / "robot.toml", f"\n[compliance]\n{table}\n"))
    assert words in str(error.value)


def test_calibrate_says_what_it_found_of_the_joints(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """The recorded arm is rigid: no joint gives way by more than its σ allows, and the corrected file has the table."""
    out = tmp_path / "out"
    result = cli("calibrate", recording, "--model", "full+compliance", "--json", "--out", out)
    assert result.code == 0, result.err
    answer = result.json
    assert answer["model"] == "full+compliance"
    joints = answer["compliance"]
    assert [j["joint"] for j in joints] == [1, 2, 3, 4, 5, 6]
    assert all(abs(j["urad_nm"]) < 4 * j["sigma_urad_nm"] for j in joints)
    assert not joints[0]["observed"]
    kept = read_robot(out / "robot_corrected.toml")
    assert isinstance(kept, Compliant)
    assert kept.n_joints == read_cell(recording).arm.n_joints
    assert cli("calibrate", recording, "--model", "full", "--json").json["compliance"] == []
