"""The paper's method from labelled frames to an estimate: closed-form poses, the iteration, and a true covariance."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.answer import Estimate
from calib.closed_form import LABELS, closed_forms
from calib.config import CalibConfig
from calib.linearise import Linearised, initial_state, linearise
from calib.paper_scp import PaperProblem, PaperResult, PaperSettings, pairs, solve_paper
from calib.problem import Problem
from calib.solution import make_problem
from calib.starts import chain_start
from calib.stations import Station
from calib.verdict import Facts
from calib.weights import frame_covariance, removal
from geometry import AxisPoints, Pose, RobotModel
from jig_cad import Jig

Array = NDArray[np.float64]

_STEP_MM = 1e-4  # of the numeric derivative of the closed form
_H1_SLACK_MM = 2.0  # sign candidates that disagree in h₁ by this much more than the best are none


@dataclass(frozen=True, eq=False)
class PaperFrames:
    """The frames that have a closed form, their points in the order of LABELS (F, 5, 2), and why others have none."""

    stations: tuple[Station, ...]
    yz_mm: Array
    reasons: dict[int, str]


@dataclass(frozen=True, eq=False)
class Starts:
    """Where the iteration starts, and by which SCP the sign candidates are told apart."""

    T_hand_sensor: Pose
    signs: Pose


def paper_frames(used: tuple[Station, ...], jig: Jig, outlying: Collection[int] = ()) -> PaperFrames:
    """Leave out frames without the five strings, and those where noise makes a/l > 1, so that θ = acos(a/l) is none.

    outlying: frames with points that the others contradict; they have no five strings to be trusted.
    """
    kept, points, reasons = [], [], dict[int, str]()
    for s in used:
        number, given = s.observation.frame, dict(zip(s.axis.label, s.axis.yz_mm, strict=True))
        if number in outlying:
            reasons[number] = "outlier"
            continue
        if any(label not in given for label in LABELS):
            reasons[number] = "too_few_spots"
            continue
        yz = np.array([given[label] for label in LABELS])
        if not closed_forms(yz, jig.side_mm, jig.height_mm).defined:
            reasons[number] = (
                "outlier"  # noise puts a/l above 1: there is no angle whose cosine it is; the note counts them
            )
            continue
        kept.append(s)
        points.append(yz)
    return PaperFrames(tuple(kept), np.array(points).reshape(-1, 5, 2), reasons)


def paper_estimate(
    frames: PaperFrames, jig: Jig, robot: RobotModel | None, starts: Starts, config: CalibConfig
) -> tuple[Estimate, Facts]:
    """Run the paper's iteration on the frames' closed-form poses."""
    used = frames.stations
    problem = make_problem(tuple(_in_order(s, frames.yz_mm[i]) for i, s in enumerate(used)), jig, robot, config)
    forms = closed_forms(frames.yz_mm, jig.side_mm, jig.height_mm)
    choice, own = _signs(problem, starts.signs, forms.T_sensor_jig, forms.h1_disagreement_mm)
    offsets = _offset_joints(problem, config)
    paper = PaperProblem(
        own.t, problem.chain.T_base_hand, problem.location, problem.chain.robot, problem.chain.joints_rad, offsets
    )
    settings = PaperSettings(config.paper_damping, config.paper_switch, config.paper_tolerance)
    result = solve_paper(paper, starts.T_hand_sensor, settings)
    derivative = _derivative(frames.yz_mm, jig, choice)
    noise, robot_part, chi2, explained, dof = _uncertainty(problem, result, own, derivative)
    left = len(frames.reasons)
    delta, corrected = _corrected(robot, offsets, result.offsets_rad)
    facts = Facts(  # no points are left out, and no other answer is looked for
        result.converged,
        result.iterations,
        chi2,
        explained,
        dof,
        result.condition,
        noise,
        0.0,
        (),
        float("inf"),
        problem.n_locations,
    )
    estimate = Estimate(
        T_hand_sensor=result.T_hand_sensor,
        covariance=noise + robot_part,
        chi2_per_dof=chi2,
        degrees_of_freedom=dof,
        converged=result.converged,
        iterations=result.iterations,
        initial_cost=float(result.history[0] ** 2 * len(result.residual)) if len(result.history) else 0.0,
        final_cost=float(result.residual @ result.residual),
        condition=result.condition,
        noise={},
        reasons=frames.reasons,
        notes=(f"{left} frames were left out: without five strings to be trusted, or with a/l > 1",) if left else (),
        robot=corrected,
        robot_delta=delta,
        robot_sigma=np.zeros_like(delta),
    )
    return estimate, facts


def _corrected(
    robot: RobotModel | None, offsets: tuple[int, ...], offsets_rad: Array
) -> tuple[Array, RobotModel | None]:
    """What the estimated joint offsets change in the table (5, n), and the robot with it."""
    delta = np.zeros((5, 0 if robot is None else robot.n_joints))
    delta[0, list(offsets)] = offsets_rad
    return delta, robot.corrected(delta) if robot is not None and offsets else robot


def _in_order(s: Station, yz_mm: Array) -> Station:
    """The station with its points in the order of LABELS."""
    index = [s.axis.label.index(label) for label in LABELS]
    flag = tuple(s.axis.flag[i] for i in index) if s.axis.flag else ()
    axis = AxisPoints(LABELS, s.axis.spot[index], yz_mm, s.axis.cov_yz_mm2[index], flag)
    return Station(s.observation, s.T_base_hand, axis, s.candidates, s.reason)


def _signs(problem: Problem, T_hand_sensor: Pose, poses: Pose, h1_mm: Array) -> tuple[NDArray[np.intp], Pose]:
    """Which sign candidate (F,) each frame has: Eq. (7) rules out most, the other frames and the SCP the mirror."""
    candidates, indices = [], []
    for i in range(problem.n_frames):
        likely = np.flatnonzero(h1_mm[i] <= np.min(h1_mm[i]) + _H1_SLACK_MM)
        candidates.append(poses[i][likely])
        indices.append(likely)
    _, own = chain_start(problem, T_hand_sensor, candidates)
    nearest = [int(np.argmin(np.linalg.norm(c.t - own.t[i], axis=-1))) for i, c in enumerate(candidates)]
    return np.array([indices[i][k] for i, k in enumerate(nearest)], dtype=np.intp), own


def _offset_joints(problem: Problem, config: CalibConfig) -> tuple[int, ...]:
    robot = problem.chain.robot
    if robot is None or config.paper_joint_offsets == 0:
        return ()
    return tuple(range(robot.n_joints - config.paper_joint_offsets, robot.n_joints - 1))


def _derivative(yz_mm: Array, jig: Jig, choice: NDArray[np.intp]) -> Array:
    """Change of the closed form's jig origin with the points (F, 3, 10).

    Differences to both sides, or to one side where a/l > 1 leaves the other undefined.
    """
    step = np.zeros((11, 5, 2))
    step[1:].reshape(10, 10)[np.arange(10), np.arange(10)] = _STEP_MM
    rows, columns = np.arange(len(yz_mm))[:, None], choice[:, None]

    def origins(sign: float) -> Array:
        forms = closed_forms(yz_mm[:, None] + sign * step, jig.side_mm, jig.height_mm)
        return np.asarray(forms.T_sensor_jig.t[rows, np.arange(11), columns])  # (F, 11, 3), the first without a step

    above, below = origins(1.0), origins(-1.0)
    sides = np.isfinite(above[:, 1:, :1]).astype(float) + np.isfinite(below[:, 1:, :1])
    middle = above[:, :1]
    up = np.where(np.isfinite(above[:, 1:]), above[:, 1:] - middle, 0.0)
    down = np.where(np.isfinite(below[:, 1:]), middle - below[:, 1:], 0.0)
    return np.asarray(np.swapaxes((up + down) / (np.maximum(sides, 1.0) * _STEP_MM), -1, -2))


def _uncertainty(
    problem: Problem, result: PaperResult, own: Pose, derivative: Array
) -> tuple[Array, Array, float, float, int]:
    """Covariances (6, 6) of ξ through C⁺: of points, joints and anchors; of the robot. χ² without and with it."""
    jigs = (problem.chain.T_base_hand @ result.T_hand_sensor @ own)[_firsts(problem)]
    lin = linearise(problem, initial_state(problem, result.T_hand_sensor, jigs))
    base = problem.chain.T_base_hand.R @ result.T_hand_sensor.R
    to_origin = base @ derivative  # (F, 3, 10): from the points to x
    noise, anchors, robot = _origin_errors(problem, lin, to_origin)
    first, other = pairs(problem.location)
    difference = np.eye(problem.n_frames)[first] - np.eye(problem.n_frames)[other]  # (D, F)
    independent = np.einsum("af,fij,bf->aibj", difference, noise, difference).reshape(len(result.residual), -1)
    shared, dh = (np.tensordot(difference, g, 1).reshape(len(result.residual), -1) for g in (anchors, robot))
    stochastic = independent + shared @ shared.T
    gain = np.linalg.pinv(result.jacobian)[:6]
    dof = len(result.residual) - result.jacobian.shape[1]
    chi2, explained = (
        float(result.residual @ np.linalg.lstsq(c, result.residual, rcond=None)[0]) / max(dof, 1)
        for c in (stochastic, stochastic + dh @ dh.T)
    )
    return gain @ stochastic @ gain.T, gain @ dh @ dh.T @ gain.T, chi2, explained, dof


def _firsts(problem: Problem) -> list[int]:
    return [int(np.flatnonzero(problem.location == k)[0]) for k in range(problem.n_locations)]


def _origin_errors(problem: Problem, lin: Linearised, to_origin: Array) -> tuple[Array, Array, Array]:
    """Errors of x: covariance of its own noise (F, 3, 3), columns by anchors (F, 3, 12) and robot (F, 3, P).

    An error of the hand's pose moves the points that are seen as well as the chain; both act on x as if the points were
    exact and the jig had moved, so that one covariance of the points carries it.
    """
    f = problem.n_frames
    points = frame_covariance(problem, lin, removal(~problem.points.present), problem.chain.noise)
    anchors = to_origin @ lin.anchors.reshape(f, 10, 12) * problem.anchor_sigma_mm
    robot = to_origin @ (lin.hand.reshape(f, 10, 6) @ lin.parameters) * problem.chain.parameter_sigma
    return to_origin @ points @ np.swapaxes(to_origin, -1, -2), anchors, robot
