"""One wrong number in a file is named, and the answer's σ hold all the same; sound cells accuse nobody.

Few cells, points with labels; benchmarks/calib_faults.py has the rates over many cells and kinds.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from calib import CalibConfig
from calib.bundle import solve_problem
from calib.judge.suspects import evidence_of
from calib.label.surface_offset import rough_offset
from calib.printed import nees
from calib.synthetic.cell import Noise, SyntheticCell, calibrated, made_cell, observe, random_cell
from calib.synthetic.problem import CALIBRATE_ONLY, problem_of, true_candidates
from geometry import DhRobot, Frame, RobotUncertainty
from jig_cad import Jig
from tests.pinned import pinned

NEES_LIMIT = 30.0  # a sound covariance exceeds it in 4 of 100,000 runs


def _wrong(**rows: list[float]) -> Callable[[SyntheticCell], tuple[DhRobot, Jig]]:
    return lambda cell: (cell.robot.with_changes(**rows), cell.jig)


FAULTS: dict[str, Callable[[SyntheticCell], tuple[DhRobot, Jig]]] = {
    "a2": _wrong(a=[0, 2.0, 0, 0, 0, 0]),
    "theta5": _wrong(theta=[0, 0, 0, 0, float(np.deg2rad(0.5)), 0]),
    "side_mm": lambda cell: (cell.robot, Jig.nominal(side_mm=cell.jig.side_mm + 0.5)),
}


@pytest.mark.parametrize("name", FAULTS)
@pytest.mark.parametrize("model", ["auto", "scp"])
def test_wrong_number_is_named_and_sigma_hold(name: str, model: str) -> None:
    rng = np.random.default_rng(12)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    robot, jig = FAULTS[name](cell)
    result = calibrated(observed, jig, robot, CalibConfig(model=model))
    pinned(result)
    assert result.verdict.code == "priors_contradict"
    (culprit,) = result.culprit
    assert name in (culprit.parameter, *culprit.same_as)
    assert culprit.parameter in result.verdict.text or f"of joint {culprit.row}" in result.verdict.text
    if result.verdict.trustworthy:
        assert result.T_hand_sensor is not None
        assert result.covariance is not None
        assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT
    else:
        assert result.covariance is None


def test_sound_cell_accuses_nobody_and_holds_both_answers() -> None:
    rng = np.random.default_rng(5)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, Noise())
    result = calibrated(observe(cell, made, rng, Noise()), cell.jig, cell.robot)
    pinned(result)
    assert (result.model, result.model_asked) == ("full", "auto")
    assert result.verdict.code == "ok"
    assert result.culprit == ()
    assert result.nominal is not None
    assert nees(made.T_hand_sensor, result.nominal.T_hand_sensor, result.nominal.covariance) < NEES_LIMIT


def test_pulls_of_sound_cells_are_standard_normal() -> None:
    """The mean square of all seen pulls of eight cells; pulls of one cell depend on one another."""
    squares = []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        cell = random_cell(rng, CALIBRATE_ONLY)
        made = made_cell(cell, rng, Noise())
        observed = observe(cell, made, rng, Noise())
        solution = solve_problem(
            problem_of(observed, cell), true_candidates(made), cell.design, CalibConfig(model="full")
        )
        trials = evidence_of(solution, observed.sensor).trials()
        squares += [t.pull**2 for t in trials if t.seen and len(t.where) == 1]
    assert 0.7 < np.mean(squares) < 1.4
    assert np.max(squares) < 4.0**2


def test_sensor_errors_by_its_file_widen_the_covariance() -> None:
    from geometry.sensor import SensorUncertainty

    rng = np.random.default_rng(6)
    cell = random_cell(rng, CALIBRATE_ONLY)
    observed = observe(cell, made_cell(cell, rng, Noise()), rng, Noise())
    stated = SensorUncertainty.from_sigma({"fx_px": 10.0, "plane_tilt_y_rad": 1e-3})
    doubtful = replace(observed, sensor=replace(observed.sensor, uncertainty=stated))
    plain, wide = (calibrated(o, cell.jig, cell.robot) for o in (observed, doubtful))
    estimated = calibrated(doubtful, cell.jig, cell.robot, CalibConfig(model="full+sensor"))
    pinned(estimated)
    assert plain.covariance is not None
    assert wide.covariance is not None
    assert estimated.covariance is not None
    assert np.trace(wide.covariance[:3, :3]) > np.trace(plain.covariance[:3, :3])
    assert estimated.trusted is not None
    assert set(estimated.trusted.sensor_delta) == {"fx_px", "plane_tilt_y_rad"}
    assert np.trace(estimated.covariance[:3, :3]) < np.trace(wide.covariance[:3, :3])


@pytest.mark.parametrize(("stated_mm", "trustworthy"), [(1.0, True), (3.0, False)])
def test_a_string_that_is_not_as_thick_as_its_file_says_is_named(stated_mm: float, trustworthy: bool) -> None:
    """Axes as labelling would have them, each as far behind the light that was seen as the file's diameter says.

    That the lit surface lies where it does is tested elsewhere: its place and its error are of one formula here.
    """
    rng = np.random.default_rng(7)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    chain = made.robot.pose(cell.joints_rad) @ made.T_hand_sensor

    def thick(f: Frame, i: int) -> Frame:
        R = (chain[i].inverse() @ made.T_base_jig[f.location]).R
        towards = np.stack([
            rough_offset(p, cell.jig.directions[k] @ R.T, 1.0, observed.sensor) for k, p in enumerate(f.axis.yz_mm)
        ])  # fmt: skip
        wrong = (stated_mm - cell.jig.string_diameter_mm) / 2
        yz = f.axis.yz_mm - wrong * towards
        return replace(f, axis=replace(f.axis, yz_mm=yz, offset_mm=stated_mm / 2 * towards))

    frames = tuple(thick(f, i) for i, f in enumerate(observed.frames))
    jig = replace(cell.jig, string_diameter_mm=stated_mm)
    result = calibrated(replace(observed, frames=frames), jig, cell.robot)
    pinned(result)
    assert result.verdict.code == "priors_contradict"
    assert "string_diameter_mm of jig.toml" in result.verdict.text
    assert result.culprit[0].parameter == "string_diameter_mm"
    assert result.verdict.trustworthy == trustworthy
    if trustworthy:
        assert result.T_hand_sensor is not None
        assert result.covariance is not None
        assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT


@pytest.mark.parametrize(
    ("numbers", "named"), [("table", "[uncertainty]"), ("all", "[uncertainty]"), ("joints", "joint_sigma_deg")]
)
def test_uncertainty_stated_ten_times_too_small_is_named_and_sigma_hold(numbers: str, named: str) -> None:
    """σ that are too small in the file, of the table's rows, of readings, or of both; no proof of factors of 2."""
    rng = np.random.default_rng(12)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    u = cell.robot.uncertainty
    table = RobotUncertainty(
        u.joint_sigma_rad, u.theta_sigma_rad / 10, u.d_sigma_mm / 10, u.a_sigma_mm / 10, u.alpha_sigma_rad / 10
    )
    stated = u if numbers == "joints" else table
    if numbers != "table":
        stated = replace(stated, joint_sigma_rad=u.joint_sigma_rad / 10)
    robot = replace(cell.robot, uncertainty=stated)
    result = calibrated(observed, cell.jig, robot, CalibConfig())
    pinned(result)
    assert result.verdict.code == "priors_contradict"
    (culprit,) = result.culprit
    assert culprit.parameter.endswith(named)
    assert 4 < culprit.size < 25
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT


@pytest.mark.parametrize("joint", [2, 4])
def test_gear_of_another_ratio_is_named_and_what_is_predicted_holds(joint: int) -> None:
    """The scale of one joint's readings, estimated with the answer; its σ of predictions counts it."""
    rng = np.random.default_rng(12)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    more = np.ones(6)
    more[joint - 1] = 1.004
    read = [replace(f, joints_rad=q * more) for f in observed.frames if (q := f.joints_rad) is not None]
    result = calibrated(replace(observed, frames=tuple(read)), cell.jig, cell.robot, CalibConfig())
    pinned(result)
    assert result.verdict.code == "priors_contradict"
    (culprit,) = result.culprit
    assert (culprit.parameter, culprit.row, culprit.unit) == (f"reading_scale{joint}", joint, "%")
    assert abs(culprit.size + 0.4) < 0.1
    assert f"the scale of joint {joint}'s readings" in result.verdict.text
    assert result.trusted is not None
    assert result.robot is not None
    assert nees(made.T_hand_sensor, result.trusted.T_hand_sensor, result.trusted.covariance) < NEES_LIMIT
    q = cell.joints_rad[:1] * more
    sheet = np.array([[[0.0, 290.0]]])
    covariance = result.trusted.predicted_covariance(q, sheet)[0, 0]
    point = np.array([0.0, 0.0, 290.0])
    predicted = (result.robot.pose(q[0]) @ result.trusted.T_hand_sensor) @ point
    true = (made.robot.pose(cell.joints_rad[0]) @ made.T_hand_sensor) @ point
    error = predicted - true  # a turn about joint 1 and a shift along it have their priors
    assert float(error @ np.linalg.solve(covariance, error)) < NEES_LIMIT


def test_encoder_that_turns_two_axes_is_named_as_one_number() -> None:
    """As where a parallelogram couples joints 2 and 3: the reading's zero is one number, two rows of the table move."""
    rng = np.random.default_rng(12)
    plain = random_cell(rng, CALIBRATE_ONLY)
    coupling = np.eye(6)
    coupling[2, 1] = 1.0
    joints = np.asarray(np.linalg.solve(coupling, plain.joints_rad.T).T, dtype=np.float64)
    cell = replace(plain, robot=replace(plain.robot, coupling=coupling), joints_rad=joints)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    off = float(np.deg2rad(0.6))
    read = [replace(f, joints_rad=q - off * np.eye(6)[1]) for f in observed.frames if (q := f.joints_rad) is not None]
    result = calibrated(replace(observed, frames=tuple(read)), cell.jig, cell.robot, CalibConfig())
    pinned(result)
    (culprit,) = result.culprit
    assert culprit.parameter == "readings of joint 2 (theta2, theta3)"
    assert culprit.row == 2
    assert abs(culprit.size - 0.6) < 0.15
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(made.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT


@pytest.mark.parametrize(("row", "named"), [("theta3", "theta3"), ("alpha4", "[uncertainty]")])
def test_hand_poses_of_a_wrong_table_get_the_verdict_of_joints(row: str, named: str) -> None:
    """Which solution of the arm a frame stood in is not known: large errors show, their row mostly by small ones."""
    rng = np.random.default_rng(12)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, Noise())
    observed = observe(cell, made, rng, Noise())
    group, joint = row[:-1], int(row[-1]) - 1
    robot = cell.robot.with_changes(**{group: np.deg2rad(0.4) * np.eye(6)[joint]})
    Ts = robot.pose(np.array([f.joints_rad for f in observed.frames]))
    posed = tuple(replace(f, joints_rad=None, T_base_hand=Ts[i]) for i, f in enumerate(observed.frames))
    joints = calibrated(observed, cell.jig, robot, CalibConfig())
    pinned(joints)
    poses = calibrated(replace(observed, frames=posed), cell.jig, robot, CalibConfig())
    pinned(poses)
    assert joints.verdict.code == poses.verdict.code == "priors_contradict"
    for result, name in ((joints, row), (poses, named)):
        (culprit,) = result.culprit
        assert name in (culprit.parameter, *culprit.same_as)
    assert poses.T_hand_sensor is not None
    assert poses.covariance is not None
    assert nees(made.T_hand_sensor, poses.T_hand_sensor, poses.covariance) < NEES_LIMIT
