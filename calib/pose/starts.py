"""Starting poses for the least squares, from the points alone: no guess, no acos."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, cross, nearest_rotation
from geometry.ties import ascending

Array = NDArray[np.float64]

GRID = 1000  # rotations; about 20° apart, a minimum's basin is wider
GRID_KEPT = 24
SAME_MM2 = 1e-6  # sums of squared misses nearer than this are equal


def pencil_starts(starts: Array, directions: Array, yz_mm: Array) -> Pose:
    """Starting poses T_sensor_jig (..., 3) from at least five strings: any, or two faces of the pillar.

    The plane carries (y, z) to {J} by c = t + M (y, z): linear in nine unknowns, two equations a string. Strings of
    one face share a line of the plane, so that five leave a pencil of planes x₀ + μ n about the line through the two
    diagonals' crossings, whose heights are known exactly (an N-localizer each). μ follows from MᵀM = I: a quartic
    with up to two minima, the pose and its mirror. Of lines in general position the equations leave no pencil; the one
    along their weakest direction holds the pose all the same.
    starts, directions: (S, 3) or (..., S, 3) in {J}. yz_mm: (..., S, 2).
    """
    base, direction = _pencil(starts, directions, yz_mm)
    m0, m1 = (v[..., 3:].reshape(*v.shape[:-1], 3, 2) for v in (base, direction))
    m0t, m1t = np.swapaxes(m0, -1, -2), np.swapaxes(m1, -1, -2)
    g0, g1, g2 = m0t @ m0 - np.eye(2), m0t @ m1 + m1t @ m0, m1t @ m1  # MᵀM - I by powers of μ
    square = 2 * (_dot(g1, g1) + 2 * _dot(g0, g2))
    cubic = np.stack([4 * _dot(g2, g2), 6 * _dot(g1, g2), square, 2 * _dot(g0, g1)], -1)
    mu = _cubic_roots(cubic)
    x = base[..., None, :] + mu[..., None] * direction[..., None, :]
    return _poses(x)


def grid_starts(starts: Array, directions: Array, yz_mm: Array, kept: int = GRID_KEPT) -> Pose:
    """The ``kept`` best starting poses (kept) out of a grid over all rotations, each with its best translation.

    For few strings, where no pencil is determined, and beside it for any lines. yz_mm: (S, 2) of one frame.
    """
    R = _rotation_grid()  # R_jig_sensor (G, 3, 3)
    normal = np.eye(3) - directions[:, :, None] * directions[:, None, :]  # (S, 3, 3) across each string
    in_jig = np.einsum("gij,sj->gsi", R[:, :, 1:], yz_mm)
    miss = np.einsum("sij,gsj->gsi", normal, starts - in_jig)  # what the translation must make up
    total = normal.sum(0)
    t = np.linalg.lstsq(total, miss.sum(1).T, rcond=1e-9)[0].T
    left = miss - np.einsum("sij,gj->gsi", normal, t)
    best = ascending(np.sum(left**2, axis=(1, 2)), SAME_MM2)[:kept]
    return Pose(R[best], t[best]).inverse()


def _pencil(starts: Array, directions: Array, yz_mm: Array) -> tuple[Array, Array]:
    """x₀ (..., 9) and n (..., 9) of the pencil; unknowns (t, M row by row)."""
    across = _across(directions)  # (..., S, 2, 3)
    scale = np.mean(np.linalg.norm(yz_mm - yz_mm.mean(-2, keepdims=True), axis=-1), -1)[..., None, None] + 1e-9
    centre = yz_mm.mean(-2, keepdims=True)
    m = (yz_mm - centre) / scale
    shape = np.broadcast_shapes(across.shape[:-3], m.shape[:-2])
    a = np.zeros((*shape, *across.shape[-3:-1], 9))
    a[..., :3] = across
    a[..., 3:] = (across[..., :, None] * m[..., :, None, None, :]).reshape(*shape, *across.shape[-3:-1], 6)
    b = np.sum(across * starts[..., None, :], -1)
    u, s, vt = np.linalg.svd(a.reshape(*shape, -1, 9), full_matrices=False)
    s = np.maximum(s, 1e-9 * s[..., :1])  # points that coincide or stand in one line leave more directions free
    inner = (np.swapaxes(u, -1, -2) @ np.broadcast_to(b, a.shape[:-1]).reshape(*shape, -1, 1))[..., :8, 0] / s[..., :8]
    x = np.stack([(inner[..., None, :] @ vt[..., :8, :])[..., 0, :], vt[..., 8, :]], -2)
    out = x.copy()
    out[..., 3:] = x[..., 3:] / scale
    offset = (out[..., 3:].reshape(*out.shape[:-1], 3, 2) @ centre[..., 0, :][..., None, :, None])[..., 0]
    out[..., :3] -= offset
    return out[..., 0, :], out[..., 1, :]


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=(-1, -2)))


def _poses(x: Array) -> Pose:
    m = x[..., 3:].reshape(*x.shape[:-1], 3, 2)
    y, z = m[..., 0], m[..., 1]
    R_jig_sensor = nearest_rotation(np.stack([cross(y, z), y, z], -1))
    return Pose(R_jig_sensor, x[..., :3]).inverse()


def _across(directions: Array) -> Array:
    """Two unit vectors (..., 2, 3) across each direction (..., 3)."""
    helper = np.where(np.abs(directions[..., :1]) < 0.6, [1.0, 0.0, 0.0], [0.0, 1.0, 0.0])
    first = cross(directions, helper)
    first = first / np.linalg.norm(first, axis=-1, keepdims=True)
    return np.stack([first, cross(directions, first)], -2)


def _cubic_roots(c: Array) -> Array:
    """Real parts (..., 3), ascending, of the roots of cubics (..., 4), highest power first."""
    companion = np.zeros((*c.shape[:-1], 3, 3))
    companion[..., 0, :] = -c[..., 1:] / np.maximum(c[..., :1], 1e-12 * np.abs(c).max(-1, keepdims=True) + 1e-300)
    companion[..., 1, 0] = companion[..., 2, 1] = 1.0
    return np.sort(np.linalg.eigvals(companion).real)  # LAPACK's own order hangs on rounding


@lru_cache(maxsize=1)
def _rotation_grid() -> Array:
    rng = np.random.default_rng(0)
    return Pose.from_quaternion_wxyz(rng.standard_normal((GRID, 4)), np.zeros((GRID, 3))).R
