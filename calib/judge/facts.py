"""The bundle's solution as an estimate, and the facts that its verdict rests on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle import ROBOT_EVIDENCE, ROBOT_TIMES, Solution
from calib.config import CalibConfig
from calib.engine import Result, covariance
from calib.judge.finding import SCATTERED, UNCERTAINTY, Finding, widened
from calib.judge.identifiability import weak_directions
from calib.judge.suspects import FILE_BLOCK, SuspectTrial
from calib.judge.verdict import Contradiction, Facts
from calib.result import Culprit, Estimate, Nominal, Pull
from geometry import Frame, Robot, Surface, Target

Array = NDArray[np.float64]

LARGEST_PULLS = 8  # that are shown


def bundle_estimate(
    solution: Solution, used: tuple[Frame, ...], config: CalibConfig, finding: Finding | None = None
) -> Estimate:
    """What the bundle says of SCP, robot, shape, and the ``used`` frames and their points.

    finding: what contradicts the data; covariances then carry it.
    """
    result, found = solution.result, solution.covariance
    numbers = [f.number for f in used]
    estimate = Estimate(
        T_hand_sensor=solution.T_hand_sensor,
        covariance=found.of("scp") + _floor(solution, config),
        robot=solution.robot,
        robot_delta=solution.parameters,
        robot_sigma=found.sigma("robot"),
        targets={n: _as_solved(solution, n) for n in solution.bundle.locations},
        shape_delta=np.concatenate([result.state.vector(b) for b in solution.bundle.shape_blocks]),
        shape_sigma=np.concatenate([found.sigma(b) for b in solution.bundle.shape_blocks]),
        chi2_per_dof=solution.chi2_per_dof,
        degrees_of_freedom=solution.dof,
        converged=result.converged,
        iterations=result.iterations,
        initial_cost=result.initial_cost,
        final_cost=result.cost,
        condition=solution.condition,
        noise=solution.noise | {"explained_chi2_per_dof": solution.explained},
        reasons={k: "outlier" for k, out in zip(numbers, solution.frame_outlier, strict=True) if out},
        outliers={k: out for k, out in zip(numbers, solution.outlier, strict=True) if np.any(out)},
        weak_directions=weak_directions(solution),
    )
    return estimate if finding is None else _with_finding(estimate, finding, config)


def _with_finding(estimate: Estimate, finding: Finding, config: CalibConfig) -> Estimate:
    """The estimate with what is said of its priors, and with covariances that allow for what may be wrong."""
    solution, floor = finding.solution, _floor(finding.solution, config)
    mine = _joint(finding, solution.covariance.total, solution.result)
    alone = _joint(finding, covariance(solution.alone).total, solution.alone)
    errors = finding.evidence.bundle.errors
    pulls = sorted((t for t in finding.trials if t.seen), key=lambda t: -t.gain)[:LARGEST_PULLS]
    larger = _larger_errors(solution)
    named = (() if larger is None else (larger,)) if finding.culprit is None else (_culprit(finding),)
    sensor = solution.result.unknowns.block("sensor")
    known = solution.bundle.errors
    estimated = known is not None and bool(np.any(sensor.free))
    return replace(
        estimate,
        covariance=mine[:6, :6] + floor,
        nominal=Nominal(solution.alone.state.pose("scp"), alone[:6, :6] + floor),
        joint_covariance=_joint(finding, solution.covariance.total, solution.result, doubted=True),
        whole_robot=_whole_robot(finding),
        errors=errors,
        sensor_delta=known.parameters(solution.result.state.vector("sensor")) if known and estimated else {},
        pulls=tuple(_pull(t) for t in pulls),
        culprit=named,
        prior_cost=finding.prior_cost,
        prior_expected=finding.prior_expected,
    )


def _whole_robot(finding: Finding) -> Robot | None:
    """The answer's robot with everything of it that could be wrong among its parameters."""
    hands, solved = finding.evidence.bundle.hands, finding.solution.parameters
    if hands.poses_only:
        return None
    return hands.robot.corrected(np.concatenate([solved, np.zeros(len(hands.sigma) - len(solved))]))


def _joint(finding: Finding, total: Array, result: Result, *, doubted: bool = False) -> Array:
    """Covariance of SCP, robot and sensor together, with what may be wrong."""
    mine, all_of = result.unknowns, finding.evidence.bundle.unknowns
    place = np.concatenate([all_of.indices(b.name)[: b.size] for b in mine.common])
    embedded = np.zeros((all_of.size, all_of.size))
    embedded[np.ix_(place, place)] = total
    free = np.zeros(all_of.size, dtype=bool)
    free[place] = mine.free
    every = widened(finding, free, embedded, doubted)
    kept = np.concatenate([all_of.indices(name) for name in ("scp", "robot", "sensor")])
    return np.asarray(every[np.ix_(kept, kept)])


def _floor(solution: Solution, config: CalibConfig) -> Array:
    return hand_floor(config) if solution.bundle.hands.poses_only else np.zeros((6, 6))


def _pull(trial: SuspectTrial) -> Pull:
    """A trial in the words and units of files; of several components the length."""
    s = trial.suspect
    size = s.per_unit if s.parameter in (UNCERTAINTY, SCATTERED) else s.of_file(trial.size)
    return Pull(FILE_BLOCK[s.block], s.parameter, s.row, size, s.unit, trial.pull)


def _culprit(finding: Finding) -> Culprit:
    if finding.culprit is None:
        raise ValueError("nothing contradicts the data")
    alike = tuple(t.suspect.parameter for t in finding.alike)
    return Culprit(**vars(_pull(finding.culprit)), same_as=alike)


def _larger_errors(solution: Solution) -> Culprit | None:
    """A robot whose readings follow from poses, and whose errors are larger than its file says."""
    times = solution.noise.get(ROBOT_TIMES)
    if times is None:
        return None
    return Culprit("robot", UNCERTAINTY, None, times, "times", solution.noise[ROBOT_EVIDENCE])


def _as_solved(solution: Solution, location: str) -> Target:
    """What stood at a location, its shape as solved."""
    term = next(t for t in solution.bundle.terms if t.target is solution.bundle.target_at(location))
    target = term.target
    return target.shaped(solution.result.state.vector(term.shape_block)) if isinstance(target, Surface) else target


def hand_floor(config: CalibConfig) -> NDArray[np.float64]:
    """Covariance (6, 6) of ξ from systematic errors of hand poses whose joints are not known."""
    sigma = [config.hand_floor_mm] * 3 + [np.deg2rad(config.hand_floor_deg)] * 3
    return np.diag(np.square(sigma))


def bundle_facts(
    solution: Solution, used: tuple[Frame, ...], refused: tuple[Frame, ...], finding: Finding | None = None
) -> Facts:
    """What the bundle is judged by; ``refused`` are calibrate frames whose given labels no pose explains."""
    contradiction = None
    if finding is not None and finding.culprit is not None:
        contradiction = Contradiction(_culprit(finding), finding.rest, finding.culprit.gross)
    elif (larger := _larger_errors(solution)) is not None:
        contradiction = Contradiction(larger, 0.0)
    out = (solution.outlier | solution.frame_outlier[:, None])[solution.bundle.present]
    lost = sum(len(f.axis) for f in refused)
    return Facts(
        converged=solution.result.converged,
        iterations=solution.result.iterations,
        chi2_per_dof=solution.chi2_per_dof,
        explained=solution.explained,
        dof=solution.dof,
        condition=solution.condition,
        noise_covariance=solution.covariance.noise_of("scp"),
        outlier_share=(int(out.sum()) + lost) / max(len(out) + lost, 1),
        outlying_strings=_outlying_features(solution, used),
        rival=solution.rival,
        locations=len(solution.bundle.locations),
        contradiction=contradiction,
        largest_pull=0.0 if finding is None else finding.rest,
        inferred=bool(solution.bundle.hands.inferred),
    )


def _outlying_features(solution: Solution, used: tuple[Frame, ...]) -> tuple[str, ...]:
    """Strings whose points are outliers in more than half of their frames, of which there are three or more."""
    counts: dict[str, list[bool]] = {}
    for f, out in zip(used, solution.outlier, strict=True):
        for label, o in zip(f.axis.label, out, strict=False):
            counts.setdefault(label, []).append(bool(o))
    return tuple(k for k, v in counts.items() if sum(v) > max(len(v) / 2, 2))
