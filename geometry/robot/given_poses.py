"""Frames that come with the hand's pose and no joint readings, as a robot whose reading is the number of the pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose
from geometry.robot.parameter import Parameter

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class GivenPoses:
    """A Robot that only says where its hand was: no parameters, and a reading (..., 1) is the number of the pose.

    Parameters
    ----------
    Ts_base_hand
        The poses (F).
    noise
        Covariance (6, 6) of every pose as a twist in the hand's axes [mm², mm·rad, rad²].
    name
        In reports.
    about
        (F): the poses, in the frame that each pose goes to, of what the noise is a twist of; None: of the pose itself.
        Poses T_hand_base err as T_base_hand do, by twists in the hand's axes.
    """

    Ts_base_hand: Pose
    noise: Array
    name: str = "hand poses"
    about: Pose | None = None

    @property
    def n_joints(self) -> int:
        """One: the number of the pose."""
        return 1

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """None: what is wrong with the poses is not known."""
        return ()

    @property
    def readings(self) -> Array:
        """The readings (F, 1) of all poses in their order."""
        return np.arange(len(self.Ts_base_hand), dtype=float)[:, None]

    def pose(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """The poses (...) of their numbers (..., 1)."""
        _no_corrections(values)
        return self.Ts_base_hand[self._numbers(joints_rad)]

    def joint_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """Zeros (..., 6, 1): between two poses there is nothing."""
        return np.zeros((*self._numbers(joints_rad).shape, 6, 1))

    def parameter_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """Of no parameters (..., 6, 0)."""
        return np.zeros((*self._numbers(joints_rad).shape, 6, 0))

    def corrected(self, values: ArrayLike) -> GivenPoses:
        """The poses themselves: there is nothing to correct."""
        _no_corrections(values)
        return self

    def joint_noise(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """The given covariance (..., 6, 6), carried from where the noise acts."""
        carried = self.carried(joints_rad)
        return np.asarray(carried @ self.noise @ np.swapaxes(carried, -1, -2))

    def carried(self, joints_rad: ArrayLike) -> Array:
        """Adjoints (..., 6, 6) that carry twists of the noise to those of the poses."""
        number = self._numbers(joints_rad)
        if self.about is None:
            return np.broadcast_to(np.eye(6), (*number.shape, 6, 6)).copy()
        return self.about[number].adjoint

    def within_limits(self, joints_rad: ArrayLike) -> NDArray[np.bool_]:
        """Whether there is a pose of that number (...)."""
        number = np.asarray(joints_rad, dtype=float)[..., 0]
        return np.asarray((number >= 0) & (number < len(self.Ts_base_hand)) & (number == np.round(number)))

    def _numbers(self, joints_rad: ArrayLike) -> NDArray[np.intp]:
        q = np.asarray(joints_rad, dtype=float)
        if q.shape[-1:] != (1,) or not np.all(self.within_limits(q)):
            raise InputError(f"given hand poses are asked for by their numbers, 0 to {len(self.Ts_base_hand) - 1}")
        return np.asarray(q[..., 0], dtype=np.intp)


def _no_corrections(values: ArrayLike | None) -> None:
    if values is not None and np.size(values):
        raise InputError("robot parameters need joint readings, but only hand poses are given: use model scp")
