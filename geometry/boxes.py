"""How far segments and boxes are from boxes: exact distances, as collisions of an arm with what stands around need."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

from geometry.pose import Pose

Array = NDArray[np.float64]

_CORNERS = np.array(list(product((0, 1), repeat=3)))
_EDGES = np.array([(i, j) for i in range(8) for j in range(i + 1, 8) if np.abs(_CORNERS[i] - _CORNERS[j]).sum() == 1])


def segments_to_boxes_mm(starts: Array, ends: Array, boxes: Array) -> Array:
    """Least distances (..., B) of segments from axis-aligned boxes; 0 where they meet.

    Along a segment the squared distance from a box is convex and, between the six planes of the box, quadratic: its
    derivative is piecewise linear, and the least distance is where that changes sign.

    Parameters
    ----------
    starts, ends : Array
        Ends (..., 3) of the segments.
    boxes : Array
        Least and largest corners (B, 2, 3).

    Returns
    -------
    Array
        (..., B).
    """
    low, high = boxes[:, 0], boxes[:, 1]
    a, d = starts[..., None, :], (ends - starts)[..., None, :]  # (..., 1, 3)
    with np.errstate(divide="ignore", invalid="ignore"):
        planes = np.concatenate([(low - a) / d, (high - a) / d], axis=-1)
    inner = np.clip(np.nan_to_num(planes, nan=0.0, posinf=1.0, neginf=0.0), 0, 1)
    ends_of = np.zeros((*inner.shape[:-1], 1))
    t = np.sort(np.concatenate([ends_of, inner, ends_of + 1], axis=-1), axis=-1)  # (..., B, 8)
    slope = np.sum(_outside(a[..., None, :] + t[..., None] * d[..., None, :], boxes[:, None]) * d[..., None, :], -1)
    beyond = np.where(np.any(slope >= 0, axis=-1), np.argmax(slope >= 0, axis=-1), t.shape[-1] - 1)
    after, before = beyond[..., None], np.maximum(beyond - 1, 0)[..., None]
    t1, t0 = np.take_along_axis(t, after, -1), np.take_along_axis(t, before, -1)
    s1, s0 = np.take_along_axis(slope, after, -1), np.take_along_axis(slope, before, -1)
    share = np.clip(-s0 / np.where(s1 > s0, s1 - s0, 1.0), 0, 1)
    least = np.where(s1 >= 0, t0 + share * (t1 - t0), t1)
    return np.asarray(np.linalg.norm(_outside(a + least * d, boxes), axis=-1))


def box_to_boxes_mm(T_frame_box: Pose, box: Array, boxes: Array) -> Array:
    """Least distances (N, B) of a box at the poses (N) from axis-aligned boxes; 0 where they meet.

    The nearest points of two boxes lie on an edge of the one and anywhere in the other, and where boxes meet an edge of
    one of them enters the other.

    Parameters
    ----------
    T_frame_box : Pose
        (N) of the box's axes.
    box : Array
        Its least and largest corners (2, 3) in them.
    boxes : Array
        (B, 2, 3) in the frame.
    """
    own = box_edges(box)
    starts, ends = (T_frame_box @ own[None, :, k] for k in (0, 1))
    distance = np.min(segments_to_boxes_mm(starts, ends, boxes), axis=1)
    others = np.stack([box_edges(b) for b in boxes]).reshape(-1, 2, 3)
    back = T_frame_box.inverse()
    starts, ends = (back @ others[None, :, k] for k in (0, 1))
    reverse = segments_to_boxes_mm(starts, ends, box[None])[..., 0].reshape(len(distance), len(boxes), -1)
    return np.asarray(np.minimum(distance, np.min(reverse, axis=-1)))


def box_corners(box: Array) -> Array:
    """The eight corners (8, 3) of a box (2, 3)."""
    return np.asarray(np.take_along_axis(box, _CORNERS, axis=0), dtype=float)


def box_edges(box: Array) -> Array:
    """The ends (12, 2, 3) of the edges of a box (2, 3)."""
    return np.asarray(box_corners(box)[_EDGES])


def _outside(points: Array, boxes: Array) -> Array:
    """From the nearest point of each box to the points."""
    low, high = boxes[..., 0, :], boxes[..., 1, :]
    return np.asarray(np.maximum(points - high, 0) - np.maximum(low - points, 0))
