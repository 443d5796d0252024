"""The robot's hand in every frame: where it was, how uncertain that is, and how the robot's parameters move it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry import GivenPoses, Pose, Robot

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Hands:
    """A robot at F readings.

    robot: nominal. readings (F, n): of its joints. inferred: the readings follow from hand poses by the nominal table,
    in a configuration of the arm that was chosen.
    """

    robot: Robot
    readings: Array
    inferred: bool = False
    _last: dict[str, tuple[bytes, object]] = field(default_factory=dict, repr=False)

    @staticmethod
    def at_poses(Ts_base_hand: Pose, noise: Array, *, inverted: bool = False) -> Hands:
        """Hands of which only the poses (F) are known, with a covariance (6, 6) in hand axes.

        inverted: the poses are T_hand_base.
        """
        robot = GivenPoses(Ts_base_hand, noise, about=Ts_base_hand.inverse() if inverted else None)
        return Hands(robot, robot.readings)

    def __len__(self) -> int:
        """The number of frames."""
        return len(self.readings)

    def __getitem__(self, index: Index) -> Hands:
        """The frames of ``index``."""
        return Hands(self.robot, self.readings[index], self.inferred)

    @property
    def poses_only(self) -> bool:
        """Whether nothing is known of the arm behind the poses."""
        return isinstance(self.robot, GivenPoses)

    @property
    def sigma(self) -> Array:
        """Prior σ (P,) of the robot's parameters, in their units."""
        return np.array([p.sigma for p in self.robot.parameters])

    @property
    def labels(self) -> tuple[str, ...]:
        """Names of the parameters (P,)."""
        return tuple(p.name for p in self.robot.parameters)

    @property
    def groups(self) -> tuple[str, ...]:
        """Groups of the parameters (P,)."""
        return tuple(p.group for p in self.robot.parameters)

    @property
    def carried(self) -> Array:
        """Adjoints (F, 6, 6) that carry twists of given poses' noise to those of the poses."""
        if not isinstance(self.robot, GivenPoses):
            return np.broadcast_to(np.eye(6), (len(self), 6, 6))
        return self.robot.carried(self.readings)

    @property
    def noise(self) -> Array:
        """Covariance (F, 6, 6) of the hand's poses from what the joints do not repeat, hand axes."""
        return self.robot.joint_noise(self.readings)

    def pose(self, values: Array) -> Pose:
        """T_base_hand (F) with the parameters corrected by ``values`` (P,)."""
        return self._of("pose", values)  # type: ignore[return-value] # what is kept under "pose" is a Pose

    def jacobian(self, values: Array) -> Array:
        """Twists (F, 6, P) of the hand, hand axes, by the parameters."""
        return self._of("jacobian", values)  # type: ignore[return-value] # and an array under "jacobian"

    def _of(self, what: str, values: Array) -> object:
        # a chain's kinematics are half the time of a step, and a step asks twice for the same values
        key = values.tobytes()
        known = self._last.get(what)
        if known is None or known[0] != key:
            robot = self._corrected(key, values)
            compute = robot.pose if what == "pose" else robot.parameter_jacobian
            known = key, compute(self.readings)
            self._last[what] = known
        return known[1]

    def _corrected(self, key: bytes, values: Array) -> Robot:
        known = self._last.get("robot")
        if known is None or known[0] != key:
            known = key, self.robot.corrected(values) if np.any(values) else self.robot
            self._last["robot"] = known
        return known[1]  # type: ignore[return-value] # a Robot is kept under "robot"
