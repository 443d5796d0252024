"""From measured frames to the sensor centre position: labels, axis points, poses, SCP, verdict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from calib.answer import answer, location_pose
from calib.bundle import Solution, make_bundle, solve_problem
from calib.config import CalibConfig, Model
from calib.copies import copy_notes, in_order, without_copies
from calib.given_places import given_place_notes
from calib.hands import hand_pose_notes, placed, with_joints
from calib.judge import (
    bundle_estimate,
    bundle_facts,
    choose_model,
    culprit,
    frames_contradict,
    frames_motion,
    judge,
    judge_motion,
    left_out_rms,
    misfit_limit,
    wrong_jig,
)
from calib.label import label_frames, relabel, settled
from calib.paper import Starts, checked, paper_estimate, paper_frames
from calib.printed import gimbal_note
from calib.result import CalibrationResult, Estimate, Verdict
from geometry import Frame, InputError, Pose, Robot, Sensor, Target, locations_of, target_at
from jig_cad import Jig

CONTRADICTED = ("not_converged", "outliers", "rotation_too_small", "too_few_poses")


@dataclass(frozen=True, eq=False)
class Setup:
    """What calibrate was given beside the frames."""

    target: Target | Mapping[str, Target]
    robot: Robot | None
    sensor: Sensor
    design: Pose
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
    T_hand_sensor: Pose,
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
    T_hand_sensor : Pose
        The SCP by design: some millimetres and degrees off.
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
    setup = Setup(_one_or_more(target, frames), robot, sensor, T_hand_sensor, places or {}, config or CalibConfig())
    given = without_copies(with_joints(in_order(frames), robot))
    labelled, solved = _prepare(setup, given)
    if setup.config.method == "paper":
        result = _paper(setup, labelled, solved)
    elif solved.solution is None or not solved.verdict.trustworthy:
        result = _answer(setup, labelled, solved)
    else:
        chosen, scores, words = _choose(setup, solved.solution, solved.used)
        if chosen.config.model != setup.config.model:
            solved = _solve(chosen, labelled, solved.solution.T_hand_sensor)
        result = _answer(chosen, labelled, solved)
        result = replace(result, left_out_rms_mm=scores, remarks=(words, *_lonely(given)))
    named = _named(result.verdict, setup, labelled)
    verdict = frames_contradict(result.frames, setup.target, sensor, named, setup.config) or named
    return replace(result, verdict=verdict, remarks=(*result.remarks, *_remarks(setup, labelled, result)))


def _prepare(setup: Setup, given: tuple[Frame, ...]) -> tuple[tuple[Frame, ...], Solved]:
    """Labels and axis points by design, then by the solved chain, with the bundle's answer; for both methods.

    The paper's iteration leaves labels and surface offsets open, and its own solution is too coarse to find them.
    """
    model: Model = "scp" if setup.config.method == "paper" else setup.config.model
    s = setup.with_config(method="bundle", model=model)
    labelled = by_target(
        s.target,
        lambda target, frames: label_frames(frames, target, s.sensor, s.design, s.places, s.config),
        placed(given, s.robot),
    )
    solved = _solve(s, labelled, s.design)
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


def _solve(setup: Setup, labelled: tuple[Frame, ...], T_hand_sensor: Pose) -> Solved:
    """Solve the usable calibrate frames by the bundle, or say why they can not be."""
    used = tuple(f for f in labelled if f.role == "calibrate" and f.usable)
    moved = frames_motion(used)
    verdict = judge_motion(moved, setup.config)
    if verdict is not None:
        return Solved(verdict)
    bundle = make_bundle(used, setup.target, setup.robot, setup.config, setup.sensor)
    solution = solve_problem(bundle, [f.candidates for f in used], T_hand_sensor, setup.config)
    refused = tuple(f for f in labelled if f.role == "calibrate" and f.reason == "not_labelled" and len(f.axis))
    facts = bundle_facts(solution, used, refused)
    return Solved(judge(facts, moved, setup.config), bundle_estimate(solution, used, setup.config), solution, used)


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


def _choose(setup: Setup, solution: Solution, used: tuple[Frame, ...]) -> tuple[Setup, dict[str, float], str]:
    """Keep the model asked for unless it predicts locations that it did not see worse than scp alone."""
    asked = setup.config.model
    models: tuple[Model, ...] = ("scp",) if asked == "scp" else ("scp", asked)
    scores = {m: left_out_rms(solution, used, setup.config, m) for m in models}
    fits = solution.nominal <= misfit_limit(solution.dof, setup.config.misfit_chi2)
    model, words = choose_model(scores, asked, nominal_fits=fits)
    known: dict[str, float] = {m: rms for m, rms in scores.items() if rms is not None}
    if asked == "scp":
        words = f"leaving one location out, its points are predicted to {known['scp']:.3f} mm" if known else words
    return setup.with_config(model=model), known, words


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
    chain, groups = (result.T_hand_sensor or setup.design, result.robot), locations_of(labelled)
    seen = {n: location_pose(groups[n], target_at(setup.target, n), chain) for n in setup.places if n in groups}
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
