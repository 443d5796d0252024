"""From measured frames to the sensor centre position: labels, axis points, poses, SCP, verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib.answer import answer, location_pose
from calib.bundle import Solution, make_bundle, solve_problem
from calib.config import CalibConfig, Model
from calib.copies import copy_notes, in_order, without_copies
from calib.given_places import given_place_notes
from calib.hands import hand_pose_notes, placed, with_joints
from calib.judge import (
    FEWEST_LEFT_OUT,
    UNCHECKED,
    at_least,
    bundle_estimate,
    bundle_facts,
    culprit,
    equal_weights,
    find,
    frames_contradict,
    frames_motion,
    jackknife_covariance,
    judge,
    judge_motion,
    left_out,
    misfit_limit,
    table_advice,
    weak_by_jackknife,
    wrong_jig,
)
from calib.label import label_frames, relabel, settled
from calib.paper import Starts, checked, paper_estimate, paper_frames
from calib.printed import gimbal_note
from calib.result import CalibrationResult, Estimate, LeftOut, Verdict
from calib.surface import (
    OPEN_CONDITION,
    Begun,
    begin_on_surfaces,
    condensed,
    contradicted_diameter,
    degenerate,
    estimated_diameter,
    general_advice,
    with_free_diameters,
)
from geometry import Frame, InputError, Pose, Robot, Sensor, Surface, Target, locations_of, target_at
from jig_cad import Jig, Plane, Sphere

NAMED = (
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
ACCUSING = ("priors_contradict", "sensor_suspect")
CONTRADICTED = ("not_converged", "outliers", "rotation_too_small", "too_few_poses")


@dataclass(frozen=True, eq=False)
class Setup:
    """What calibrate was given beside the frames."""

    target: Target | Mapping[str, Target]
    robot: Robot | None
    sensor: Sensor
    design: Pose | None
    places: Mapping[str, Pose]
    config: CalibConfig

    def with_config(self, **changes: object) -> Setup:
        """The same with some settings changed."""
        return replace(self, config=self.config.model_copy(update=changes))


@dataclass(frozen=True, eq=False)
class Solved:
    """The bundle's verdict with its answer; ``used``: the frames of the solution."""

    verdict: Verdict
    estimate: Estimate | None = None
    solution: Solution | None = None
    used: tuple[Frame, ...] = field(default=())


def calibrate(
    frames: Sequence[Frame],
    target: Target | Mapping[str, Target],
    robot: Robot | None,
    sensor: Sensor,
    T_hand_sensor: Pose | None,
    places: Mapping[str, Pose] | None = None,
    config: CalibConfig | None = None,
) -> CalibrationResult:
    """Solve the sensor centre position from all frames with role calibrate; judge it on all locations.

    Parameters
    ----------
    frames : sequence of Frame
        With the points that extraction found (or labelled ones), and joint readings or hand poses.
    target : Target or mapping of str to Target
        What was measured: at every location, or by location.
    robot : Robot or None
        Nominal; None where every frame has T_base_hand.
    sensor : Sensor
        Whose frame {P} the points are in.
    T_hand_sensor : Pose or None
        The SCP by design: some millimetres and degrees off. None where no drawing gives it: surfaces do without.
    places : mapping of str to Pose, optional
        T_base_target of locations where it is known; it then decides between symmetric poses.
    config : CalibConfig, optional

    Returns
    -------
    CalibrationResult
        Also for data from which no trustworthy answer follows: its verdict says why.

    Raises
    ------
    InputError
        Where the input can not be used at all.

    References
    ----------
    Jeong & Kang, Autonomous Sensor Center Position Calibration with Linear Laser-Vision Sensor, 2003.
    """
    if not frames:
        raise InputError("the dataset has no frames")
    asked = config or CalibConfig()
    setup = Setup(_one_or_more(target, frames), robot, sensor, T_hand_sensor, places or {}, asked)
    given = without_copies(with_joints(in_order(frames), robot))
    setup, decided = _with_model(setup, given)
    begun = _begun(setup, given, setup.design)
    setup = replace(setup, target=begun.target)
    labelled, solved = _prepare(setup, given, begun)
    other = _of_another_size(setup, given, solved) if setup.config.method == "bundle" else None
    if other is not None:
        setup, labelled, solved = other.setup, other.labelled, other.solved
    if setup.config.method == "paper":
        result = _paper(setup, labelled, solved)
    elif solved.solution is None:
        result = _answer(setup, labelled, solved)
    else:
        judged = _judged(setup, labelled, solved)
        result = _answer(setup, labelled, judged)
        if judged.verdict.trustworthy and judged.solution is not None:
            parts, scores, words = _left_out(setup, judged.solution, judged.used, labelled)
            result = _by_jackknife(setup, result, parts, judged, labelled)
            result = replace(result, left_out=parts, left_out_rms_mm=scores, remarks=(words, *_lonely(given)))
    result = replace(result, model_asked=asked.model, remarks=(*decided, *result.remarks))
    named = _named(result.verdict, setup, labelled)
    verdict = frames_contradict(result.frames, setup.target, sensor, named, setup.config) or named
    if other is not None and verdict.trustworthy:
        verdict = Verdict("priors_contradict", f"{other.text}. In all, {verdict.text}")
    return replace(result, verdict=verdict, remarks=(*result.remarks, *_remarks(setup, labelled, result)))


def _prepare(setup: Setup, given: tuple[Frame, ...], begun: Begun) -> tuple[tuple[Frame, ...], Solved]:
    """Labels and axis points by design, then by the solved chain, with the bundle's answer; for both methods.

    The paper's iteration leaves labels and surface offsets open, and its own solution is too coarse to find them.
    """
    model: Model = "scp" if setup.config.method == "paper" else setup.config.model
    s = setup.with_config(method="bundle", model=model)
    labelled, solved = _labelled_and_solved(s, begun)
    if s.design is not None and not begun.found and begun.places and not solved.verdict.trustworthy:
        anew = _begun(s, given, None)
        if anew.found:  # a design that leads nowhere
            other = _labelled_and_solved(s, anew)
            labelled, solved = other if other[1].verdict.trustworthy else (labelled, solved)
    open_labels = any(not f.labels_given for f in given)
    for _ in range(s.config.relabel_rounds if open_labels else 0):
        if solved.solution is None or not solved.verdict.trustworthy:
            break
        again = _relabel(s, given, labelled, solved.solution)
        if settled(labelled, again):
            break
        labelled = again
        solved = _solve(s, labelled, solved.solution.T_hand_sensor)
    return labelled, solved


@dataclass(frozen=True, eq=False)
class _OtherSize:
    """A calibration with balls of another diameter than stated, and a sentence on them."""

    setup: Setup
    labelled: tuple[Frame, ...]
    solved: Solved
    text: str


def _of_another_size(setup: Setup, given: tuple[Frame, ...], solved: Solved) -> _OtherSize | None:
    """The same with the balls' diameters estimated, where the data contradict what was stated."""
    free = with_free_diameters(setup.target)
    same = contradicted_diameter(solved.solution) if solved.solution is not None else None
    unknown = solved.solution is None or not solved.verdict.trustworthy
    stated = any(isinstance(target_at(setup.target, f.location), Sphere) for f in given)
    if not stated or (same is None and not (unknown and solved.verdict.code in CONTRADICTED)):
        return None
    begun = _begun(replace(setup, target=free), given, setup.design)
    freed = replace(setup, target=begun.target)
    labelled, again = _prepare(freed, given, begun)
    if again.solution is None or not again.verdict.trustworthy:
        return None
    found = estimated_diameter(again.solution, setup.target)
    return None if found is None else _OtherSize(freed, labelled, again, found.text)


def by_target(
    target: Target | Mapping[str, Target],
    stage: Callable[..., tuple[Frame, ...]],
    *frames: tuple[Frame, ...],
) -> tuple[Frame, ...]:
    """What a stage (target, frames …) makes of the frames of every target, in their order."""
    if not isinstance(target, Mapping):
        return stage(target, *frames)
    done: dict[int, Frame] = {}
    for one in {id(t): t for t in target.values()}.values():
        own = [tuple(f for f in group if target_at(target, f.location) is one) for group in frames]
        if own[0]:
            done |= {f.number: f for f in stage(one, *own)}
    return tuple(done[f.number] for f in frames[0])


def _one_or_more(target: Target | Mapping[str, Target], frames: Sequence[Frame]) -> Target | Mapping[str, Target]:
    """The one target that all locations of the frames have, else the targets by location."""
    kinds = {id(t): t for t in (target_at(target, f.location) for f in frames)}
    return next(iter(kinds.values())) if len(kinds) == 1 else target


def _begun(setup: Setup, given: tuple[Frame, ...], design: Pose | None) -> Begun:
    """Where a calibration begins, with frames on surfaces made ready."""
    model: Model = "scp" if setup.config.method == "paper" else setup.config.model
    config = setup.with_config(method="bundle", model=model).config
    return begin_on_surfaces(placed(given, setup.robot), setup.target, setup.robot, design, config)


def _labelled_and_solved(s: Setup, begun: Begun) -> tuple[tuple[Frame, ...], Solved]:
    """Labels and a first solution from where a calibration begins."""
    places = {**s.places, **begun.places}
    if begun.T_hand_sensor is None:
        if any(isinstance(target_at(s.target, f.location), Jig) for f in begun.frames):
            raise InputError(
                "[scp_initial] is missing, and strings need it: give the sensor's place by its drawing, some "
                "millimetres and degrees off"
            )
        return begun.frames, Solved(_no_start(begun.frames, s.target))
    T: Pose = begun.T_hand_sensor
    used = tuple(f for f in begun.frames if f.role == "calibrate" and f.usable and len(f.axis))
    still = degenerate(used, s.target, None, {}) if len(used) > 2 else None
    if still is not None:
        return begun.frames, Solved(Verdict("rotation_too_small", still.text))
    labelled = by_target(
        s.target,
        lambda target, frames: label_frames(frames, target, s.sensor, T, places, s.config),
        begun.frames,
    )
    return labelled, _solve(s, labelled, T)


def _no_start(frames: tuple[Frame, ...], target: Target | Mapping[str, Target]) -> Verdict:
    """What is said where neither a design nor the data give anything to begin with."""
    used = tuple(f for f in frames if f.role == "calibrate" and f.usable and len(f.axis))
    still = degenerate(used, target, None, {}) if len(used) > 2 else None
    if still is not None:
        return Verdict("rotation_too_small", still.text)
    seen = sum(len(f.axis) > 0 and f.role == "calibrate" for f in frames)
    return Verdict(
        "too_few_poses",
        f"{seen} calibrate frames show the target, and without [scp_initial] three or more are needed whose views "
        "differ: take more configurations, turned about two axes, or give the sensor's place by its drawing",
    )


def _solve(setup: Setup, labelled: tuple[Frame, ...], T_hand_sensor: Pose) -> Solved:
    """Solve the usable calibrate frames by the bundle, or say why they can not be."""
    used = tuple(f for f in labelled if f.role == "calibrate" and f.usable)
    moved = frames_motion(used)
    verdict = judge_motion(moved, setup.config)
    if verdict is not None:
        return Solved(_views_named(verdict, setup, used, None))
    used = condensed(used, setup.target).frames
    bundle = make_bundle(used, setup.target, setup.robot, setup.config, setup.sensor)
    solution = solve_problem(bundle, [f.candidates for f in used], T_hand_sensor, setup.config)
    refused = tuple(f for f in labelled if f.role == "calibrate" and f.reason == "not_labelled" and len(f.axis))
    facts = bundle_facts(solution, used, refused)
    estimate = _whole(bundle_estimate(solution, used, setup.config), used, labelled)
    verdict = _views_named(judge(facts, moved, setup.config), setup, used, solution)
    if verdict.code == "not_observable" and _condensed(used, labelled):
        return Solved(verdict)  # what noise alone leaves open has no σ
    return Solved(verdict, estimate, solution, used)


def _views_named(verdict: Verdict, setup: Setup, used: tuple[Frame, ...], solution: Solution | None) -> Verdict:
    """The verdict on views of surfaces by its name, with the pose that would help; refused where σ are not true."""
    if verdict.code not in NAMED or not any(isinstance(target_at(setup.target, f.location), Surface) for f in used):
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


def _relabel(
    setup: Setup, given: tuple[Frame, ...], labelled: tuple[Frame, ...], solution: Solution
) -> tuple[Frame, ...]:
    """Labels and axis points again, with the solved chain; given places still decide the half turn."""
    chain = (solution.T_hand_sensor, solution.robot)
    others = {n: g for n, g in locations_of(labelled).items() if n not in solution.places}
    found = {n: T for n, g in others.items() if (T := location_pose(g, target_at(setup.target, n), chain)) is not None}
    fresh = placed(given, solution.robot)
    places = solution.places | found
    return by_target(
        setup.target,
        lambda target, before, now: relabel(
            before, now, target, setup.sensor, chain[0], places, setup.places, setup.config
        ),
        labelled,
        fresh,
    )


def _with_model(setup: Setup, given: tuple[Frame, ...]) -> tuple[Setup, tuple[str, ...]]:
    """The model that "auto" is here, and a sentence where it is not the robot's errors under their priors."""
    asked = setup.config.model
    if not asked.startswith("auto"):
        return setup, ()
    joints = setup.robot is not None and all(f.joints_rad is not None and not f.joints_inferred for f in given)
    model = asked.replace("auto", "full") if joints else "scp"
    words = (
        "the frames give no joint readings that a robot's table turns into poses, so its errors can not be told from "
        "the SCP: the SCP alone was solved (model scp)"
    )
    return setup.with_config(model=model), () if joints else (words,)


def _judged(setup: Setup, labelled: tuple[Frame, ...], solved: Solved) -> Solved:
    """The answer with every number of the files tried as a suspect, solved anew where one contradicts the data."""
    if solved.solution is None:
        return solved
    used, config = solved.used, setup.config
    bundle = make_bundle(used, setup.target, setup.robot, config, setup.sensor)
    finding = find(bundle, [f.candidates for f in used], solved.solution, setup.sensor, config)
    refused = tuple(f for f in labelled if f.role == "calibrate" and f.reason == "not_labelled" and len(f.axis))
    facts = bundle_facts(finding.solution, used, refused, finding)
    estimate = _whole(bundle_estimate(finding.solution, used, config, finding), used, labelled)
    verdict = judge(facts, frames_motion(used), config)
    if verdict.code not in ACCUSING:  # what frames or motions are the fault of is no number's
        estimate = replace(estimate, culprit=())
    return Solved(_views_named(verdict, setup, used, finding.solution), estimate, finding.solution, used)


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


def _by_jackknife(
    setup: Setup, result: CalibrationResult, parts: LeftOut | None, solved: Solved, labelled: tuple[Frame, ...]
) -> CalibrationResult:
    """Of hand poses on one surface: σ no smaller than what frames left out in turn say, and weak where that is much."""
    solution = solved.solution
    if solution is None or parts is None or parts.by != "frame" or not solution.bundle.hands.poses_only:
        return result
    surface = all(isinstance(t.target, Surface) for t in solution.bundle.terms)
    if not surface or result.estimate is None or len(parts.parts) < FEWEST_LEFT_OUT:
        return result
    alike = equal_weights(solution, solved.used, {f.number: f for f in labelled})
    cov = at_least(result.estimate.covariance, jackknife_covariance(np.array([p.shift for p in parts.parts])))
    cov = cov if alike is None else at_least(cov, alike.covariance)
    result = replace(result, estimate=replace(result.estimate, covariance=cov), equal_weights=alike)
    cut = sum(p.centres_left_out for p in result.locations.values() if p.role == "calibrate")
    weak = weak_by_jackknife(cov, cut)
    return replace(result, verdict=weak) if weak is not None and result.verdict.code == "ok" else result


def _paper(setup: Setup, labelled: tuple[Frame, ...], solved: Solved) -> CalibrationResult:
    """The paper's answer to the prepared frames; the bundle's tells mirrors and outliers and judges it."""
    if not isinstance(setup.target, Jig):
        raise InputError("the paper's method measures a pillar of strings: use --method bundle for other targets")
    trusted = solved.estimate if solved.verdict.trustworthy else None
    outlying = {**trusted.reasons, **trusted.outliers} if trusted is not None else {}
    used = tuple(f for f in labelled if f.role == "calibrate" and f.usable)
    frames = paper_frames(used, setup.target, outlying)
    moved = frames_motion(frames.frames)
    early = judge_motion(moved, setup.config)
    if early is not None:
        return _answer(setup, labelled, Solved(early))
    if setup.design is None:
        raise InputError("the paper's method begins at the sensor's place by its drawing: give [scp_initial]")
    starts = Starts(setup.design, setup.design if trusted is None else trusted.T_hand_sensor)
    estimate, facts = paper_estimate(frames, setup.target, setup.robot, starts, setup.config)
    verdict = checked(judge(facts, moved, setup.config), estimate, solved.verdict, solved.estimate)
    return _answer(setup, labelled, Solved(verdict, estimate))


def _answer(setup: Setup, labelled: tuple[Frame, ...], solved: Solved) -> CalibrationResult:
    return answer(labelled, setup.target, setup.robot, setup.design, setup.config, solved.verdict, solved.estimate)


def _named(verdict: Verdict, setup: Setup, labelled: tuple[Frame, ...]) -> Verdict:
    """The verdict on data that contradict one another, with what the motions say of the cause before all else."""
    if verdict.code not in CONTRADICTED or not isinstance(setup.target, Jig):
        return verdict
    found = wrong_jig(labelled, setup.target) or culprit(labelled, setup.target, setup.robot)
    return replace(verdict, text=f"{found}. In all, {verdict.text}") if found else verdict


def _remarks(setup: Setup, labelled: tuple[Frame, ...], result: CalibrationResult) -> tuple[str, ...]:
    """What is to be said of given places and hand poses."""
    T, groups = result.T_hand_sensor or setup.design, locations_of(labelled)
    known = {} if T is None else {n: groups[n] for n in setup.places if n in groups}
    seen: dict[str, Pose | None] = {}
    if T is not None:
        seen = {n: location_pose(g, target_at(setup.target, n), (T, result.robot)) for n, g in known.items()}
    found = {n: T for n, T in seen.items() if T is not None}
    hands = hand_pose_notes(labelled, setup.config.hand_floor_mm, setup.config.hand_floor_deg)
    T, covariance = result.T_hand_sensor, result.covariance
    locked = () if T is None or covariance is None else gimbal_note(T, covariance)
    return (*given_place_notes(setup.places, found, setup.target), *hands, *copy_notes(labelled), *locked)


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
