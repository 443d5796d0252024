"""The straight moves of the joints from one proposed configuration to the next, and what they come too near to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.plan.clearance import MOVE_STEP_MM, Standing, room_at_target_mm, room_in_workspace_mm
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
        arm = problem.standing(_between(problem, joints_rad[k], joints_rad[k + 1]))
        target = room_at_target_mm(arm, problem.jig, problem.T_base_jig)
        around, where = room_in_workspace_mm(arm, problem.workspace)
        i, j = int(np.argmin(target)), int(np.argmin(around))
        near = near_target if target[i] <= around[j] else _name(problem, int(where[j]))
        room = min(float(target[i]), float(around[j])) - MOVE_STEP_MM / 2
        moves.append(Move(location, numbers[k], numbers[k + 1], room, near))
    return moves


def _between(problem: ViewProblem, start: Array, end: Array) -> Array:
    """Readings (K, n) on the straight way from start to end."""
    ends = problem.standing(np.stack([start, end]))
    turn = float(np.sum(np.abs(end - start)))  # no point moves farther than its distance from the base times that
    steps = int(np.ceil(turn * _farthest(ends) / MOVE_STEP_MM))
    share = np.linspace(0, 1, max(2, steps + 1))[:, None]
    return np.asarray(start + share * (end - start))


def _farthest(arm: Standing) -> float:
    """How long the arm is from its shoulder to the sensor [mm], bent as it is."""
    links = np.sum(np.linalg.norm(np.diff(arm.joints_mm, axis=1), axis=-1), axis=1)
    hand = np.linalg.norm(arm.hand_mm[:, 1] - arm.hand_mm[:, 0], axis=-1)
    return float(np.max(links + hand))


def _name(problem: ViewProblem, where: int) -> str:
    return "the floor" if where < 0 else problem.workspace.names[where]
