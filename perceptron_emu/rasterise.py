"""Triangles to pixels: the level of the nearest one at every pixel's centre."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]

SHORT = 12  # pixels of a row that are not worth drawing several at once


def rasterise(
    triangles: Array, level: Float32, shape: tuple[int, int], intrinsics: tuple[float, float, float, float]
) -> Float32:
    """The pinhole picture (H, W) of triangles (T, 3, 3) [mm] of the camera frame, all before it; 0 where none is.

    intrinsics: fx, fy, cx, cy [px]. 1/z is linear in the image.
    """
    picture, inverse_depth = np.zeros((2, *shape), np.float32)
    _rasterise(picture, inverse_depth, triangles, level, *intrinsics)
    return picture


@njit(cache=True, error_model="numpy")
def _rasterise(picture, inverse_depth, triangles, level, fx, fy, cx, cy):  # type: ignore[no-untyped-def]
    corners = np.empty((3, 3))  # (v, u, 1/z), from the top down
    for t in range(len(triangles)):
        for k in range(3):
            x, y, z = triangles[t, k, 0], triangles[t, k, 1], triangles[t, k, 2]
            corners[k, 0], corners[k, 1], corners[k, 2] = fy * y / z + cy, fx * x / z + cx, 1 / z
        for a, b in ((0, 1), (1, 2), (0, 1)):
            if corners[a, 0] > corners[b, 0]:
                for k in range(3):
                    corners[a, k], corners[b, k] = corners[b, k], corners[a, k]
        _draw_triangle(picture, inverse_depth, corners, level[t])


@njit(cache=True, error_model="numpy", fastmath=True)
def _draw_triangle(picture, inverse_depth, corners, level):  # type: ignore[no-untyped-def]
    height, width = picture.shape
    (v0, u0, w0), (v1, u1, w1), (v2, u2, w2) = corners[0], corners[1], corners[2]
    area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
    if abs(area) < 1e-9:
        return
    along_u = ((w1 - w0) * (v2 - v0) - (w2 - w0) * (v1 - v0)) / area
    along_v = ((w2 - w0) * (u1 - u0) - (w1 - w0) * (u2 - u0)) / area
    step = np.float32(along_u)
    upper, lower, whole = (u1 - u0) / (v1 - v0), (u2 - u1) / (v2 - v1), (u2 - u0) / (v2 - v0)
    for j in range(int(max(np.ceil(v0), 0.0)), int(min(np.floor(v2), height - 1.0)) + 1):
        one = u0 + (j - v0) * whole
        other = u0 + (j - v0) * upper if j < v1 else u1 + (j - v1) * lower
        left, right = max(np.ceil(min(one, other)), 0.0), min(np.floor(max(one, other)), width - 1.0)
        if not left <= right:
            continue
        first, last = int(left), int(right)
        inverse = np.float32(w0 + along_u * (first - u0) + along_v * (j - v0))
        if last - first < SHORT:
            for i in range(first, last + 1):
                here = inverse + np.float32(i - first) * step
                if here > inverse_depth[j, i]:
                    inverse_depth[j, i], picture[j, i] = here, level
        else:
            _draw_row(picture[j, first : last + 1], inverse_depth[j, first : last + 1], inverse, step, level)


@njit(cache=True, error_model="numpy", fastmath=True)
def _draw_row(levels, depths, inverse, step, level):  # type: ignore[no-untyped-def]
    """Without branches, so that the compiler can do several pixels at once."""
    for i in range(len(depths)):
        here = inverse + np.float32(i) * step
        nearer = here > depths[i]
        depths[i] = here if nearer else depths[i]
        levels[i] = level if nearer else levels[i]
