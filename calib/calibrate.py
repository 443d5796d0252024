"""From observed frames to the sensor centre position: labels, axis points, poses, SCP, verdict."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.answer import Estimate, answer
from calib.assemble import Chains, by_location, location_figures
from calib.config import CalibConfig, Model
from calib.estimate import bundle_estimate, bundle_facts
from calib.model_choice import choose_model, left_out_rms
from calib.observation import Observations
from calib.paper_estimate import paper_estimate, paper_frames
from calib.result import CalibrationResult, Verdict
from calib.solution import make_problem, solve_problem
from calib.stations import Station, label, stations
from calib.verdict import Facts, judge, judge_motion, motion
from geometry import InputError, Pose, RobotModel, stack_poses
from jig_cad import Jig

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Problem:
    """What calibrate was given, its defaults filled in."""

    observations: Observations
    jig: Jig
    robot: RobotModel | None
    config: CalibConfig


def calibrate(
    observations: Observations, jig: Jig, robot: RobotModel | None, config: CalibConfig | None = None
) -> CalibrationResult:
    """Solve the sensor centre position from all frames with role calibrate; judge it on all locations.

    robot: its nominal table; None where every frame has T_base_hand. Raises InputError where the input can not be used
    at all; data from which no trustworthy answer follows give a result whose verdict says why.
    """
    if not observations.frames:
        raise InputError("the dataset has no frames")
    p = Problem(observations, jig, robot, config or CalibConfig())
    design = observations.T_hand_sensor_design
    ready = label(stations(observations, robot), observations.sensor, design, observations.T_base_jig, jig, p.config)
    verdict, estimate = _solve(p, ready, design)
    spots = any(f.axis is None for f in observations.frames)
    # the paper's solution of few frames is too far off to look for labels by it
    for _ in range(p.config.relabel_rounds if spots and p.config.method == "bundle" else 0):
        if estimate is None or not verdict.trustworthy:
            break
        ready = _relabel(p, ready, estimate)
        verdict, estimate = _solve(p, ready, estimate.T_hand_sensor)
    if estimate is None or not verdict.trustworthy or p.config.method == "paper":
        return answer(observations, ready, jig, robot, p.config, verdict, estimate)
    kept, scores, words = _choose(p, ready, estimate)
    if kept.config.model != p.config.model:
        verdict, estimate = _solve(kept, ready, estimate.T_hand_sensor)
    result = answer(observations, ready, jig, robot, kept.config, verdict, estimate)
    return replace(result, left_out_rms_mm=scores, notes=(*result.notes, words, *_lonely(observations)))


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


def _choose(p: Problem, ready: tuple[Station, ...], estimate: Estimate) -> tuple[Problem, dict[str, float], str]:
    """Keep the model asked for unless it predicts locations that it did not see worse than scp alone."""
    used = tuple(s for s in ready if s.observation.role == "calibrate" and s.usable)
    used = tuple(s for s in used if s.observation.frame not in estimate.reasons)
    asked = p.config.model
    models: tuple[Model, ...] = ("scp",) if asked == "scp" else ("scp", asked)
    scores = {m: left_out_rms(used, p.jig, p.robot, estimate.T_hand_sensor, p.config, m) for m in models}
    model, words = choose_model(scores, asked)
    known: dict[str, float] = {m: rms for m, rms in scores.items() if rms is not None}
    if asked == "scp":
        words = f"leaving one location out, its points are predicted to {known['scp']:.3f} mm" if known else words
    return replace(p, config=p.config.model_copy(update={"model": model})), known, words


def _solve(p: Problem, ready: tuple[Station, ...], T_hand_sensor: Pose) -> tuple[Verdict, Estimate | None]:
    """Solve the usable calibrate frames by the method asked for, or say why they can not be."""
    used = tuple(s for s in ready if s.observation.role == "calibrate" and s.usable)
    papers = paper_frames(used, p.jig) if p.config.method == "paper" else None
    used = used if papers is None else papers.stations
    names = list(dict.fromkeys(s.observation.location for s in used))
    place = np.array([names.index(s.observation.location) for s in used], dtype=np.intp)
    firsts = stack_poses([s.candidates[0] for s in used])
    moved = motion(stack_poses([s.T_base_hand for s in used]), firsts, place)
    verdict = judge_motion(moved, p.config)
    if verdict is not None:
        return verdict, None
    estimate: Estimate
    facts: Facts
    if papers is not None:
        estimate, facts = paper_estimate(papers, p.jig, p.robot, T_hand_sensor, p.config)
    else:
        problem = make_problem(used, p.jig, p.robot, p.config)
        solution = solve_problem(problem, [s.candidates for s in used], T_hand_sensor, p.config)
        estimate, facts = bundle_estimate(solution, used), bundle_facts(solution, used, _refused(ready))
    return judge(facts, moved, p.config), estimate


def _refused(ready: tuple[Station, ...]) -> tuple[Station, ...]:
    """Calibrate frames whose given labels no pose of the jig explains."""
    return tuple(s for s in ready if s.observation.role == "calibrate" and s.reason == "not_labelled" and len(s.axis))


def _relabel(p: Problem, ready: tuple[Station, ...], estimate: Estimate) -> tuple[Station, ...]:
    """Labels and axis points again, with the solved chain; given jig poses still decide the half turn."""
    chains = Chains((p.observations.T_hand_sensor_design, p.robot), (estimate.T_hand_sensor, estimate.robot))
    fits = {n: location_figures(g, p.jig, chains).fit for n, g in by_location(p.observations, ready).items()}
    T_base_jig = {n: f.T_base_jig for n, f in fits.items() if f is not None}
    fresh = stations(p.observations, estimate.robot)
    return label(fresh, p.observations.sensor, estimate.T_hand_sensor, T_base_jig, p.jig, p.config, refined=True)
