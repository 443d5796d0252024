"""What a robot is to a solver: named parameters, the hand's pose at joint readings, and the derivatives of both."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose
from geometry.robot.parameter import Parameter

if TYPE_CHECKING:
    from geometry.robot.dh import DhRobot

Array = NDArray[np.float64]


@runtime_checkable
class Robot(Protocol):
    """A robot as everything that solves sees it: readings (..., n) [rad] in, the hand's pose in the base out.

    ``values`` (P,) are corrections of ``parameters`` in their order and units; None stands for zeros, the nominal
    robot. Twists are (translation [mm], rotation [rad]) in the hand's own axes: T(x + Δ) ≈ T(x) · Exp(J Δ).
    """

    @property
    def name(self) -> str:
        """What the robot is called in reports."""

    @property
    def n_joints(self) -> int:
        """How many readings a pose needs."""

    @property
    def parameters(self) -> tuple[Parameter, ...]:
        """The P numbers that are not known exactly; their order is that of ``values`` everywhere."""

    def pose(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """T_base_hand (...) at the readings (..., n)."""

    def joint_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """Twists (..., 6, n) of the hand by the readings."""

    def parameter_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """Twists (..., 6, P) of the hand by the parameters."""

    def corrected(self, values: ArrayLike) -> Robot:
        """The robot that has the corrections built in; its parameters are the same, counted from there."""

    def joint_noise(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """Covariance (..., 6, 6) of the hand's pose, as a twist, from what the joints do not repeat."""

    def within_limits(self, joints_rad: ArrayLike) -> NDArray[np.bool_]:
        """Whether the robot can be read so (...)."""


@runtime_checkable
class Arm(Robot, Protocol):
    """A robot whose links are known: what inverse kinematics, pictures, gravity and files need beside the hand."""

    def link_poses(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """Poses (..., n + 1) in the base of the chain's base end and of every link's frame."""

    def pose_and_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> tuple[Pose, Array]:
        """``pose`` and ``joint_jacobian`` from one chain."""

    def corrected(self, values: ArrayLike) -> Arm:
        """See Robot; of an arm it is one."""

    def dh_part(self, values: ArrayLike | None = None) -> DhRobot:
        """The Denavit-Hartenberg table inside, with those of the corrections that are its own."""

    def with_beta_prior(self, sigma_rad: float) -> Arm:
        """The robot with Hayati's β [rad] uncertain at (nearly) parallel axes."""


def require_arm(robot: Robot) -> Arm:
    """The robot, if its links are known.

    Parameters
    ----------
    robot : Robot
        Any.

    Returns
    -------
    Arm
        The same.

    Raises
    ------
    InputError
        Where only hand poses are known.
    """
    robot = getattr(robot, "arm", robot)  # of one that is seen from its hand
    if not isinstance(robot, Arm):
        raise InputError(f"{robot.name or 'the robot'} is known by its hand poses alone: this needs a robot's table")
    return robot


def with_beta_prior(robot: Robot, sigma_rad: float) -> Robot:
    """The robot with Hayati's β uncertain at (nearly) parallel axes, where d can not be told from its neighbour's.

    Parameters
    ----------
    robot
        Any robot; one without a table is returned as it is.
    sigma_rad
        Prior σ of β [rad]; 0 takes β as exactly known.

    References
    ----------
    Hayati, "Robot arm geometric link parameter estimation", CDC 1983.
    """
    prior = getattr(robot, "with_beta_prior", None)
    return robot if prior is None else prior(sigma_rad)
