"""The straight moves of the joints from one proposed configuration to the next, and what they come too near to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.plan.clearance import MOVE_STEP_MM
from workbench.plan.views import ViewProblem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Move:
    """From one frame to the next at a location. room_mm: what is left on the way; negative: so much is missing.

    near: "the jig", "the floor" or a box's name, where that is.
    """

    location: str
    start: int
    end: int
    room_mm: float
    near: str

    def sentence(self) -> str:
        """What the user is told of a move that has no room."""
        return (
            f"the straight move of the joints from frame {self.start} to frame {self.end} (location {self.location}) "
            f"comes {-self.room_mm:.0f} mm too near to {self.near}: take another way there"
        )


def straight_moves(
    problem: ViewProblem, location: str, numbers: Sequence[int], joints_rad: Array, near_target: str = "the jig"
) -> list[Move]:
    """Moves between the frames (N, n) of one location, in their order.

    The arm is looked at so often that no point of it moves further than MOVE_STEP_MM in between; what may happen
    between two looks is half of that, and taken off the room.
    """
    moves = []
    for k in range(len(numbers) - 1):
        room_on_way = problem.room_mm(_between(problem, joints_rad[k], joints_rad[k + 1]))
        target, around, where = room_on_way.at_target, room_on_way.around, room_on_way.where
        i, j = int(np.argmin(target)), int(np.argmin(around))
        near = near_target if target[i] <= around[j] else _name(problem, int(where[j]))
        room = min(float(target[i]), float(around[j])) - MOVE_STEP_MM / 2
        moves.append(Move(location, numbers[k], numbers[k + 1], room, near))
    return moves


def _between(problem: ViewProblem, start: Array, end: Array) -> Array:
    """Readings (K, n) on the straight way from start to end."""
    turn = float(np.sum(np.abs(end - start)))  # no point moves farther than its distance from the base times that
    steps = int(np.ceil(turn * _farthest(problem, start) / MOVE_STEP_MM))
    share = np.linspace(0, 1, max(2, steps + 1))[:, None]
    return np.asarray(start + share * (end - start))


def _farthest(problem: ViewProblem, joints_rad: Array) -> float:
    """How long the arm is from its base to what it carries [mm], stretched out."""
    links = problem.robot.link_poses(joints_rad).t
    carried = problem.T_base_jig.t if problem.mount == "fixed" else problem.T_hand_sensor.t
    return float(np.sum(np.linalg.norm(np.diff(links, axis=0), axis=-1)) + np.linalg.norm(carried))


def _name(problem: ViewProblem, where: int) -> str:
    return "the floor" if where < 0 else problem.workspace.names[where]
