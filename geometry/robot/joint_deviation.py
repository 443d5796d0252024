"""A robot whose joints stand a little off their readings: the base of compliance, gears and whatever a user finds.

The hand's pose is that of the robot inside at q + δ(q, x), with x further parameters; the derivatives follow by the
chain rule: ∂q' = (1 + ∂δ/∂q) ∂q + (∂δ/∂x) ∂x.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose
from geometry.robot.around import AroundRobot
from geometry.robot.corrected import Corrected
from geometry.robot.dh import DhRobot
from geometry.robot.model import require_arm
from geometry.robot.parameter import Parameter

Array = NDArray[np.float64]

_STEP_RAD = 1e-4  # errors of joints vary over degrees: the central difference is right to some 1e-8 of them
_STEP_SIGMA = 1e-2  # in units of a parameter's own σ; exact where δ is linear in it


@dataclass(frozen=True, eq=False)
class JointDeviation(AroundRobot, ABC):
    """A Robot that is ``robot`` with its readings off by ``deviation``; a frozen dataclass to be derived from.

    A subclass gives ``own_parameters`` and ``deviation``; its derivatives are taken numerically unless the subclass
    gives them as well. ``values`` are the corrections of the robot inside, then those of the own parameters.

    Parameters
    ----------
    robot
        The robot inside: any, also one that is a JointDeviation itself.
    """

    @property
    @abstractmethod
    def own_parameters(self) -> tuple[Parameter, ...]:
        """The K parameters that the error adds to the robot's; σ above 0 where derivatives are numerical."""

    @abstractmethod
    def deviation(self, joints_rad: Array, values: Array) -> Array:
        """What the joints (..., n) [rad] turn further than they read, for the own parameters' values (K,)."""

    def deviation_by_joints(self, joints_rad: Array, values: Array) -> Array:
        """∂δ/∂q (..., n, n): rows by the joint that is off, columns by the reading."""
        steps = np.eye(self.n_joints) * _STEP_RAD
        ahead, behind = (self.deviation(joints_rad[..., None, :] + s * steps, values) for s in (1, -1))
        return np.asarray(np.swapaxes((ahead - behind) / (2 * _STEP_RAD), -1, -2))

    def deviation_by_values(self, joints_rad: Array, values: Array) -> Array:
        """∂δ/∂x (..., n, K)."""
        columns = []
        for k, parameter in enumerate(self.own_parameters):
            step = np.zeros(len(values))
            step[k] = _STEP_SIGMA * parameter.sigma
            difference = self.deviation(joints_rad, values + step) - self.deviation(joints_rad, values - step)
            columns.append(difference / (2 * step[k]))
        return np.stack(columns, -1) if columns else np.zeros((*joints_rad.shape, 0))

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """Those of the robot inside, then the own ones."""
        return (*self.robot.parameters, *self.own_parameters)

    def pose(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """See Robot."""
        at = self._at(joints_rad, values)
        return self.robot.pose(at.turned, at.inner)

    def joint_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """See Robot."""
        at = self._at(joints_rad, values)
        return np.asarray(self.robot.joint_jacobian(at.turned, at.inner) @ self._by_readings(at))

    def parameter_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """See Robot."""
        at = self._at(joints_rad, values)
        own = self.robot.joint_jacobian(at.turned, at.inner) @ self.deviation_by_values(at.read, at.own)
        return np.concatenate([self.robot.parameter_jacobian(at.turned, at.inner), own], -1)

    def corrected(self, values: ArrayLike) -> Corrected:
        """See Robot."""
        return Corrected(self, np.asarray(values, dtype=float))

    def joint_noise(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """See Robot; joints scatter about where the error has turned them."""
        at = self._at(joints_rad, values)
        return self.robot.joint_noise(at.turned, at.inner)

    def link_poses(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """See Arm."""
        at = self._at(joints_rad, values)
        return require_arm(self.robot).link_poses(at.turned, at.inner)

    def pose_and_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> tuple[Pose, Array]:
        """See Arm."""
        at = self._at(joints_rad, values)
        pose, jacobian = require_arm(self.robot).pose_and_jacobian(at.turned, at.inner)
        return pose, np.asarray(jacobian @ self._by_readings(at))

    def dh_part(self, values: ArrayLike | None = None) -> DhRobot:
        """See Arm; the error itself has no place in a table."""
        return require_arm(self.robot).dh_part(None if values is None else self.split(values)[0])

    def with_beta_prior(self, sigma_rad: float) -> Self:
        """See Arm."""
        return replace(self, robot=require_arm(self.robot).with_beta_prior(sigma_rad))

    def _by_readings(self, at: _At) -> Array:
        return np.eye(self.n_joints) + self.deviation_by_joints(at.read, at.own)

    def split(self, values: ArrayLike) -> tuple[Array, Array]:
        """Corrections of the robot inside, and the own ones."""
        v, inner = np.asarray(values, dtype=float), len(self.robot.parameters)
        if v.shape != (len(self.parameters),):
            raise InputError(f"{v.size} corrections for a robot of {len(self.parameters)} uncertain parameters")
        return v[:inner], v[inner:]

    def _at(self, joints_rad: ArrayLike, values: ArrayLike | None) -> _At:
        q = np.asarray(joints_rad, dtype=float)
        inner, own = (None, np.zeros(len(self.own_parameters))) if values is None else self.split(values)
        return _At(q, q + self.deviation(q, own), inner, own)


@dataclass(frozen=True, eq=False)
class _At:
    """Readings and where the joints truly stand (..., n) [rad]; corrections of the robot inside and the own ones."""

    read: Array
    turned: Array
    inner: Array | None
    own: Array
