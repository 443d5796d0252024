"""The bundle over labelled frames, its verdict, and the same with every number of the files tried as a suspect."""

from __future__ import annotations

from dataclasses import replace

from calib.bundle import Solution, make_bundle, solve_problem
from calib.judge import Motion, bundle_estimate, bundle_facts, find, frames_motion, judge, judge_motion
from calib.result import Estimate, Verdict
from calib.stages.setup import CONTRADICTED, Setup, Solved
from calib.surface import OPEN_CONDITION, condensed, degenerate, general_advice
from geometry import Frame, Pose, Surface, target_at
from jig_cad import Plane

_NAMED = (
    "ok",
    "model_misfit",
    "weak",
    "not_observable",
    "rotation_too_small",
    "too_few_poses",
    "poses_not_distinct",
    "not_converged",
    "outliers",
)  # verdicts that the views of surfaces can be the cause of
_ACCUSING = ("priors_contradict", "sensor_suspect")


def solve(setup: Setup, labelled: tuple[Frame, ...], T_hand_sensor: Pose) -> Solved:
    """Solve the usable calibrate frames by the bundle, or say why they can not be."""
    used = tuple(f for f in labelled if f.role == "calibrate" and f.usable)
    moved = frames_motion(used)
    verdict = judge_motion(moved, setup.config)
    if verdict is not None:
        return Solved(_views_named(verdict, setup, used, None))
    used = condensed(used, setup.target).frames
    bundle = make_bundle(used, setup.target, setup.robot, setup.config, setup.sensor, setup.evidence)
    solution = solve_problem(bundle, [f.candidates for f in used], T_hand_sensor, setup.config)
    refused = tuple(f for f in labelled if f.role == "calibrate" and f.reason == "not_labelled" and len(f.axis))
    facts = bundle_facts(solution, used, refused)
    estimate = _whole(bundle_estimate(solution, used, setup.config), used, labelled)
    judged = judge(facts, _kept_motion(used, estimate), setup.config)
    verdict = _views_named(judged, setup, used, solution)
    if _open_on_surface(verdict, setup, used):
        return Solved(verdict, contradicted=judged.code in CONTRADICTED)
    return Solved(verdict, estimate, solution, used)


def try_suspects(setup: Setup, labelled: tuple[Frame, ...], solved: Solved) -> Solved:
    """The answer with every number of the files tried as a suspect, solved anew where one contradicts the data."""
    if solved.solution is None:
        return solved
    used, config = solved.used, setup.config
    bundle = make_bundle(used, setup.target, setup.robot, config, setup.sensor, setup.evidence)
    finding = find(bundle, [f.candidates for f in used], solved.solution, setup.sensor, config, setup.design)
    refused = tuple(f for f in labelled if f.role == "calibrate" and f.reason == "not_labelled" and len(f.axis))
    facts = bundle_facts(finding.solution, used, refused, finding)
    estimate = _whole(bundle_estimate(finding.solution, used, config, finding), used, labelled)
    verdict = judge(facts, _kept_motion(used, estimate), config)
    if verdict.code not in _ACCUSING:  # what frames or motions are the fault of is no number's
        estimate = replace(estimate, culprit=())
    verdict = _views_named(verdict, setup, used, finding.solution)
    if _open_on_surface(verdict, setup, used):
        return Solved(verdict)
    return Solved(verdict, estimate, finding.solution, used)


def _kept_motion(used: tuple[Frame, ...], estimate: Estimate) -> Motion:
    """How the hand moved between the frames that were not left out."""
    return frames_motion(tuple(f for f in used if f.number not in estimate.reasons) or used)


def _open_on_surface(verdict: Verdict, setup: Setup, used: tuple[Frame, ...]) -> bool:
    """Whether views of a surface leave a direction open: noise alone closes it, and what it makes has no σ."""
    return verdict.code == "not_observable" and any(
        isinstance(target_at(setup.target, f.location), Surface) for f in used
    )


def _views_named(verdict: Verdict, setup: Setup, used: tuple[Frame, ...], solution: Solution | None) -> Verdict:
    """The verdict on views of surfaces by its name, with the pose that would help; refused where σ are not true."""
    if verdict.code not in _NAMED or not any(isinstance(target_at(setup.target, f.location), Surface) for f in used):
        return verdict
    T, places = (None, {}) if solution is None else (solution.T_hand_sensor, solution.places)
    found = degenerate(used, setup.target, T, places)
    open_one = solution is not None and not solution.condition < OPEN_CONDITION
    sound = verdict.code in ("ok", "model_misfit")
    if found is None and not open_one:
        helps = verdict.code in ("not_observable", "weak") and all(
            isinstance(target_at(setup.target, f.location), Plane) for f in used
        )
        return replace(verdict, text=f"{verdict.text}; {general_advice(setup.target, used)}") if helps else verdict
    if sound and not open_one and not (found is not None and found.certain):
        return verdict
    words = found.text if found is not None else general_advice(setup.target, used)
    code = "not_observable" if open_one or (found is not None and found.certain) or sound else verdict.code
    if verdict.code in ("rotation_too_small", "too_few_poses", "poses_not_distinct"):
        code = verdict.code
    return Verdict(code, f"{words}. In all, {verdict.text}" if not sound else words)


def _whole(estimate: Estimate, used: tuple[Frame, ...], labelled: tuple[Frame, ...]) -> Estimate:
    """The estimate with outliers of those frames alone whose points were not condensed."""
    gone = _condensed(used, labelled)
    return replace(estimate, outliers={k: out for k, out in estimate.outliers.items() if k not in gone})


def _condensed(used: tuple[Frame, ...], labelled: tuple[Frame, ...]) -> set[int]:
    """Numbers of the frames whose points were condensed to a few."""
    raw = {f.number: len(f.axis) for f in labelled}
    return {f.number for f in used if len(f.axis) != raw[f.number]}
