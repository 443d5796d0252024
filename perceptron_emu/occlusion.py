"""What stands between two points: the strings."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from perceptron_emu.strings import Cylinders

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def hidden_by_strings(strings: Cylinders, points: Array, sources: Array, own: NDArray[np.int64] | None = None) -> Mask:
    """Whether a string stands between points (N, 3) and sources (N, 3) or (3,) [mm]; exact, ends not capped.

    own: for points on strings, which one each lies on (N,); it does not hide them.
    """
    points = np.array(points, dtype=float, order="C")
    sources = np.array(np.broadcast_to(sources, points.shape), dtype=float, order="C")
    own = np.full(len(points), -1) if own is None else np.array(own, dtype=np.int64)
    lengths = np.array(strings.lengths)
    return np.asarray(
        _hidden(np.array(strings.starts), np.array(strings.directions), lengths, strings.radius, points, sources, own)
    )


@kernel(fastmath=True)
def _hidden(starts, directions, lengths, radius, points, sources, own):  # type: ignore[no-untyped-def]
    out = np.zeros(len(points), np.bool_)
    for i in range(len(points)):
        rx, ry, rz = sources[i, 0] - points[i, 0], sources[i, 1] - points[i, 1], sources[i, 2] - points[i, 2]
        for j in range(len(starts)):
            if j == own[i]:
                continue
            dx, dy, dz = directions[j, 0], directions[j, 1], directions[j, 2]
            ox, oy, oz = points[i, 0] - starts[j, 0], points[i, 1] - starts[j, 1], points[i, 2] - starts[j, 2]
            # the shortest distance of the two lines decides almost always
            cx, cy, cz = ry * dz - rz * dy, rz * dx - rx * dz, rx * dy - ry * dx
            across = cx * cx + cy * cy + cz * cz
            apart = ox * cx + oy * cy + oz * cz
            if apart * apart >= radius * radius * across:
                continue
            ray_along, off_along = rx * dx + ry * dy + rz * dz, ox * dx + oy * dy + oz * dz
            b = rx * ox + ry * oy + rz * oz - ray_along * off_along
            c = ox * ox + oy * oy + oz * oz - off_along * off_along - radius * radius
            root = math.sqrt(max(b * b - across * c, 0.0))
            for s in ((-b - root) / across, (-b + root) / across):
                height = off_along + s * ray_along
                if 0 < s < 1 and 0 <= height <= lengths[j]:
                    out[i] = True
            if out[i]:
                break
    return out
