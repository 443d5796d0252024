"""A serial arm by its Denavit-Hartenberg table: forward kinematics and the Jacobians of the paper's Eq. (1)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose, exp_so3

Array = NDArray[np.float64]

PARAMETERS = ("theta", "d", "a", "alpha", "beta")  # order of the rows wherever DH parameters are stacked
_Z, _X, _Y = np.eye(3)[2], np.eye(3)[0], np.eye(3)[1]


@dataclass(frozen=True)
class RobotUncertainty:
    """Standard deviations of what a robot's table and its joints do not know; FORMATS's defaults of an ordinary arm."""

    joint_sigma_rad: float = float(np.deg2rad(0.003))
    theta_sigma_rad: float = float(np.deg2rad(0.03))
    d_sigma_mm: float = 0.15
    a_sigma_mm: float = 0.15
    alpha_sigma_rad: float = float(np.deg2rad(0.015))


@dataclass(frozen=True, eq=False)
class RobotModel:
    """Denavit-Hartenberg model of n revolute joints; readings q (..., n) [rad], arrays (n,) [rad] and [mm].

    The angle of joint i is ``sign_i · (coupling @ q)_i + theta_offset_i``. A link is
    Rz(θ)·Tz(d)·Tx(a)·Rx(α)·Ry(β) in the "standard" and Rx(α)·Tx(a)·Ry(β)·Rz(θ)·Tz(d) in the "modified" convention;
    β is Hayati's parameter for (nearly) parallel axes, 0 unless calibrated.
    T_base_first and T_last_hand stand before the first and after the last link (identity unless a URDF needs them).
    """

    theta_offset: Array
    d: Array
    a: Array
    alpha: Array
    beta: Array
    sign: Array
    min_rad: Array
    max_rad: Array
    convention: str = "standard"
    coupling: Array | None = None
    T_base_first: Pose = field(default_factory=Pose.identity)
    T_last_hand: Pose = field(default_factory=Pose.identity)
    uncertainty: RobotUncertainty = field(default_factory=RobotUncertainty)
    name: str = ""

    @staticmethod
    def from_dh(theta_offset: ArrayLike, d: ArrayLike, a: ArrayLike, alpha: ArrayLike, **more: object) -> RobotModel:
        """A model of the four DH columns (n,) [rad, mm]; ``more`` are further fields by name, limits default to ±2π."""
        n = len(np.atleast_1d(np.asarray(d, dtype=float)))
        limits = {"min_rad": -2 * np.pi, "max_rad": 2 * np.pi, "beta": 0.0, "sign": 1.0}
        columns = {"theta_offset": theta_offset, "d": d, "a": a, "alpha": alpha}
        columns |= {k: more.pop(k, v) for k, v in limits.items()}  # type: ignore[misc]
        arrays = {k: np.array(np.broadcast_to(np.asarray(v, dtype=float), n)) for k, v in columns.items()}
        return RobotModel(**arrays, **more)  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        """InputError where the table can not be an arm."""
        n = len(self.d)
        for name in ("theta_offset", "a", "alpha", "beta", "sign", "min_rad", "max_rad"):
            if getattr(self, name).shape != (n,):
                raise InputError(f"the robot's {name} has {len(getattr(self, name))} values for {n} joints")
        if self.convention not in ("standard", "modified"):
            raise InputError(f'robot convention "{self.convention}": must be "standard" or "modified"')
        if self.coupling is not None and self.coupling.shape != (n, n):
            raise InputError(f"[coupling] matrix must be {n} × {n}")

    @property
    def n_joints(self) -> int:
        """The number of joints."""
        return len(self.d)

    def joint_angles(self, joints: ArrayLike) -> Array:
        """DH angles θ (..., n) [rad] of the joint readings (..., n) [rad]."""
        q = np.asarray(joints, dtype=float)
        if q.shape[-1:] != (self.n_joints,):
            raise InputError(f"{q.shape[-1] if q.ndim else 0} joint values for a robot of {self.n_joints} joints")
        if self.coupling is not None:
            q = q @ self.coupling.T
        return np.asarray(self.sign * q + self.theta_offset)

    def link_poses(self, joints: ArrayLike) -> Pose:
        """Poses (..., n + 1) in the base of the chain's base end and of every link frame, without T_last_hand."""
        theta = self.joint_angles(joints)
        batch = theta.shape[:-1]
        here = Pose(
            np.broadcast_to(self.T_base_first.R, (*batch, 3, 3)), np.broadcast_to(self.T_base_first.t, (*batch, 3))
        )
        poses = [here]
        for i in range(self.n_joints):
            here = here @ self._link(i, theta[..., i])
            poses.append(here)
        return Pose(np.stack([p.R for p in poses], -3), np.stack([p.t for p in poses], -2))

    def hand_pose(self, joints: ArrayLike) -> Pose:
        """T_base_hand (...) of the joint readings (..., n) [rad]."""
        theta = self.joint_angles(joints)
        here = self.T_base_first @ self._link(0, theta[..., 0])
        for i in range(1, self.n_joints):
            here = here @ self._link(i, theta[..., i])
        return here @ self.T_last_hand

    def parameter_jacobian(self, joints: ArrayLike) -> Array:
        """Change of the hand's pose with θ, d, a, α, β of every link, as twists in the hand's own axes.

        joints: (..., n) [rad]. Returns (..., 6, 5, n), rows translation [mm] then rotation [rad], PARAMETERS along the
        fifth axis: T(Φ + ΔΦ) ≈ T(Φ) · Exp(J ΔΦ). Source: the columns J_θ, J_d, J_a, J_α of the paper's Eq. (1).
        """
        frames = self.link_poses(joints)
        hand = self.hand_pose(joints)
        before, after = frames[..., :-1], frames[..., 1:]
        if self.convention == "standard":
            x_axis = after @ Pose(_ry(-self.beta), np.zeros((self.n_joints, 3)))  # the frame between Rx and Ry
            axes = {
                "theta": (before, _Z),
                "d": (before, _Z),
                "a": (x_axis, _X),
                "alpha": (x_axis, _X),
                "beta": (after, _Y),
            }
        else:
            y_axis = (
                before @ Pose(_rx(self.alpha), np.zeros((self.n_joints, 3))) @ Pose(np.eye(3), self.a[:, None] * _X)
            )
            axes = {
                "theta": (after, _Z),
                "d": (after, _Z),
                "a": (before, _X),
                "alpha": (before, _X),
                "beta": (y_axis, _Y),
            }
        columns = [_twist(hand, *axes[name], rotation=name not in ("d", "a")) for name in PARAMETERS]
        return np.stack(columns, -2)

    def joint_jacobian(self, joints: ArrayLike) -> Array:
        """Change of the hand's pose with the joint readings: twists in the hand's axes (..., 6, n) [mm/rad, rad/rad]."""
        j = self.parameter_jacobian(joints)[..., 0, :] * self.sign
        return j if self.coupling is None else np.asarray(j @ self.coupling)

    def corrected(self, delta: ArrayLike) -> RobotModel:
        """The model with ``delta`` (5, n) [rad, mm] added to its PARAMETERS rows."""
        dt, dd, da, dalpha, dbeta = np.asarray(delta, dtype=float)
        return replace(
            self,
            theta_offset=self.theta_offset + dt,
            d=self.d + dd,
            a=self.a + da,
            alpha=self.alpha + dalpha,
            beta=self.beta + dbeta,
        )

    def within_limits(self, joints: ArrayLike) -> NDArray[np.bool_]:
        """Whether all readings (..., n) [rad] lie inside the joint limits (...)."""
        q = np.asarray(joints, dtype=float)
        return np.asarray(np.all((q >= self.min_rad) & (q <= self.max_rad), axis=-1))

    def _link(self, i: int, theta: Array) -> Pose:
        rz, along_z = _rz(theta), np.array([0, 0, self.d[i]])
        rx, ry, along_x = _rx(self.alpha[i]), _ry(self.beta[i]), np.array([self.a[i], 0, 0])
        if self.convention == "standard":
            return Pose(rz @ rx @ ry, rz @ along_x + along_z)
        fixed = rx @ ry
        return Pose(fixed @ rz, np.broadcast_to(along_x + fixed @ along_z, (*theta.shape, 3)))


def _twist(hand: Pose, frame: Pose, axis: Array, *, rotation: bool) -> Array:
    """Twists (..., 6, n) in the hand's axes of unit motions along or about ``axis`` of the frames (..., n)."""
    direction = frame.R @ axis
    to_hand = np.swapaxes(hand.R, -1, -2)[..., None, :, :]
    if rotation:
        linear = np.cross(direction, hand.t[..., None, :] - frame.t)
        twist = np.concatenate([(to_hand @ v[..., None])[..., 0] for v in (linear, direction)], -1)
    else:
        linear = (to_hand @ direction[..., None])[..., 0]
        twist = np.concatenate([linear, np.zeros_like(linear)], -1)
    return np.swapaxes(twist, -1, -2)


def _about(axis: Array, angle: ArrayLike) -> Array:
    return exp_so3(np.asarray(angle, dtype=float)[..., None] * axis)


def _rz(angle: ArrayLike) -> Array:
    return _about(_Z, angle)


def _rx(angle: ArrayLike) -> Array:
    return _about(_X, angle)


def _ry(angle: ArrayLike) -> Array:
    return _about(_Y, angle)
