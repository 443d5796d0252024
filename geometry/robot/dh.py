"""A serial arm by its Denavit-Hartenberg table: forward kinematics and the Jacobians of the paper's Eq. (1)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose, cross
from geometry.robot.parameter import SYMBOLS, Parameter

Array = NDArray[np.float64]

DH_CONVENTIONS = ("standard", "modified")
NEARLY_PARALLEL_RAD = float(np.deg2rad(1.0))  # below this a link's d is the next one's, and β takes its place


@dataclass(frozen=True)
class DhRow:
    """One kind of number in a table: its group, the field of DhRobot that holds it, and its unit."""

    group: str
    column: str
    unit: str

    @property
    def symbol(self) -> str:
        """How it is printed."""
        return SYMBOLS.get(self.group, self.group)

    @property
    def file_key(self) -> str:
        """Its key in files, which are in degrees and mm."""
        return f"{self.column}_{'deg' if self.unit == 'rad' else self.unit}"

    def from_file(self, values: ArrayLike) -> Array:
        """Numbers of a file in radians or mm."""
        return np.asarray(values, dtype=float) * (np.pi / 180 if self.unit == "rad" else 1)

    def to_file(self, values: ArrayLike) -> Array:
        """Radians or mm in the file's unit."""
        return np.asarray(np.rad2deg(values) if self.unit == "rad" else values, dtype=float)


DH_ROWS = (  # the one place that knows their order
    DhRow("theta", "theta_offset", "rad"),
    DhRow("d", "d", "mm"),
    DhRow("a", "a", "mm"),
    DhRow("alpha", "alpha", "rad"),
    DhRow("beta", "beta", "rad"),
)
_GROUPS = tuple(row.group for row in DH_ROWS)
_COLUMNS = (*(row.column for row in DH_ROWS), "sign", "min_rad", "max_rad")

# σ of an ordinary arm, in the units of robot.toml's [uncertainty]
TYPICAL_SIGMA = {
    "joint_sigma_deg": 0.003,
    "theta_sigma_deg": 0.03,
    "d_sigma_mm": 0.15,
    "a_sigma_mm": 0.15,
    "alpha_sigma_deg": 0.015,
}


def _typical(key: str) -> float:
    value = TYPICAL_SIGMA[key]
    return float(np.deg2rad(value)) if key.endswith("_deg") else value


@dataclass(frozen=True)
class RobotUncertainty:
    """Standard deviations of a table and its joint readings; the defaults are those of an ordinary arm.

    Parameters
    ----------
    joint_sigma_rad
        Of one joint's position from one approach to the next.
    theta_sigma_rad, d_sigma_mm, a_sigma_mm, alpha_sigma_rad
        Of the table's numbers, the same for every joint.
    beta_sigma_rad
        Of each joint's β (n); empty where all are taken as known.
    """

    joint_sigma_rad: float = _typical("joint_sigma_deg")
    theta_sigma_rad: float = _typical("theta_sigma_deg")
    d_sigma_mm: float = _typical("d_sigma_mm")
    a_sigma_mm: float = _typical("a_sigma_mm")
    alpha_sigma_rad: float = _typical("alpha_sigma_deg")
    beta_sigma_rad: tuple[float, ...] = ()

    @staticmethod
    def from_file(sigma: Mapping[str, float], scale: float = 1.0) -> RobotUncertainty:
        """Of the keys of TYPICAL_SIGMA; those that are absent are typical. scale: factor on all but the joints'."""
        keys = TYPICAL_SIGMA | dict(sigma)

        def internal(key: str, factor: float = scale) -> float:
            return factor * (float(np.deg2rad(keys[key])) if key.endswith("_deg") else keys[key])

        return RobotUncertainty(
            joint_sigma_rad=internal("joint_sigma_deg", 1.0),
            theta_sigma_rad=internal("theta_sigma_deg"),
            d_sigma_mm=internal("d_sigma_mm"),
            a_sigma_mm=internal("a_sigma_mm"),
            alpha_sigma_rad=internal("alpha_sigma_deg"),
        )

    @property
    def in_file_units(self) -> dict[str, float]:
        """The keys of TYPICAL_SIGMA with the values here."""
        radians = {k: getattr(self, k.replace("_deg", "_rad")) for k in TYPICAL_SIGMA}
        return {k: float(np.rad2deg(v)) if k.endswith("_deg") else v for k, v in radians.items()}

    def table(self, n_joints: int) -> dict[str, Array]:
        """σ (n,) of every group of DH_ROWS."""
        one = {row.group: getattr(self, f"{row.group}_sigma_{row.unit}") for row in DH_ROWS}
        one["beta"] = self.beta_sigma_rad or 0.0
        return {group: np.array(np.broadcast_to(np.asarray(s, dtype=float), n_joints)) for group, s in one.items()}


@dataclass(frozen=True, eq=False)
class DhRobot:
    """Denavit-Hartenberg model of n revolute joints; a Robot whose parameters are the numbers of its table.

    The angle of joint i is ``sign_i · (coupling @ q)_i + theta_offset_i``. A link is
    Rz(θ)·Tz(d)·Tx(a)·Rx(α)·Ry(β) in the "standard" and Rx(α)·Tx(a)·Ry(β)·Rz(θ)·Tz(d) in the "modified" convention;
    β is Hayati's parameter for (nearly) parallel axes, 0 unless calibrated.

    Parameters
    ----------
    theta_offset, d, a, alpha, beta
        The table's columns (n,) [rad] and [mm].
    sign
        +1 or -1 (n,): which way a joint counts.
    min_rad, max_rad
        Limits of the readings (n,), finite: inverse kinematics searches between them.
    convention
        "standard" or "modified".
    coupling
        (n, n) for arms whose motors move more than one joint; None is the unit matrix.
    T_base_first, T_last_hand
        Before the first and after the last link; identity unless a URDF needs them.
    uncertainty
        What the table does not know: it decides which numbers are ``parameters``.
    name
        In reports.
    unstated
        By joint, whether nobody wrote its lower and its upper limit: no reading is out of those. Empty: all are stated.

    Raises
    ------
    InputError
        Where the table can not be an arm.

    References
    ----------
    Denavit & Hartenberg 1955; Craig's modified convention; Hayati 1983.
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
    unstated: tuple[tuple[bool, bool], ...] = ()

    @staticmethod
    def from_dh(theta_offset: ArrayLike, d: ArrayLike, a: ArrayLike, alpha: ArrayLike, **more: object) -> DhRobot:
        """A model of the four DH columns (n,) [rad, mm]; ``more``: further fields by name; infinite limits are none."""
        n = len(np.atleast_1d(np.asarray(d, dtype=float)))
        defaults = {"min_rad": -np.inf, "max_rad": np.inf, "beta": 0.0, "sign": 1.0}
        columns = {"theta_offset": theta_offset, "d": d, "a": a, "alpha": alpha}
        columns |= {k: more.pop(k, v) for k, v in defaults.items()}  # type: ignore[misc]
        arrays = {k: np.array(np.broadcast_to(np.asarray(v, dtype=float), n)) for k, v in columns.items()}
        limits = limit_fields(arrays.pop("min_rad"), arrays.pop("max_rad"))
        return DhRobot(**arrays, **{**limits, **more})  # type: ignore[arg-type]

    def __post_init__(self) -> None:
        """InputError where the table can not be an arm."""
        _check(self)

    @property
    def n_joints(self) -> int:
        """The number of joints."""
        return len(self.d)

    @cached_property
    def parameters(self) -> tuple[Parameter, ...]:
        """The numbers with a prior σ above 0, row by row of DH_ROWS."""
        sigma, (rows, joints) = self._sigma, self._places
        return tuple(
            Parameter(f"{DH_ROWS[r].group}{j + 1}", DH_ROWS[r].unit, float(sigma[r, j]), DH_ROWS[r].group)
            for r, j in zip(rows, joints, strict=True)
        )

    @cached_property
    def readings_to_angles(self) -> Array:
        """The matrix M (n, n) of θ = M q + theta_offset: signs and coupling."""
        coupling = np.eye(self.n_joints) if self.coupling is None else self.coupling
        return np.asarray(self.sign[:, None] * coupling)

    @property
    def parallel_axes(self) -> NDArray[np.bool_]:
        """Whether link i (n,) carries its joint's axis into a (nearly) parallel one: there d is not its own alone."""
        parallel = np.abs(np.sin(self.alpha)) < np.sin(NEARLY_PARALLEL_RAD)
        parallel[-1 if self.convention == "standard" else 0] = False  # that α joins no two joints
        return np.asarray(parallel)

    def joint_angles(self, joints_rad: ArrayLike) -> Array:
        """DH angles θ (..., n) [rad] of the joint readings (..., n) [rad]."""
        q = np.asarray(joints_rad, dtype=float)
        if q.shape[-1:] != (self.n_joints,):
            raise InputError(f"{q.shape[-1] if q.ndim else 0} joint values for a robot of {self.n_joints} joints")
        return np.asarray(q @ self.readings_to_angles.T + self.theta_offset)

    def link_poses(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """Poses (..., n + 1) in the base of the chain's base end and of every link frame, without T_last_hand."""
        if values is not None:
            return self.corrected(values).link_poses(joints_rad)
        q = np.asarray(joints_rad, dtype=float)
        key = q.shape, q.tobytes()
        known = self._last.get(key)  # a step of a fit asks for the hand and for what moves it at the same readings
        if known is None:
            known = self._chain(q)
            self._last.clear()  # of another thread's readings, too: each returns its own
            self._last[key] = known
        return known

    def _chain(self, joints_rad: Array) -> Pose:
        links = self._links(self.joint_angles(joints_rad))
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

    def pose(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Pose:
        """T_base_hand (...) of the joint readings (..., n) [rad]."""
        robot = self if values is None else self.corrected(values)
        return robot.link_poses(joints_rad)[..., -1] @ robot.T_last_hand

    def joint_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """Change of the hand's pose with the readings: twists in the hand's axes (..., 6, n) [mm, rad per rad]."""
        return self.pose_and_jacobian(joints_rad, values)[1]

    def pose_and_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> tuple[Pose, Array]:
        """T_base_hand (...) and joint_jacobian (..., 6, n) of the readings (..., n) [rad], from one chain."""
        robot = self if values is None else self.corrected(values)
        frames = robot.link_poses(joints_rad)
        hand = frames[..., -1] @ robot.T_last_hand
        axis = frames[..., :-1] if robot.convention == "standard" else frames[..., 1:]
        return hand, np.asarray(_rotating(hand, axis.R[..., 2], axis.t) @ robot.readings_to_angles)

    def parameter_jacobian(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """Change of the hand's pose with the parameters: twists in the hand's axes (..., 6, P)."""
        robot = self if values is None else self.corrected(values)
        rows, joints = self._places
        by_group = robot.table_jacobian(joints_rad)
        return np.stack([by_group[row.group] for row in DH_ROWS], -2)[..., rows, joints]

    def table_jacobian(self, joints_rad: ArrayLike) -> dict[str, Array]:
        """Twists (..., 6, n) in the hand's axes by every number of the table, known or not, by the groups of DH_ROWS.

        Source: the columns J_θ, J_d, J_a, J_α of the paper's Eq. (1).
        """
        frames = self.link_poses(joints_rad)
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
        return {
            "theta": _rotating(hand, *z_axis),
            "d": _sliding(hand, z_axis[0]),
            "a": _sliding(hand, x_axis[0]),
            "alpha": _rotating(hand, *x_axis),
            "beta": _rotating(hand, *y_axis),
        }

    def joint_noise(self, joints_rad: ArrayLike, values: ArrayLike | None = None) -> Array:
        """Covariance (..., 6, 6) of the hand's pose, in its axes, from the joints' repeatability."""
        j = self.joint_jacobian(joints_rad, values)
        return np.asarray(self.uncertainty.joint_sigma_rad**2 * (j @ np.swapaxes(j, -1, -2)))

    def corrected(self, values: ArrayLike) -> DhRobot:
        """The model with the corrections (P,) [rad, mm] of its ``parameters`` in its table."""
        v = np.asarray(values, dtype=float)
        rows, joints = self._places
        if v.shape != rows.shape:
            raise InputError(f"{v.size} corrections for a robot of {len(rows)} uncertain parameters")
        delta = np.zeros((len(DH_ROWS), self.n_joints))
        delta[rows, joints] = v
        return self.with_changes(**dict(zip(_GROUPS, delta, strict=True)))

    def with_changes(self, **rows: ArrayLike) -> DhRobot:
        """The model with numbers (n,) [rad, mm] added to the rows of its table, by the groups of DH_ROWS."""
        if unknown := rows.keys() - set(_GROUPS):
            raise InputError(f"a robot's table has {', '.join(_GROUPS)}, not {', '.join(sorted(unknown))}")
        changed = {r.column: getattr(self, r.column) + np.asarray(rows[r.group]) for r in DH_ROWS if r.group in rows}
        return replace(self, **changed)

    def with_beta_prior(self, sigma_rad: float) -> DhRobot:
        """The model with Hayati's β uncertain by ``sigma_rad`` at its parallel axes, exact at the others."""
        sigma = tuple(float(s) for s in np.where(self.parallel_axes, sigma_rad, 0.0))
        return replace(self, uncertainty=replace(self.uncertainty, beta_sigma_rad=sigma))

    def dh_part(self, values: ArrayLike | None = None) -> DhRobot:
        """The model itself, or corrected."""
        return self if values is None else self.corrected(values)

    def within_limits(self, joints_rad: ArrayLike) -> NDArray[np.bool_]:
        """Whether all readings (..., n) [rad] lie inside the joint limits (...) as far as they are stated."""
        q, (low, high) = np.asarray(joints_rad, dtype=float), self.stated_limits
        return np.asarray(np.all((q >= low) & (q <= high), axis=-1))

    @property
    def stated_limits(self) -> tuple[Array, Array]:
        """Lower and upper limits (n,) of the readings [rad], infinite where nobody wrote one."""
        if not self.unstated:
            return self.min_rad, self.max_rad
        low, high = np.array(self.unstated).T
        return np.where(low, -np.inf, self.min_rad), np.where(high, np.inf, self.max_rad)

    @cached_property
    def _last(self) -> dict[tuple[tuple[int, ...], bytes], Pose]:
        """The link poses of the last readings."""
        return {}

    @cached_property
    def _sigma(self) -> Array:
        """Prior σ (5, n) in the order of DH_ROWS."""
        table = self.uncertainty.table(self.n_joints)
        return np.array([table[row.group] for row in DH_ROWS])

    @cached_property
    def _places(self) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
        """Row of DH_ROWS and joint of every parameter."""
        rows, joints = np.nonzero(self._sigma > 0)
        return rows, joints

    def _links(self, theta: Array) -> Pose:
        """The links (..., n) at the DH angles θ (..., n)."""
        rz, fixed = _rotations("z", theta), _rotations("x", self.alpha) @ _rotations("y", self.beta)
        if self.convention == "standard":
            along = np.stack([self.a * np.cos(theta), self.a * np.sin(theta), np.broadcast_to(self.d, theta.shape)], -1)
            return Pose(rz @ fixed, along)
        offset = fixed[:, :, 2] * self.d[:, None]
        offset[:, 0] += self.a
        return Pose(fixed @ rz, np.broadcast_to(offset, (*theta.shape, 3)))


def limit_fields(low: Array, high: Array) -> dict[str, Any]:
    """The fields of DhRobot for limits (n,) [rad]; an infinite one is unstated and searched over a turn or two."""
    turn = 2 * np.pi
    bottom = np.where(np.isinf(low), np.minimum(-turn, np.where(np.isinf(high), 0.0, high) - turn), low)
    top = np.where(np.isinf(high), np.maximum(turn, np.where(np.isinf(low), 0.0, low) + turn), high)
    unstated = tuple((bool(a), bool(b)) for a, b in zip(low == -np.inf, high == np.inf, strict=True))
    return {"min_rad": bottom, "max_rad": top, "unstated": unstated}


def _check(robot: DhRobot) -> None:
    n = len(robot.d)
    if n == 0:
        raise InputError("the robot has no joints: at least one [[joint]] is needed")
    columns = [getattr(robot, name) for name in _COLUMNS]
    for name, column in zip(_COLUMNS, columns, strict=True):
        if column.shape != (n,):
            raise InputError(f"the robot's {name} has {column.size} values for {n} joints")
    if not np.all(finite := np.isfinite(columns)):
        row, joint = np.argwhere(~finite)[0]
        raise InputError(f"joint {joint + 1}: {_COLUMNS[row]} is not a finite number")
    if len(robot.unstated) not in (0, n):
        raise InputError(f"the robot's stated limits are told of {len(robot.unstated)} joints of {n}")
    if len(robot.uncertainty.beta_sigma_rad) not in (0, n):
        raise InputError(f"the robot's β has {len(robot.uncertainty.beta_sigma_rad)} σ for {n} joints")
    if np.any(bad := np.abs(robot.sign) != 1):
        raise InputError(f"joint {int(np.argmax(bad)) + 1}: sign = {robot.sign[np.argmax(bad)]:g}, must be 1 or -1")
    if np.any(bad := robot.min_rad >= robot.max_rad):
        raise InputError(f"joint {int(np.argmax(bad)) + 1}: the lower limit must be below the upper one")
    if robot.convention not in DH_CONVENTIONS:
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
    twists = np.empty((*axis.shape[:-1], 2, 3))
    twists[..., 0, :], twists[..., 1, :] = cross(axis, hand.t[..., None, :] - point), axis
    twists = twists @ hand.R[..., None, :, :]
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
