"""Rigid transforms: SE(3) with exp, log, composition and inverse, batched over leading axes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]

_EYE = np.eye(3)
_SMALL_RAD = 1e-4  # below this the closed forms lose digits and their series are exact to rounding


def skew(v: ArrayLike) -> Array:
    """The cross-product matrix, with ``skew(a) @ b == cross(a, b)``.

    Parameters
    ----------
    v : (..., 3)
        Vectors.

    Returns
    -------
    (..., 3, 3) array
        Antisymmetric.
    """
    v = np.asarray(v, dtype=float)
    out = np.zeros((*v.shape[:-1], 3, 3))
    out[..., 0, 1], out[..., 0, 2], out[..., 1, 2] = -v[..., 2], v[..., 1], -v[..., 0]
    return out - np.swapaxes(out, -1, -2)


def cross(a: Array, b: Array) -> Array:
    """Cross product along the last axis (..., 3) of float arrays (np.cross spends most of its time on checks)."""
    a0, a1, a2 = a[..., 0], a[..., 1], a[..., 2]
    b0, b1, b2 = b[..., 0], b[..., 1], b[..., 2]
    x = a1 * b2 - a2 * b1
    out = np.empty((*x.shape, 3))
    out[..., 0], out[..., 1], out[..., 2] = x, a2 * b0 - a0 * b2, a0 * b1 - a1 * b0
    return out


def _series(angle: Array) -> tuple[Array, Array, Array]:
    """Sin θ/θ, (1 - cos θ)/θ², (θ - sin θ)/θ³ for θ ≥ 0, exact to rounding at every angle."""
    small = angle < _SMALL_RAD
    safe = np.where(small, 1.0, angle)
    a2 = angle * angle
    return (
        np.where(small, 1 - a2 / 6, np.sin(safe) / safe),
        np.where(small, 0.5 - a2 / 24, 2 * np.sin(safe / 2) ** 2 / safe**2),
        np.where(small, 1 / 6 - a2 / 120, (safe - np.sin(safe)) / safe**3),
    )


def exp_so3(rotvec: ArrayLike) -> Array:
    """The rotation matrices of rotation vectors.

    Parameters
    ----------
    rotvec : (..., 3)
        Axis times angle [rad].

    Returns
    -------
    (..., 3, 3) array
        R, by Rodrigues' formula.
    """
    w = np.asarray(rotvec, dtype=float)
    s, c, _ = (x[..., None, None] for x in _series(np.linalg.norm(w, axis=-1)))
    k = skew(w)
    return np.eye(3) + s * k + c * (k @ k)


def log_so3(rotation: ArrayLike) -> Array:
    """The rotation vectors of rotation matrices.

    Parameters
    ----------
    rotation : (..., 3, 3)
        Orthogonal, determinant 1; not checked.

    Returns
    -------
    (..., 3) array
        Axis times angle [rad], of length ≤ π.
    """
    q = quaternion_wxyz(rotation)
    vec = q[..., 1:]
    sin_half = np.linalg.norm(vec, axis=-1)
    small = sin_half < 1e-12
    scale = np.where(small, 2.0, 2 * np.arctan2(sin_half, q[..., 0]) / np.where(small, 1.0, sin_half))
    return np.asarray(scale[..., None] * vec)


def quaternion_wxyz(rotation: ArrayLike) -> Array:
    """The unit quaternions of rotation matrices.

    Parameters
    ----------
    rotation : (..., 3, 3)
        Orthogonal, determinant 1; not checked.

    Returns
    -------
    (..., 4) array
        w first and w ≥ 0.

    References
    ----------
    S. W. Shepperd, Quaternion from rotation matrix, J. Guidance and Control 1978.
    """
    r = np.asarray(rotation, dtype=float)
    qq = np.empty((*r.shape[:-2], 4, 4))  # 4 q qᵀ: every element is linear in R
    trace = np.trace(r, axis1=-2, axis2=-1)
    qq[..., 1:, 1:] = r + np.swapaxes(r, -1, -2)
    qq[..., (1, 2, 3), (1, 2, 3)] += 1 - trace[..., None]
    qq[..., 0, 0] = 1 + trace
    cross = np.stack([r[..., 2, 1] - r[..., 1, 2], r[..., 0, 2] - r[..., 2, 0], r[..., 1, 0] - r[..., 0, 1]], -1)
    qq[..., 0, 1:] = qq[..., 1:, 0] = cross
    largest = np.argmax(np.diagonal(qq, axis1=-2, axis2=-1), axis=-1)
    q = np.take_along_axis(qq, largest[..., None, None], axis=-2)[..., 0, :]
    return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True) * np.where(q[..., :1] < 0, -1.0, 1.0))


def nearest_rotation(matrix: ArrayLike) -> Array:
    """The rotation nearest to a matrix in the Frobenius norm (orthogonal Procrustes).

    Parameters
    ----------
    matrix : (..., 3, 3)
        Any.

    Returns
    -------
    (..., 3, 3) array
        Orthogonal, determinant 1.
    """
    u, _, vt = np.linalg.svd(np.asarray(matrix, dtype=float))
    last = np.where(np.linalg.det(u @ vt) < 0, -1.0, 1.0)
    u[..., :, 2] *= last[..., None]
    return np.asarray(u @ vt)


@dataclass(frozen=True, eq=False)
class Pose:
    """The pose ``T_a_b`` of frame b in frame a: ``p_a = T_a_b @ p_b``; leading axes of R and t are a batch.

    R: rotation (..., 3, 3). t: translation (..., 3) [mm].
    """

    R: Array
    t: Array

    __array_ufunc__ = None  # numpy on the left of @ is an error, not an array of objects

    @staticmethod
    def identity() -> Pose:
        """The pose that changes nothing."""
        return Pose(np.eye(3), np.zeros(3))

    @staticmethod
    def from_matrix(matrix: ArrayLike, atol: float = 1e-4) -> Pose:
        """Pose of homogeneous matrices (..., 4, 4) [mm], made orthogonal to the last digit.

        InputError where the rotation is off by more than ``atol`` (the default forgives files of five decimals).
        """
        m = np.asarray(matrix, dtype=float)
        if m.shape[-2:] != (4, 4):
            raise InputError(f"a transform must be 4 × 4, not {' × '.join(map(str, m.shape)) or 'a single number'}")
        check_rotation(m[..., :3, :3], atol)
        if not np.all(np.isfinite(m[..., :3, 3])):
            raise InputError("a transform's translation holds a number that is not finite")
        if np.any(m[..., 3, :] != [0, 0, 0, 1]):
            raise InputError("a transform's last row must be 0, 0, 0, 1 (is the matrix transposed?)")
        return Pose(nearest_rotation(m[..., :3, :3]), m[..., :3, 3].copy())

    @staticmethod
    def from_fixed_xyz_deg(rotation_deg: ArrayLike, translation_mm: ArrayLike) -> Pose:
        """Pose of rotations about fixed X, Y, Z (..., 3) [deg], R = Rz·Ry·Rx, and a translation (..., 3) [mm]."""
        x, y, z = np.moveaxis(np.deg2rad(np.asarray(rotation_deg, dtype=float)), -1, 0)
        zero = np.zeros_like(x)
        rx, ry, rz = (exp_so3(np.stack(v, -1)) for v in ((x, zero, zero), (zero, y, zero), (zero, zero, z)))
        return Pose(rz @ ry @ rx, np.array(translation_mm, dtype=float))

    @staticmethod
    def from_quaternion_wxyz(quaternion: ArrayLike, translation_mm: ArrayLike) -> Pose:
        """Pose of quaternions (..., 4), w first, normalised here, and a translation (..., 3) [mm]."""
        q = np.asarray(quaternion, dtype=float)
        norm = np.linalg.norm(q, axis=-1, keepdims=True)
        if not np.all(np.isfinite(norm) & (norm > 0)):
            raise InputError("a quaternion must be four finite numbers, w first, that are not all 0")
        q = q / norm
        w, v = q[..., 0, None, None], q[..., 1:]
        k = skew(v)
        return Pose(np.eye(3) + 2 * w * k + 2 * (k @ k), np.array(translation_mm, dtype=float))

    @staticmethod
    def exp(xi: ArrayLike) -> Pose:
        """Exponential of the tangent vectors (..., 6): translation [mm], then rotation [rad]."""
        xi = np.asarray(xi, dtype=float)
        rho, w = xi[..., :3], xi[..., 3:]
        s, c, d = (x[..., None, None] for x in _series(np.sqrt(np.sum(w * w, axis=-1))))
        k = skew(w)
        square = k @ k
        left = _EYE + c * k + d * square
        return Pose(_EYE + s * k + c * square, (left @ rho[..., None])[..., 0])

    def log(self) -> Array:
        """The tangent vectors (..., 6), translation [mm] then rotation [rad], with ``Pose.exp(p.log()) == p``."""
        w = log_so3(self.R)
        angle = np.linalg.norm(w, axis=-1)
        small = angle < _SMALL_RAD
        safe = np.where(small, 1.0, angle)
        half = safe / 2
        coefficient = np.where(small, 1 / 12 + angle**2 / 720, (1 - half / np.tan(half)) / safe**2)[..., None, None]
        k = skew(w)
        rho = (np.eye(3) - 0.5 * k + coefficient * (k @ k)) @ self.t[..., None]
        return np.concatenate([rho[..., 0], w], -1)

    @property
    def matrix(self) -> Array:
        """Homogeneous matrices (..., 4, 4) [mm]."""
        out = np.zeros((*self.t.shape[:-1], 4, 4))
        out[..., :3, :3], out[..., :3, 3], out[..., 3, 3] = self.R, self.t, 1.0
        return out

    @property
    def fixed_xyz_deg(self) -> Array:
        """Rotations about fixed X, Y, Z (..., 3) [deg], R = Rz·Ry·Rx; where Y is ±90° X is set to 0."""
        r = self.R
        cos_y = np.hypot(r[..., 0, 0], r[..., 1, 0])
        x = np.where(cos_y < 1e-9, 0.0, np.arctan2(r[..., 2, 1], r[..., 2, 2]))
        # Z from the second column of R·Rx⁻¹, which keeps its digits however small cos Y is
        s, c = np.sin(x), np.cos(x)
        z = np.arctan2(r[..., 0, 2] * s - r[..., 0, 1] * c, r[..., 1, 1] * c - r[..., 1, 2] * s)
        return np.asarray(np.rad2deg(np.stack([x, np.arctan2(-r[..., 2, 0], cos_y), z], -1)))

    @property
    def adjoint(self) -> Array:
        """Adjoint (..., 6, 6): ``T @ exp(xi) == exp(T.adjoint @ xi) @ T``."""
        out = np.zeros((*self.t.shape[:-1], 6, 6))
        out[..., :3, :3] = out[..., 3:, 3:] = self.R
        out[..., :3, 3:] = skew(self.t) @ self.R
        return out

    def inverse(self) -> Pose:
        """The pose ``T_b_a``."""
        rt = np.swapaxes(self.R, -1, -2)
        return Pose(rt, -(rt @ self.t[..., None])[..., 0])

    @overload
    def __matmul__(self, other: Pose) -> Pose: ...
    @overload
    def __matmul__(self, other: Array) -> Array: ...
    def __matmul__(self, other: Pose | Array) -> Pose | Array:
        """Compose with a pose (batches broadcast), or map points.

        A single pose maps points (..., 3), a batch (N) maps (N, ..., 3).
        """
        if isinstance(other, Pose):
            return Pose(self.R @ other.R, (self.R @ other.t[..., None])[..., 0] + self.t)
        p = np.asarray(other, dtype=float)
        extra = p.ndim - self.t.ndim
        if self.t.ndim == 1 or extra <= 0:
            return np.asarray((self.R @ p[..., None])[..., 0] + self.t)
        shape = (*self.t.shape[:-1], *(1,) * extra)
        return np.asarray((self.R.reshape(*shape, 3, 3) @ p[..., None])[..., 0] + self.t.reshape(*shape, 3))

    def __getitem__(self, index: object) -> Pose:
        """The poses at ``index`` of the batch axes."""
        if self.t.ndim == 1:
            raise TypeError("a single pose has no batch to index")
        if isinstance(index, int | np.integer | slice):
            return Pose(self.R[index], self.t[index])
        batch = index if isinstance(index, tuple) else (index,)
        if not any(i is Ellipsis for i in batch):
            batch = (*batch, Ellipsis)
        return Pose(self.R[(*batch, slice(None), slice(None))], self.t[(*batch, slice(None))])

    def __bool__(self) -> bool:
        """A pose is there, however many it holds: ``pose or other`` asks for None alone."""
        return True

    def __len__(self) -> int:
        """How many poses the first batch axis holds."""
        if self.t.ndim == 1:
            raise TypeError("a single pose has no length")
        return int(self.t.shape[0])


def check_rotation(rotation: ArrayLike, atol: float = 1e-6) -> None:
    """InputError unless every (..., 3, 3) is a rotation to within ``atol`` per element."""
    r = np.asarray(rotation, dtype=float)
    if not np.all(np.isfinite(r)):
        raise InputError("a rotation matrix holds a number that is not finite")
    error = float(np.max(np.abs(r @ np.swapaxes(r, -1, -2) - np.eye(3))))
    if error > atol:
        raise InputError(
            f"the matrix is not a rotation: R·Rᵀ differs from the unit matrix by {error:.3g} (limit {atol:g})"
        )
    if np.any(np.linalg.det(r) < 0):
        raise InputError("the matrix is a reflection (determinant -1), not a rotation")


def stack_poses(poses: list[Pose] | tuple[Pose, ...]) -> Pose:
    """One batch of poses from single ones.

    Parameters
    ----------
    poses : sequence of N Pose
        Of one pair of frames.

    Returns
    -------
    Pose
        The batch (N).
    """
    if not poses:
        return Pose(np.zeros((0, 3, 3)), np.zeros((0, 3)))
    return Pose(np.stack([p.R for p in poses]), np.stack([p.t for p in poses]))
