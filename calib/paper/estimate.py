"""The paper's method from labelled frames to an estimate: closed-form poses, the iteration, the answer."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Bundle, chain_start, make_bundle
from calib.config import CalibConfig
from calib.judge import Facts
from calib.paper.scp import PaperProblem, PaperResult, PaperSettings, solve_paper
from calib.paper.spread import PaperSpread, closed_form_derivative, paper_spread
from calib.pose import closed_form_strings, closed_forms
from calib.result import Estimate
from geometry import AxisPoints, Frame, Pose, Robot
from geometry.ties import first_least
from jig_cad import Jig

Array = NDArray[np.float64]

_SAME_MM = 1e-6  # candidates as near as this to a pose are equally near
_H1_SLACK_MM = 2.0  # sign candidates that disagree in h₁ by this much more than the best are none


@dataclass(frozen=True, eq=False)
class PaperFrames:
    """The frames that have a closed form, their points in the paper's order (F, 5, 2), and why others have none."""

    frames: tuple[Frame, ...]
    yz_mm: Array
    reasons: dict[int, str]


@dataclass(frozen=True, eq=False)
class Starts:
    """Where the iteration starts, and by which SCP the sign candidates are told apart."""

    T_hand_sensor: Pose
    signs: Pose


def paper_frames(used: tuple[Frame, ...], jig: Jig, outlying: Collection[int] = ()) -> PaperFrames:
    """Leave out frames without the five strings, and those where noise makes a/l > 1, so that θ = acos(a/l) is none.

    outlying: frames with points that the others contradict; they have no five strings to be trusted.
    """
    names, kept, points, reasons = closed_form_strings(jig), [], [], dict[int, str]()
    for f in used:
        number, given = f.number, dict(zip(f.axis.label, f.axis.yz_mm, strict=True))
        if number in outlying:
            reasons[number] = "outlier"
            continue
        if any(label not in given for label in names):
            reasons[number] = "too_few_spots"
            continue
        yz = np.array([given[label] for label in names])
        if not closed_forms(yz, jig.side_mm, jig.height_mm).defined:
            reasons[number] = (
                "outlier"  # noise puts a/l above 1: there is no angle whose cosine it is; the note counts them
            )
            continue
        kept.append(f)
        points.append(yz)
    return PaperFrames(tuple(kept), np.array(points).reshape(-1, 5, 2), reasons)


def paper_estimate(
    frames: PaperFrames, jig: Jig, robot: Robot | None, starts: Starts, config: CalibConfig
) -> tuple[Estimate, Facts]:
    """Run the paper's iteration on the frames' closed-form poses."""
    run = _run(frames, jig, robot, starts, config)
    spread = paper_spread(run.bundle, run.result, run.own, closed_form_derivative(frames.yz_mm, jig, run.choice))
    return _estimate(frames, robot, run, spread), _facts(run, spread)


@dataclass(frozen=True, eq=False)
class _Run:
    """The iteration's result, sign candidates chosen (F,), their poses (F), the robot's parameters that are free."""

    bundle: Bundle
    result: PaperResult
    choice: NDArray[np.intp]
    own: Pose
    offsets: tuple[int, ...]


def _run(frames: PaperFrames, jig: Jig, robot: Robot | None, starts: Starts, config: CalibConfig) -> _Run:
    names = closed_form_strings(jig)
    used = tuple(replace(f, axis=_in_order(f.axis, names, frames.yz_mm[i])) for i, f in enumerate(frames.frames))
    bundle = make_bundle(used, jig, robot, config)
    forms = closed_forms(frames.yz_mm, jig.side_mm, jig.height_mm)
    choice, own = _signs(bundle, starts.signs, forms.T_sensor_jig, forms.h1_disagreement_mm)
    offsets = _offsets(bundle, config)
    settings = PaperSettings(config.paper_damping, config.paper_switch, config.paper_tolerance)
    paper = PaperProblem(own.t, bundle.hands, bundle.location, offsets)
    return _Run(bundle, solve_paper(paper, starts.T_hand_sensor, settings), choice, own, offsets)


def _estimate(frames: PaperFrames, robot: Robot | None, run: _Run, spread: PaperSpread) -> Estimate:
    result, left = run.result, len(frames.reasons)
    delta, corrected = _corrected(robot, run)
    return Estimate(
        T_hand_sensor=result.T_hand_sensor,
        covariance=spread.noise + spread.robot,
        chi2_per_dof=spread.chi2_per_dof,
        degrees_of_freedom=spread.dof,
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


def _facts(run: _Run, spread: PaperSpread) -> Facts:
    """What the paper's answer is judged by: no points are left out, and no other answer is looked for."""
    return Facts(
        converged=run.result.converged,
        iterations=run.result.iterations,
        chi2_per_dof=spread.chi2_per_dof,
        explained=spread.explained,
        dof=spread.dof,
        condition=run.result.condition,
        noise_covariance=spread.noise,
        outlier_share=0.0,
        outlying_strings=(),
        rival=float("inf"),
        locations=len(run.bundle.locations),
    )


def _corrected(robot: Robot | None, run: _Run) -> tuple[Array, Robot | None]:
    """What the estimated joint offsets change of the robot's parameters (P,), and the robot with it."""
    values = np.zeros(len(run.bundle.hands.sigma))
    values[list(run.offsets)] = run.result.offsets_rad
    return values, run.bundle.hands.robot.corrected(values) if robot is not None and run.offsets else robot


def _in_order(axis: AxisPoints, names: tuple[str, ...], yz_mm: Array) -> AxisPoints:
    """The points in the order of ``names``."""
    index = [axis.label.index(label) for label in names]
    flag = tuple(axis.flag[i] for i in index) if axis.flag else ()
    return AxisPoints(names, axis.spot[index], yz_mm, axis.cov_yz_mm2[index], flag)


def _signs(bundle: Bundle, T_hand_sensor: Pose, poses: Pose, h1_mm: Array) -> tuple[NDArray[np.intp], Pose]:
    """Which sign candidate (F,) each frame has: Eq. (7) rules out most, the other frames and the SCP the mirror."""
    candidates, indices = [], []
    for i, h1 in enumerate(h1_mm):
        likely = np.flatnonzero(h1 <= np.min(h1) + _H1_SLACK_MM)
        candidates.append(poses[i][likely])
        indices.append(likely)
    _, own = chain_start(bundle, T_hand_sensor, candidates)
    nearest = [first_least(np.linalg.norm(c.t - own.t[i], axis=-1), _SAME_MM) for i, c in enumerate(candidates)]
    return np.array([indices[i][k] for i, k in enumerate(nearest)], dtype=np.intp), own


def _offsets(bundle: Bundle, config: CalibConfig) -> tuple[int, ...]:
    """The offsets of the last joints, as many as the configuration says, as numbers of the robot's parameters."""
    last = range(bundle.hands.robot.n_joints - config.paper_joint_offsets + 1, bundle.hands.robot.n_joints)
    return tuple(k for k, p in enumerate(bundle.hands.robot.parameters) if p.group == "theta" and p.joint in last)
