"""Joint readings for frames given as hand poses: how errors of the robot's table act depends on the joints."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.observation import Observations
from geometry import RobotModel, inverse_kinematics, stack_poses

REACHED_MM, REACHED_RAD = 0.5, 1e-3  # files round their poses; farther off, they are not of this table

FLOOR_NOTE = (
    "the frames give hand poses and no joint readings follow from a robot's table, so how its errors act is not known: "
    "σ carry a floor of {mm:g} mm and {deg:g}° for them (hand_floor_mm, hand_floor_deg)"
)
INFERRED_NOTE = (
    "the frames give hand poses: joint readings were found from them by the robot's nominal table, so that σ carry "
    "[uncertainty] of robot.toml"
)


def with_joints(observations: Observations, robot: RobotModel | None) -> Observations:
    """The observations with ``joints_rad`` of every frame that has a hand pose alone, marked as inferred.

    A pose can have several solutions; all frames take the one reached from the first frame's, since errors of the table
    are common to them. Unchanged where there is no robot or a pose is not one that its table reaches.
    """
    bare = [i for i, f in enumerate(observations.frames) if f.joints_rad is None and f.T_base_hand is not None]
    if robot is None or not bare:
        return observations
    goals = stack_poses([p for i in bare if (p := observations.frames[i].T_base_hand) is not None])
    rng = np.random.default_rng(0)
    first = inverse_kinematics(robot, goals[:1], rng).joints[0]
    found = inverse_kinematics(robot, goals, rng, seeds=first)
    if np.any(found.position_error_mm > REACHED_MM) or np.any(found.rotation_error_rad > REACHED_RAD):
        return observations
    frames = list(observations.frames)
    for i, q in zip(bare, found.joints, strict=True):
        frames[i] = replace(frames[i], joints_rad=q, joints_inferred=True)
    return replace(observations, frames=tuple(frames))


def hand_pose_notes(observations: Observations, floor_mm: float, floor_deg: float) -> tuple[str, ...]:
    """What is to be said of σ where hand poses were given in place of joints."""
    if any(f.joints_rad is None for f in observations.frames):
        return (FLOOR_NOTE.format(mm=floor_mm, deg=floor_deg),)
    return (INFERRED_NOTE,) if any(f.joints_inferred for f in observations.frames) else ()
