"""The bundle's answer judged: suspects, parts left out in turn, which table to use, σ at least the jackknife's."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.answer import answer
from calib.bundle import Solution, given_noise
from calib.config import Model
from calib.judge import (
    FEWEST_LEFT_OUT,
    UNCHECKED,
    at_least,
    equal_weights,
    evidence_contradicts,
    jackknife_covariance,
    left_out,
    misfit_limit,
    table_advice,
    weak_by_jackknife,
)
from calib.result import SIGMA_HOLDS, CalibrationResult, LeftOut, Verdict
from calib.stages.evidence import told_by_evidence_alone
from calib.stages.setup import Prepared, Setup, Solved
from calib.stages.solve import try_suspects
from geometry import Frame, Surface, locations_of


def judged_answer(prepared: Prepared) -> CalibrationResult:
    """The answer of the bundle, with how well it predicts what was left out where it can be trusted."""
    setup, labelled = prepared.setup, prepared.labelled
    judged = try_suspects(setup, labelled, prepared.solved)
    alone = told_by_evidence_alone(prepared, judged)
    judged = judged if alone is None else replace(prepared.solved, verdict=alone)
    beside = None if judged.solution is None else evidence_contradicts(judged.solution)
    if beside is not None and judged.verdict.code in SIGMA_HOLDS:
        judged = replace(judged, verdict=beside)
    result = answered(setup, labelled, judged)
    if judged.solution is None or not judged.verdict.trustworthy:
        return result
    parts, scores, words = _left_out(setup, judged.solution, judged.used, labelled)
    few = _too_few(judged.solution, parts, setup)
    if few is not None:
        return answered(setup, labelled, Solved(few))
    result = _by_jackknife(result, parts, judged, labelled)
    return replace(result, left_out=parts, left_out_rms_mm=scores, remarks=(words, *_lonely(prepared.given)))


def answered(setup: Setup, labelled: tuple[Frame, ...], solved: Solved) -> CalibrationResult:
    """Everything that is said of a solution, or of none."""
    return answer(labelled, setup.target, setup.robot, setup.design, setup.config, solved.verdict, solved.estimate)


def _left_out(
    setup: Setup, solution: Solution, used: tuple[Frame, ...], labelled: tuple[Frame, ...]
) -> tuple[LeftOut | None, dict[str, float], str]:
    """How well parts are predicted that were left out, by the model and by the SCP alone; which table to use."""
    asked = setup.config.model
    models: tuple[Model, ...] = ("scp",) if asked == "scp" else ("scp", asked)
    raw = {f.number: f for f in labelled}
    found = {m: left_out(solution, used, raw, setup.config, m) for m in models}
    known: dict[str, float] = {m: parts.point_rms_mm for m, parts in found.items() if parts is not None}
    mine = found[asked]
    if mine is None or mine.by == "frame":
        each = (
            "" if mine is None else f"; leaving one frame out, its points are predicted to {mine.point_rms_mm:.3f} mm"
        )
        return mine, known, f"{UNCHECKED}{each}"
    if asked == "scp":
        return mine, known, f"leaving one location out, its points are predicted to {known['scp']:.3f} mm"
    fits = solution.nominal <= misfit_limit(solution.dof, setup.config.misfit_chi2)
    scores = {m: known.get(m) for m in models}
    return mine, known, table_advice(scores, asked, nominal_fits=fits)


def _too_few(solution: Solution, parts: LeftOut | None, setup: Setup) -> Verdict | None:
    """The verdict on hand poses whose noise nothing bears out: too few frames of a surface can be left out in turn."""
    bundle = solution.bundle
    surface = all(isinstance(t.target, Surface) for t in bundle.terms)
    if not bundle.hands.poses_only or not surface or len(bundle.locations) > 1 or given_noise(setup.config):
        return None
    if parts is not None and len(parts.parts) > FEWEST_LEFT_OUT:
        return None
    return Verdict(
        "too_few_poses",
        f"{len(bundle.location)} hand poses: what they scatter by is found from the same few points, and leaving out "
        f"one frame in turn bears that out only from {FEWEST_LEFT_OUT + 1} frames on: take more configurations, or "
        "state the poses' own noise (hand_sigma_mm, hand_sigma_deg), or give joint readings with the robot's table",
    )


def _by_jackknife(
    result: CalibrationResult, parts: LeftOut | None, judged: Solved, labelled: tuple[Frame, ...]
) -> CalibrationResult:
    """Of hand poses on one surface: σ no smaller than what frames left out in turn say, and weak where that is much."""
    solution = judged.solution
    if solution is None or parts is None or parts.by != "frame" or not solution.bundle.hands.poses_only:
        return result
    surface = all(isinstance(t.target, Surface) for t in solution.bundle.terms)
    if not surface or result.estimate is None or len(parts.parts) < FEWEST_LEFT_OUT:
        return result
    alike = equal_weights(solution, judged.used, {f.number: f for f in labelled})
    cov = at_least(result.estimate.covariance, jackknife_covariance(np.array([p.shift for p in parts.parts])))
    cov = cov if alike is None else at_least(cov, alike.covariance)
    result = replace(result, estimate=replace(result.estimate, covariance=cov), equal_weights=alike)
    cut = sum(p.centres_left_out for p in result.locations.values() if p.role == "calibrate")
    weak = weak_by_jackknife(cov, cut)
    return replace(result, verdict=weak) if weak is not None and result.verdict.code == "ok" else result


def _lonely(frames: tuple[Frame, ...]) -> tuple[str, ...]:
    """A sentence for every location with a single frame, which tells nothing: its name may be misspelt."""
    groups = locations_of(frames)
    others = [n for n, group in groups.items() if len(group) > 1]
    return tuple(
        f'location "{n}" has frame {group[0].number} alone and tells nothing of the SCP: '
        f"is it one of {', '.join(others)}?"
        for n, group in groups.items()
        if len(group) == 1 and others
    )
