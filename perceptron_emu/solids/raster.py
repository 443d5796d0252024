"""Flat faces to pixels: the level of the nearest one at every pixel's centre."""

from __future__ import annotations

import threading
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]
Touched = NDArray[np.int64]

SHORT = 12  # pixels of a row that are not worth drawing several at once
FLAT_PX2 = 1e-9  # twice the area of a face's image below which it is not drawn


class DepthBuffer(NamedTuple):
    """What is drawn so far (H, W): the level of the nearest face, and 1/z of it [1/mm]."""

    level: Float32
    inverse_depth: Float32


class FaceRows(NamedTuple):
    """The rows of a face, first to last, and where each enters and leaves it [px]."""

    first: int
    last: int
    left: Array
    right: Array


class Canvas(threading.local):
    """Room to draw in, kept by each thread: fresh memory for every frame would cost more than drawing.

    What was drawn last is wiped before the next picture.
    """

    def __init__(self) -> None:
        self._drawn: dict[tuple[int, int], tuple[DepthBuffer, Touched]] = {}

    def blank(self, shape: tuple[int, int]) -> tuple[DepthBuffer, Touched]:
        """Buffers of 0, and the box that drawing will widen."""
        if shape not in self._drawn:
            self._drawn.clear()  # one size at a time: a sensor's
            self._drawn[shape] = DepthBuffer(*np.zeros((2, *shape), np.float32)), np.zeros(4, np.int64)
        drawn, box = self._drawn[shape]
        _wipe(drawn, box)
        return drawn, box


_canvas = Canvas()


def rasterise(
    facets: Array, level: Float32, shape: tuple[int, int], intrinsics: tuple[float, float, float, float]
) -> tuple[Float32, Touched]:
    """The pinhole picture of convex flat faces, all before the camera: the level of the nearest at each pixel's centre.

    Parameters
    ----------
    facets : Array
        Corners (F, 4, 3) [mm] in the camera's axes; a triangle has its last one twice.
    level : Float32
        (F,).
    shape : tuple of int
        FaceRows and columns.
    intrinsics : tuple of float
        fx, fy, cx, cy [px].

    Returns
    -------
    picture : Float32
        (H, W), 0 where no face is; 1/z is linear in the image. It is this thread's until its next call.
    box : NDArray
        (4,) first row that is not 0 and the one after the last, first column and the one after the last.
    """
    drawn, box = _canvas.blank(shape)
    _rasterise(drawn, facets, level, intrinsics, box)
    return drawn.level, box


@kernel
def _wipe(drawn: DepthBuffer, box: Touched) -> None:
    """Set what was drawn to 0, and the box to nothing."""
    top, bottom, left, right = box
    for j in range(top, bottom):
        for part in (drawn.level[j, left:right], drawn.inverse_depth[j, left:right]):
            for i in range(len(part)):
                part[i] = 0
    box[0], box[1], box[2], box[3] = drawn.level.shape[0], 0, drawn.level.shape[1], 0


@kernel
def _rasterise(
    drawn: DepthBuffer, facets: Array, level: Float32, intrinsics: tuple[float, float, float, float], box: Touched
) -> None:
    fx, fy, cx, cy = intrinsics
    corners = np.empty((4, 3))  # (u, v, 1/z)
    left, right = np.empty((2, len(drawn.level)))
    columns = drawn.level.shape[1]
    for f in range(len(facets)):
        for k in range(4):
            x, y, z = facets[f, k, 0], facets[f, k, 1], facets[f, k, 2]
            corners[k, 0], corners[k, 1], corners[k, 2] = fx * x / z + cx, fy * y / z + cy, 1 / z
        first, last = _edges(corners, left, right)
        if first <= last:
            _draw_facet(drawn, corners, FaceRows(first, last, left, right), level[f])
            low, high = corners[0, 0], corners[0, 0]
            for k in range(1, 4):
                low, high = min(low, corners[k, 0]), max(high, corners[k, 0])
            box[0], box[1] = min(box[0], first), max(box[1], last + 1)
            box[2] = min(box[2], int(min(max(low, 0.0), float(columns))))
            box[3] = max(box[3], int(min(max(high + 1, 0.0), float(columns))))


@kernel(fastmath=True)
def _edges(corners: Array, left: Array, right: Array) -> tuple[int, int]:
    """Fill where rows enter and leave the face; its first and last row."""
    last = len(left) - 1.0
    first_row = int(max(np.ceil(corners[:, 1].min()), 0.0))
    last_row = int(min(np.floor(corners[:, 1].max()), last))
    for j in range(first_row, last_row + 1):
        left[j], right[j] = 1e30, -1e30
    for k in range(4):
        u0, v0, u1, v1 = corners[k, 0], corners[k, 1], corners[(k + 1) % 4, 0], corners[(k + 1) % 4, 1]
        if v0 > v1:
            u0, v0, u1, v1 = u1, v1, u0, v0
        if not v1 > v0:
            continue
        slope = (u1 - u0) / (v1 - v0)
        for j in range(int(max(np.ceil(v0), 0.0)), int(min(np.floor(v1), last)) + 1):
            u = u0 + (j - v0) * slope
            left[j], right[j] = min(left[j], u), max(right[j], u)
    return first_row, last_row


@kernel(fastmath=True)
def _draw_facet(drawn: DepthBuffer, corners: Array, rows: FaceRows, level: np.float32) -> None:
    picture, inverse_depth = drawn
    left, right = rows.left, rows.right
    last_column = picture.shape[1] - 1.0
    (u0, v0, w0), (u1, v1, w1), (u2, v2, w2), (u3, v3, w3) = corners[0], corners[1], corners[2], corners[3]
    area = (u1 - u0) * (v2 - v0) - (u2 - u0) * (v1 - v0)
    rest = (u2 - u0) * (v3 - v0) - (u3 - u0) * (v2 - v0)
    if abs(rest) > abs(area):  # the larger half tells the plane
        u1, v1, w1, area = u3, v3, w3, -rest
    if abs(area) < FLAT_PX2:
        return
    along_u = ((w1 - w0) * (v2 - v0) - (w2 - w0) * (v1 - v0)) / area
    along_v = ((w2 - w0) * (u1 - u0) - (w1 - w0) * (u2 - u0)) / area
    step = np.float32(along_u)
    for j in range(rows.first, rows.last + 1):
        first, last = int(np.ceil(max(left[j], 0.0))), int(np.floor(min(right[j], last_column)))
        inverse = np.float32(w0 + along_u * (first - u0) + along_v * (j - v0))
        if last - first < SHORT:
            for i in range(first, last + 1):
                here = inverse + np.float32(i - first) * step
                if here > inverse_depth[j, i]:
                    inverse_depth[j, i], picture[j, i] = here, level
        else:
            _draw_row(picture[j, first : last + 1], inverse_depth[j, first : last + 1], inverse, step, level)


@kernel(fastmath=True)
def _draw_row(levels: Float32, depths: Float32, inverse: np.float32, step: np.float32, level: np.float32) -> None:
    """Without branches, so that the compiler can do several pixels at once."""
    for i in range(len(depths)):
        here = inverse + np.float32(i) * step
        nearer = here > depths[i]
        depths[i] = here if nearer else depths[i]
        levels[i] = level if nearer else levels[i]
