"""A chain of joints placed one in the other, as a URDF gives it: its Denavit-Hartenberg table, and the way back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.pose import Pose
from geometry.robot.axes_to_dh import robot_from_axes
from geometry.robot.dh import DhRobot, limit_fields

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ChainJoint:
    """A joint of a chain.

    Parameters
    ----------
    origin
        Its frame in that of the joint before, readings 0 [mm].
    axis
        Unit vector (3,) in its own frame; None where the joint is fixed.
    min_rad, max_rad
        Limits of its reading, infinite where there are none.
    """

    origin: Pose
    axis: Array | None
    min_rad: float
    max_rad: float


def chain_frames(joints: Sequence[ChainJoint]) -> list[Pose]:
    """Poses of every joint's frame in the base at readings 0 [mm]; the last is the tip's."""
    frames, here = [], Pose.identity()
    for joint in joints:
        here = here @ joint.origin
        frames.append(here)
    return frames


def robot_from_chain(joints: Sequence[ChainJoint], name: str = "") -> DhRobot:
    """The standard DH model of a chain, its hand the last joint's frame; fixed joints are taken in.

    Parameters
    ----------
    joints
        From the base on; at least one of them moves.
    name
        Of the robot.

    Returns
    -------
    DhRobot
        Whose readings are those of the joints that move.
    """
    frames = chain_frames(joints)
    moving = [(joint, frame, joint.axis) for joint, frame in zip(joints, frames, strict=True) if joint.axis is not None]
    points, directions = [frame.t for _, frame, _ in moving], [frame.R @ axis for _, frame, axis in moving]
    robot = robot_from_axes(np.array(points), np.array(directions), frames[-1])
    limits = np.array([(joint.min_rad, joint.max_rad) for joint, _, _ in moving])
    return replace(robot, **limit_fields(limits[:, 0], limits[:, 1]), name=name)


def corrected_origins(joints: Sequence[ChainJoint], corrected: DhRobot) -> tuple[list[Pose], Pose]:
    """Origins of a chain's joints that make it the corrected robot; those of fixed joints stay.

    Parameters
    ----------
    joints
        The chain.
    corrected
        What ``robot_from_chain`` makes of it, with numbers of its table changed.

    Returns
    -------
    list of Pose, Pose
        An origin for each joint, and what is then left between the last joint's frame and the hand.
    """
    rest = np.zeros(corrected.n_joints)
    old, new = robot_from_chain(joints).link_poses(rest), corrected.link_poses(rest)
    origins, here, k = [], Pose.identity(), 0
    for joint, frame in zip(joints, chain_frames(joints), strict=True):
        goal = here @ joint.origin
        if joint.axis is not None:
            # the joint's frame sits on its axis as before: F⁻¹ U is kept while the axis frame F moves
            goal, k = new[k] @ (old[k].inverse() @ frame), k + 1
            origins.append(here.inverse() @ goal)
        else:
            origins.append(joint.origin)
        here = goal
    return origins, here.inverse() @ corrected.pose(rest)
