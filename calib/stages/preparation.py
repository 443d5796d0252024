"""Where a calibration begins, its labels and axis points, and the bundle over them, round after round."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.answer import location_pose
from calib.bundle import Solution, estimates_compliance, free_start
from calib.config import Model
from calib.hands import placed
from calib.judge import RIVAL_CHI2
from calib.label import label_alone, label_frames, relabel, settled
from calib.result import Verdict
from calib.stages.setup import Prepared, Setup, Solved, by_target
from calib.stages.solve import solve
from calib.surface import Begun, begin_on_surfaces, condensed, degenerate, general_advice
from geometry import Frame, Pose, Target, locations_of, stack_poses, target_at, with_compliance_prior
from jig_cad import Balls, Jig

_NO_JOINTS = (
    "the frames give no joint readings that a robot's table turns into poses, so its errors can not be told from the "
    "SCP: the SCP alone was solved (model scp)"
)
_ARM_OPEN = (
    "with hand poses and no columns of status and turn it is open in which of its configurations the arm was, hence "
    "how its errors act: they are not estimated, and the SCP alone was solved (model scp); these columns, or joint "
    "readings, would let them be estimated (model full)"
)


def prepare(setup: Setup, given: tuple[Frame, ...]) -> Prepared:
    """Labels and axis points by design, then by the solved chain, with the bundle's answer; for both methods.

    The paper's iteration leaves labels and surface offsets open, and its own solution is too coarse to find them.
    """
    model: Model = "scp" if setup.config.method == "paper" else setup.config.model
    begun = _begun(setup, given, setup.design)
    if begun.T_hand_sensor is None and (free := _by_strings(setup, begun)) is not None:
        begun = _begun(setup, given, free)
    setup = replace(setup, target=begun.target)
    s = setup.with_config(method="bundle", model=model)
    labelled, solved = _labelled_and_solved(s, begun)
    several = begun.rival <= RIVAL_CHI2  # SCPs that fit, of which a search without the drawing would take any
    lost = begun.places and not several and not solved.verdict.trustworthy and not hands_tell_nothing(s, given)
    if s.design is not None and not begun.found and lost:
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
        solved = solve(s, labelled, solved.solution.T_hand_sensor)
    return Prepared(setup, given, labelled, solved)


def _begun(setup: Setup, given: tuple[Frame, ...], design: Pose | None) -> Begun:
    """Where a calibration begins, with frames on surfaces made ready."""
    model: Model = "scp" if setup.config.method == "paper" else setup.config.model
    config = setup.with_config(method="bundle", model=model).config
    frames = placed(given, setup.robot)
    return begin_on_surfaces(frames, setup.target, setup.robot, design, config, not hands_tell_nothing(setup, given))


def _by_strings(setup: Setup, begun: Begun) -> Pose | None:
    """The SCP from what frames on strings tell of their jigs each by itself; None where that does not suffice."""
    mine = tuple(f for f in begun.frames if f.role == "calibrate" and f.reason is None and _strings_at(setup, f))
    if not mine:
        return None
    alone = by_target(
        {f.location: target_at(setup.target, f.location) for f in mine},
        lambda jig, frames: label_alone(frames, jig, setup.sensor, setup.config),
        mine,
    )
    told = [f for f in alone if f.usable and len(f.candidates)]
    names = list(dict.fromkeys(f.location for f in told))
    location = np.array([names.index(f.location) for f in told], dtype=np.intp)
    options = [_with_images(f.candidates, target_at(setup.target, f.location)) for f in told]
    return free_start(stack_poses([f.at for f in told]), options, location) if len(told) > 2 else None


def _strings_at(setup: Setup, f: Frame) -> bool:
    return isinstance(target_at(setup.target, f.location), Jig)


def _with_images(poses: Pose, target: Target) -> Pose:
    """Poses of a target and what its symmetries make of them: no frame alone tells which it is."""
    return stack_poses(
        [p for k in range(len(poses)) for p in (poses[k], *(poses[k] @ s.pose for s in target.symmetries))]
    )


def _labelled_and_solved(s: Setup, begun: Begun) -> tuple[tuple[Frame, ...], Solved]:
    """Labels and a first solution from where a calibration begins."""
    places = {**s.places, **begun.places}
    if begun.T_hand_sensor is None:
        return begun.frames, Solved(_no_start(s, begun.frames))
    T: Pose = begun.T_hand_sensor
    still = hands_tell_nothing(s, begun.frames)
    if still:
        return begun.frames, Solved(Verdict("rotation_too_small", still))
    other = _ambiguous(s, begun, T)
    if other is not None:
        return begun.frames, Solved(other)
    labelled = by_target(
        s.target,
        lambda target, frames: label_frames(frames, target, s.sensor, T, places, s.config),
        begun.frames,
    )
    return labelled, solve(s, labelled, T)


def hands_tell_nothing(s: Setup, frames: tuple[Frame, ...]) -> str:
    """What the hand's poses alone leave open on surfaces, whatever the sensor saw, and what to add; "" if nothing."""
    used = placed([f for f in frames if f.role == "calibrate" and f.usable and len(f.axis) + len(f.points)], s.robot)
    still = degenerate(used, s.target, None, {}) if len(used) > 2 else None
    return "" if still is None else still.text


def _ambiguous(s: Setup, begun: Begun, T_hand_sensor: Pose) -> Verdict | None:
    """What is said where so few frames fit another SCP about as well, and their views have no name that says why."""
    if begun.rival > RIVAL_CHI2 and not begun.beyond_drawing:
        return None
    used = tuple(f for f in begun.frames if f.role == "calibrate" and f.usable and len(f.axis))
    small = condensed(used, s.target).frames  # sections tell what no sensor centre position needs to be known for
    if degenerate(small, s.target, T_hand_sensor, begun.places) is not None:
        return None
    given = s.design is not None
    if begun.beyond_drawing and s.design is not None:
        away = float(np.linalg.norm((s.design.inverse() @ T_hand_sensor).t))
        return Verdict(
            "ambiguous_pose",
            f"{len(used)} calibrate frames lead to a sensor centre position {away:.0f} mm from [scp_initial], and so "
            f"few have false answers, too: {general_advice(s.target, used)}; or correct [scp_initial]",
        )
    undecided = "[scp_initial] is too coarse to tell" if given else "without [scp_initial] nothing tells"
    drawing = "" if given else "; or give the sensor's place by its drawing"
    return Verdict(
        "ambiguous_pose",
        f"two sensor centre positions explain the {len(used)} calibrate frames about equally well (χ² differs by "
        f"{begun.rival:.2g}), and {undecided} which is true: {general_advice(s.target, used)}{drawing}",
    )


def _no_start(s: Setup, frames: tuple[Frame, ...]) -> Verdict:
    """What is said where neither a design nor the data give anything to begin with."""
    used = tuple(f for f in frames if f.role == "calibrate" and f.usable and len(f.axis))
    still = hands_tell_nothing(s, frames)
    if still:
        return Verdict("rotation_too_small", still)
    seen = sum(len(f.axis) + len(f.points) > 0 and f.role == "calibrate" for f in frames)
    if any(isinstance(target_at(s.target, f.location), Balls) for f in used):
        return Verdict(
            "too_few_poses",
            f"{seen} calibrate frames show balls, and too few of them which: equal balls are told apart by all "
            "frames together, from [scp_initial] on: give the sensor's place by its drawing, or take other balls",
        )
    return Verdict(
        "too_few_poses",
        f"{seen} calibrate frames show the target, and without [scp_initial] three or more are needed whose views "
        "differ: take more configurations, turned about two axes, or give the sensor's place by its drawing",
    )


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


def with_model(setup: Setup, given: tuple[Frame, ...]) -> tuple[Setup, tuple[str, ...]]:
    """The model that "auto" is here, and a sentence where it is not the robot's errors under their priors."""
    asked = setup.config.model
    if not asked.startswith("auto"):
        return _with_compliance(setup), ()
    joints = setup.robot is not None and all(f.joints_rad is not None and not f.joints_inferred for f in given)
    model = asked.replace("auto", "full") if joints else "scp"
    words = _ARM_OPEN if any(f.joints_inferred for f in given) else _NO_JOINTS
    return _with_compliance(setup.with_config(model=model)), () if joints else (words,)


def _with_compliance(setup: Setup) -> Setup:
    """The compliance of the joints under a prior, where the model estimates it."""
    if setup.robot is None or not estimates_compliance(setup.config.model):
        return setup
    return replace(setup, robot=with_compliance_prior(setup.robot))
