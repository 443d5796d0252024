"""Where the robot's hand was in every frame, and joint readings for frames that were given as hand poses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.configurations import standing
from geometry import Arm, Frame, InputError, Pose, Robot, inverse_kinematics, stack_poses

Array = NDArray[np.float64]

REACHED_MM, REACHED_RAD = 0.5, 1e-3  # files round their poses; farther off, they are not of this table

FLOOR_NOTE = (
    "the frames give hand poses and no joint readings follow from a robot's table, so how its errors act is not known: "
    "σ carry a floor of {mm:g} mm and {deg:g}° for them (hand_floor_mm, hand_floor_deg)"
)
INFERRED_NOTE = (
    "the frames give hand poses: joint readings were found from them by the robot's nominal table, all in one of the "
    "arm's configurations that may be another than it was in; σ carry [uncertainty] of robot.toml"
)

STANDING_NOTE = (
    "the frames give hand poses: joint readings were found from them by the robot's nominal table, in the arm's "
    "configuration that the status columns name"
)


def with_joints(frames: Sequence[Frame], robot: Robot | None) -> tuple[Frame, ...]:
    """The frames with ``joints_rad`` where only a hand pose is known.

    A pose can have several solutions. Where the controller's status columns leave one for every frame, the frames are
    those of joint readings. Else all take the one reached from the first frame's, since errors of the table are common
    to them, and are marked as inferred. Unchanged where there is no robot or a pose is not one that its table reaches.
    """
    bare = {i: f.T_base_hand for i, f in enumerate(frames) if f.joints_rad is None and f.T_base_hand is not None}
    if not isinstance(robot, Arm) or not bare:
        return tuple(frames)
    out, rng = list(frames), np.random.default_rng(0)
    known = _standing(frames, bare, robot)
    if known is not None:
        for i, q in known.items():
            out[i] = replace(frames[i], joints_rad=q, T_base_hand=None)
        return tuple(out)
    goals = stack_poses(list(bare.values()))
    first = inverse_kinematics(robot, goals[:1], rng).joints[0]
    found = inverse_kinematics(robot, goals, rng, seeds=first)
    if np.any(found.position_error_mm > REACHED_MM) or np.any(found.rotation_error_rad > REACHED_RAD):
        return tuple(frames)
    for i, q in zip(bare, found.joints, strict=True):
        out[i] = replace(frames[i], joints_rad=q, joints_inferred=True)
    return tuple(out)


def _standing(frames: Sequence[Frame], bare: Mapping[int, Pose], robot: Arm) -> dict[int, Array] | None:
    """Joint readings of the frames by their status columns; None where these leave a frame's open."""
    found: dict[int, Array] = {}
    for i, pose in bare.items():
        configuration = frames[i].configuration
        q = None if not configuration else standing(robot, pose, configuration, np.random.default_rng(0))
        if q is None:
            return None
        found[i] = q
    return found


def placed(frames: Sequence[Frame], robot: Robot | None) -> tuple[Frame, ...]:
    """The frames with their ``hand``; readings outside the joints' limits are a reason not to use one."""
    hands = hand_poses(frames, robot)
    return tuple(replace(f, hand=hands[i], reason=f.reason or _out_of_range(f, robot)) for i, f in enumerate(frames))


def hand_poses(frames: Sequence[Frame], robot: Robot | None) -> Pose:
    """T_base_hand (F): as given, else of the joint readings by the robot. InputError where there is neither."""
    out: dict[int, Pose] = {i: f.T_base_hand for i, f in enumerate(frames) if f.T_base_hand is not None}
    read = {i: q for i, f in enumerate(frames) if i not in out and (q := f.joints_rad) is not None}
    if robot is not None and read:
        moved = robot.pose(np.array(list(read.values())))
        out |= {i: moved[k] for k, i in enumerate(read)}
    for i, f in enumerate(frames):
        if i not in out:
            raise InputError(f"frame {f.number} has neither joint readings with a robot nor a hand pose T_base_hand")
    return stack_poses([out[i] for i in range(len(frames))])


def chain_poses(frames: Sequence[Frame], robot: Robot | None) -> Pose:
    """T_base_hand (F) by a robot where there are readings, inferred ones too; else as found."""
    hands = stack_poses([f.at for f in frames])
    read = {i: q for i, f in enumerate(frames) if (q := f.joints_rad) is not None}
    if robot is not None and read:
        moved = robot.pose(np.array(list(read.values())))
        hands.R[list(read)], hands.t[list(read)] = moved.R, moved.t
    return hands


def hand_pose_notes(frames: Sequence[Frame], floor_mm: float, floor_deg: float) -> tuple[str, ...]:
    """What is to be said of σ where hand poses were given in place of joints."""
    if any(f.configuration for f in frames) and all(f.T_base_hand is None for f in frames):
        return (STANDING_NOTE,)
    if any(f.joints_rad is None for f in frames):
        return (FLOOR_NOTE.format(mm=floor_mm, deg=floor_deg),)
    return (INFERRED_NOTE,) if any(f.joints_inferred for f in frames) else ()


def _out_of_range(f: Frame, robot: Robot | None) -> str | None:
    if f.T_base_hand is not None or robot is None or f.joints_rad is None:
        return None
    return None if bool(robot.within_limits(f.joints_rad)) else "robot_out_of_range"
