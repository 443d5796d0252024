"""From observed frames to the sensor centre position: labels, axis points, poses, SCP, verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.answer import Estimate, answer
from calib.assemble import by_location, location_pose
from calib.bundle.solution import Solution, make_problem, solve_problem
from calib.config import CalibConfig, Model
from calib.estimate import bundle_estimate, bundle_facts
from calib.given_jigs import given_jig_notes
from calib.hand_joints import hand_pose_notes, with_joints
from calib.judge.culprit import culprit
from calib.judge.culprit_jig import wrong_jig
from calib.judge.model_choice import choose_model, left_out_rms
from calib.judge.verdict import Motion, judge, judge_motion, misfit_limit, motion
from calib.label.relabel import relabel, settled
from calib.observation import Observations
from calib.paper.check import checked
from calib.paper.estimate import Starts, paper_estimate, paper_frames
from calib.result import CalibrationResult, Verdict
from calib.stations import Station, label, stations
from geometry import InputError, Pose, RobotModel, stack_poses
from jig_cad import Jig

Array = NDArray[np.float64]

CONTRADICTED = ("not_converged", "outliers", "rotation_too_small", "too_few_poses")


@dataclass(frozen=True, eq=False)
class Problem:
    """What calibrate was given, its defaults filled in."""

    observations: Observations
    jig: Jig
    robot: RobotModel | None
    config: CalibConfig


@dataclass(frozen=True, eq=False)
class _Solved:
    """The bundle's verdict with its answer; ``used``: the stations of the solution's frames."""

    verdict: Verdict
    estimate: Estimate | None = None
    solution: Solution | None = None
    used: tuple[Station, ...] = ()


def calibrate(
    observations: Observations, jig: Jig, robot: RobotModel | None, config: CalibConfig | None = None
) -> CalibrationResult:
    """Solve the sensor centre position from all frames with role calibrate; judge it on all locations.

    robot: its nominal table; None where every frame has T_base_hand. Raises InputError where the input can not be used
    at all; data from which no trustworthy answer follows give a result whose verdict says why.
    """
    if not observations.frames:
        raise InputError("the dataset has no frames")
    config = config or CalibConfig()
    observations = with_joints(observations, robot)
    p = Problem(observations, jig, robot, config)
    ready, solved = _prepare(p)
    if config.method == "paper":
        result = _paper(p, ready, solved)
    elif solved.solution is None or not solved.verdict.trustworthy:
        result = answer(observations, ready, jig, robot, config, solved.verdict, solved.estimate)
    else:
        kept, scores, words = _choose(p, solved.solution, solved.used)
        if kept.config.model != config.model:
            solved = _solve(kept, ready, solved.solution.T_hand_sensor)
        result = answer(observations, ready, jig, robot, kept.config, solved.verdict, solved.estimate)
        result = replace(result, left_out_rms_mm=scores, notes=(*result.notes, words, *_lonely(observations)))
    result = replace(result, verdict=_named(result.verdict, ready, jig, robot))
    return replace(result, notes=(*result.notes, *_remarks(p, ready, result)))


def _named(verdict: Verdict, ready: tuple[Station, ...], jig: Jig, robot: RobotModel | None) -> Verdict:
    """The verdict on data that contradict one another, with what the motions say of the cause before all else."""
    if verdict.code not in CONTRADICTED:
        return verdict
    found = wrong_jig(ready, jig) or culprit(ready, jig, robot)
    return replace(verdict, text=f"{found}. In all, {verdict.text}") if found else verdict


def _prepare(p: Problem) -> tuple[tuple[Station, ...], _Solved]:
    """Labels and axis points by design, then by the solved chain, with the bundle's answer; for both methods.

    The paper's iteration leaves labels and surface offsets open, and its own solution is too coarse to find them.
    """
    model: Model = "scp" if p.config.method == "paper" else p.config.model
    b = replace(p, config=p.config.model_copy(update={"method": "bundle", "model": model}))
    o, design = p.observations, p.observations.T_hand_sensor_design
    ready = label(stations(o, p.robot), o.sensor, design, o.T_base_jig, p.jig, b.config)
    solved = _solve(b, ready, design)
    for _ in range(p.config.relabel_rounds if any(f.axis is None for f in o.frames) else 0):
        if solved.solution is None or not solved.verdict.trustworthy:
            break
        again = _relabel(b, ready, solved.solution, solved.used)
        if settled(ready, again):
            break
        ready = again
        solved = _solve(b, ready, solved.solution.T_hand_sensor)
    return ready, solved


def _paper(p: Problem, ready: tuple[Station, ...], solved: _Solved) -> CalibrationResult:
    """The paper's answer to the prepared frames; the bundle's tells mirrors and outliers and judges it."""
    verdict, bundle = solved.verdict, solved.estimate
    design, trusted = p.observations.T_hand_sensor_design, bundle if verdict.trustworthy else None
    outlying = {**trusted.reasons, **trusted.outliers} if trusted is not None else {}
    used = tuple(s for s in ready if s.observation.role == "calibrate" and s.usable)
    frames = paper_frames(used, p.jig, outlying)
    moved = _motion(frames.stations)
    early = judge_motion(moved, p.config)
    if early is not None:
        return answer(p.observations, ready, p.jig, p.robot, p.config, early, None)
    starts = Starts(design, design if trusted is None else trusted.T_hand_sensor)
    estimate, facts = paper_estimate(frames, p.jig, p.robot, starts, p.config)
    own = judge(facts, moved, p.config)
    return answer(p.observations, ready, p.jig, p.robot, p.config, checked(own, estimate, verdict, bundle), estimate)


def _remarks(p: Problem, ready: tuple[Station, ...], result: CalibrationResult) -> tuple[str, ...]:
    """What is to be said of given jig poses and hand poses."""
    o = p.observations
    chain, groups = (result.T_hand_sensor or o.T_hand_sensor_design, result.robot), by_location(o, ready)
    found = {n: T for n in o.T_base_jig if n in groups and (T := location_pose(groups[n], p.jig, chain)) is not None}
    hands = hand_pose_notes(o, p.config.hand_floor_mm, p.config.hand_floor_deg)
    return (*given_jig_notes(o.T_base_jig, found, p.jig), *hands)


def _lonely(observations: Observations) -> tuple[str, ...]:
    """A sentence for every location with a single frame, which tells nothing: its name may be misspelt."""
    names = [f.location for f in observations.frames]
    lonely = [n for n in dict.fromkeys(names) if names.count(n) == 1]
    others = [n for n in dict.fromkeys(names) if n not in lonely]
    return tuple(
        f'location "{n}" has frame {observations.frames[names.index(n)].frame} alone and tells nothing of the SCP: '
        f"is it one of {', '.join(others)}?"
        for n in lonely
        if others
    )


def _choose(p: Problem, solution: Solution, used: tuple[Station, ...]) -> tuple[Problem, dict[str, float], str]:
    """Keep the model asked for unless it predicts locations that it did not see worse than scp alone."""
    asked = p.config.model
    models: tuple[Model, ...] = ("scp",) if asked == "scp" else ("scp", asked)
    scores = {m: left_out_rms(solution, used, p.config, m) for m in models}
    fits = solution.nominal <= misfit_limit(solution.dof, p.config.misfit_chi2)
    model, words = choose_model(scores, asked, nominal_fits=fits)
    known: dict[str, float] = {m: rms for m, rms in scores.items() if rms is not None}
    if asked == "scp":
        words = f"leaving one location out, its points are predicted to {known['scp']:.3f} mm" if known else words
    return replace(p, config=p.config.model_copy(update={"model": model})), known, words


def _solve(p: Problem, ready: tuple[Station, ...], T_hand_sensor: Pose) -> _Solved:
    """Solve the usable calibrate frames by the bundle, or say why they can not be."""
    used = tuple(s for s in ready if s.observation.role == "calibrate" and s.usable)
    moved = _motion(used)
    verdict = judge_motion(moved, p.config)
    if verdict is not None:
        return _Solved(verdict)
    problem = make_problem(used, p.jig, p.robot, p.config)
    solution = solve_problem(problem, [s.candidates for s in used], T_hand_sensor, p.config)
    facts = bundle_facts(solution, used, _refused(ready))
    return _Solved(judge(facts, moved, p.config), bundle_estimate(solution, used, p.config), solution, used)


def _motion(used: tuple[Station, ...]) -> Motion:
    names = list(dict.fromkeys(s.observation.location for s in used))
    place = np.array([names.index(s.observation.location) for s in used], dtype=np.intp)
    firsts = stack_poses([s.candidates[0] for s in used])
    return motion(stack_poses([s.T_base_hand for s in used]), firsts, place)


def _refused(ready: tuple[Station, ...]) -> tuple[Station, ...]:
    """Calibrate frames whose given labels no pose of the jig explains."""
    return tuple(s for s in ready if s.observation.role == "calibrate" and s.reason == "not_labelled" and len(s.axis))


def _relabel(
    p: Problem, ready: tuple[Station, ...], solution: Solution, used: tuple[Station, ...]
) -> tuple[Station, ...]:
    """Labels and axis points again, with the solved chain; given jig poses still decide the half turn."""
    chain, groups = (solution.T_hand_sensor, solution.robot), by_location(p.observations, ready)
    names = dict.fromkeys(s.observation.location for s in used)
    T_base_jig = {n: solution.bundle.state.Ts_base_jig[k] for k, n in enumerate(names)}
    others = {n: g for n, g in groups.items() if n not in T_base_jig}
    T_base_jig |= {n: T for n, g in others.items() if (T := location_pose(g, p.jig, chain)) is not None}
    fresh = stations(p.observations, solution.robot)
    return relabel(ready, fresh, p.observations, chain[0], T_base_jig, p.jig, p.config)
