"""A serial arm by its Denavit-Hartenberg table: forward kinematics and the Jacobians of the paper's Eq. (1)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose, cross

Array = NDArray[np.float64]

PARAMETERS = ("theta", "d", "a", "alpha", "beta")  # order of the rows wherever DH parameters are stacked
CONVENTIONS = ("standard", "modified")
_COLUMNS = ("theta_offset", "d", "a", "alpha", "beta", "sign", "min_rad", "max_rad")


@dataclass(frozen=True)
class RobotUncertainty:
    """Standard deviations of a table and its joint readings; the defaults are those of an ordinary arm."""

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
        _check(self)

    @property
    def n_joints(self) -> int:
        """The number of joints."""
        return len(self.d)

    @property
    def readings_to_angles(self) -> Array:
        """The matrix M (n, n) of θ = M q + theta_offset: signs and coupling."""
        coupling = np.eye(self.n_joints) if self.coupling is None else self.coupling
        return np.asarray(self.sign[:, None] * coupling)

    def joint_angles(self, joints: ArrayLike) -> Array:
        """DH angles θ (..., n) [rad] of the joint readings (..., n) [rad]."""
        q = np.asarray(joints, dtype=float)
        if q.shape[-1:] != (self.n_joints,):
            raise InputError(f"{q.shape[-1] if q.ndim else 0} joint values for a robot of {self.n_joints} joints")
        return np.asarray(q @ self.readings_to_angles.T + self.theta_offset)

    def link_poses(self, joints: ArrayLike) -> Pose:
        """Poses (..., n + 1) in the base of the chain's base end and of every link frame, without T_last_hand."""
        links = self._links(self.joint_angles(joints))
        batch = links.t.shape[:-2]
        rotations = np.empty((*batch, self.n_joints + 1, 3, 3))
        translations = np.empty((*batch, self.n_joints + 1, 3))
        rotations[..., 0, :, :], translations[..., 0, :] = self.T_base_first.R, self.T_base_first.t
        for i in range(self.n_joints):
            before = rotations[..., i, :, :]
            rotations[..., i + 1, :, :] = before @ links.R[..., i, :, :]
            moved = (before @ links.t[..., i, :, None])[..., 0]
            translations[..., i + 1, :] = moved + translations[..., i, :]
        return Pose(rotations, translations)

    def hand_pose(self, joints: ArrayLike) -> Pose:
        """T_base_hand (...) of the joint readings (..., n) [rad]."""
        return self.link_poses(joints)[..., -1] @ self.T_last_hand

    def parameter_jacobian(self, joints: ArrayLike) -> Array:
        """Change of the hand's pose with θ, d, a, α, β of every link, as twists in the hand's own axes.

        joints: (..., n) [rad]. Returns (..., 6, 5, n), rows translation [mm] then rotation [rad], PARAMETERS along the
        fifth axis: T(Φ + ΔΦ) ≈ T(Φ) · Exp(J ΔΦ). Source: the columns J_θ, J_d, J_a, J_α of the paper's Eq. (1).
        """
        frames = self.link_poses(joints)
        hand = frames[..., -1] @ self.T_last_hand
        before, after = frames[..., :-1], frames[..., 1:]
        # axis direction in the base, and a point on it, of the joint's z, the link's x and Hayati's y
        if self.convention == "standard":
            x = (after.R @ _rotations("y", -self.beta))[..., 0]
            z_axis, x_axis, y_axis = (before.R[..., 2], before.t), (x, after.t), (after.R[..., 1], after.t)
        else:
            turned = before.R @ _rotations("x", self.alpha)
            y_at = before.t + before.R[..., 0] * self.a[:, None]
            z_axis, x_axis, y_axis = (after.R[..., 2], after.t), (before.R[..., 0], before.t), (turned[..., 1], y_at)
        columns = [
            _rotating(hand, *z_axis),
            _sliding(hand, z_axis[0]),
            _sliding(hand, x_axis[0]),
            _rotating(hand, *x_axis),
            _rotating(hand, *y_axis),
        ]
        return np.stack(columns, -2)

    def joint_jacobian(self, joints: ArrayLike) -> Array:
        """Change of the hand's pose with the readings: twists in the hand's axes (..., 6, n) [mm, rad per rad]."""
        return self.pose_and_jacobian(joints)[1]

    def pose_and_jacobian(self, joints: ArrayLike) -> tuple[Pose, Array]:
        """T_base_hand (...) and joint_jacobian (..., 6, n) of the readings (..., n) [rad], from one chain."""
        frames = self.link_poses(joints)
        hand = frames[..., -1] @ self.T_last_hand
        axis = frames[..., :-1] if self.convention == "standard" else frames[..., 1:]
        return hand, np.asarray(_rotating(hand, axis.R[..., 2], axis.t) @ self.readings_to_angles)

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

    def _links(self, theta: Array) -> Pose:
        """The links (..., n) at the DH angles θ (..., n)."""
        rz, fixed = _rotations("z", theta), _rotations("x", self.alpha) @ _rotations("y", self.beta)
        if self.convention == "standard":
            along = np.stack([self.a * np.cos(theta), self.a * np.sin(theta), np.broadcast_to(self.d, theta.shape)], -1)
            return Pose(rz @ fixed, along)
        offset = fixed[:, :, 2] * self.d[:, None]
        offset[:, 0] += self.a
        return Pose(fixed @ rz, np.broadcast_to(offset, (*theta.shape, 3)))


def _check(robot: RobotModel) -> None:
    n = len(robot.d)
    if n == 0:
        raise InputError("the robot has no joints: at least one [[joint]] is needed")
    for name in _COLUMNS:
        column = getattr(robot, name)
        if column.shape != (n,):
            raise InputError(f"the robot's {name} has {column.size} values for {n} joints")
        if not np.all(np.isfinite(column)):
            raise InputError(f"joint {int(np.argmin(np.isfinite(column))) + 1}: {name} is not a finite number")
    if np.any(bad := np.abs(robot.sign) != 1):
        raise InputError(f"joint {int(np.argmax(bad)) + 1}: sign = {robot.sign[np.argmax(bad)]:g}, must be 1 or -1")
    if np.any(bad := robot.min_rad >= robot.max_rad):
        raise InputError(f"joint {int(np.argmax(bad)) + 1}: the lower limit must be below the upper one")
    if robot.convention not in CONVENTIONS:
        raise InputError(f'robot convention "{robot.convention}": must be "standard" or "modified"')
    if robot.coupling is not None:
        _check_coupling(robot.coupling, n)


def _check_coupling(coupling: Array, n: int) -> None:
    if coupling.shape != (n, n) or not np.all(np.isfinite(coupling)):
        raise InputError(f"[coupling] matrix must be {n} × {n} finite numbers")
    if np.linalg.cond(coupling) > 1e6:
        raise InputError("[coupling] matrix is singular: two joints would move the same way")


def _rotating(hand: Pose, axis: Array, point: Array) -> Array:
    """Twists (..., 6, n) in the hand's axes of unit rotations about axes (..., n, 3) through points (..., n, 3)."""
    linear = cross(axis, hand.t[..., None, :] - point)
    twists = np.stack([linear, axis], -2) @ hand.R[..., None, :, :]
    return np.moveaxis(twists.reshape(*twists.shape[:-2], 6), -1, -2)


def _sliding(hand: Pose, axis: Array) -> Array:
    """Twists (..., 6, n) in the hand's axes of unit motions along axes (..., n, 3)."""
    linear = axis @ hand.R
    return np.moveaxis(np.concatenate([linear, np.zeros_like(linear)], -1), -1, -2)


def _rotations(axis: str, angle: Array) -> Array:
    """Rotations (..., 3, 3) about one coordinate axis by angles (...) [rad]."""
    i, j, k = {"x": (0, 1, 2), "y": (1, 2, 0), "z": (2, 0, 1)}[axis]
    out, c, s = np.zeros((*angle.shape, 3, 3)), np.cos(angle), np.sin(angle)
    out[..., i, i] = 1.0
    out[..., j, j] = out[..., k, k] = c
    out[..., j, k], out[..., k, j] = -s, s
    return out
