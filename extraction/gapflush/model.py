"""What a section sees of a rounded edge through the blur: the light from beside it counts as well.

A section at distance δ from another, in pixels of the image, sees the surface there displaced by t(δ). Blur of σ adds
their light with weights G(δ) I(δ), so that the section's peak lies at ∫ G I t / ∫ G I, its variance grows by that of
t, and its light is ∫ G I. On a matte surface a sheet that falls along the camera's view lights each section by I =
cos² / |n·e|, n the surface's normal, e the section's direction: it falls to nothing where the bend turns away.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]

MEAN, SPREAD, LIGHT, BEYOND, TURN = range(5)  # columns of what `edge_light` gives
_REACH, _NODES = 3.5, 43  # of the blur, in σ; nodes over it
_LEAST_SINE = 0.01  # of a section against the surface: a grazing one sees no end of it


@kernel
def edge_light(p: Array, at: Array, along: Array, across: Array, view: Array, blur: float) -> Array:
    """What sections see of a face with a bend: (N, 5) = displacement, variance [px, px²], light, beyond, angle.

    p: (angle, offset, tangent, radius) as in `PanelEdge`; at, along, across, view: points and directions (N, 2) in the
    frame of the face. blur: σ of the image's blur [px]. displacement: from the point to where the section's light
    lies. light: relative. beyond: share that a flank behind the bend's end would have. angle: of the surface [rad].
    """
    out = np.zeros((len(at), 5))
    c, s = math.cos(p[0]), math.sin(p[0])
    for i in range(len(at)):
        x, y = c * at[i, 0] + s * at[i, 1], c * at[i, 1] - s * at[i, 0] - p[1]
        ex, ey = c * along[i, 0] + s * along[i, 1], c * along[i, 1] - s * along[i, 0]
        ax, ay = c * across[i, 0] + s * across[i, 1], c * across[i, 1] - s * across[i, 0]
        vx, vy = c * view[i, 0] + s * view[i, 1], c * view[i, 1] - s * view[i, 0]
        length = math.hypot(ex, ey)
        weight, first, second, lost = 0.0, 0.0, 0.0, 0.0
        for k in range(_NODES):
            node = _REACH * (2.0 * k / (_NODES - 1) - 1.0)
            qx, qy = x + node * blur * ax, y + node * blur * ay
            t = -qy / ey
            cosine, sine = vy, abs(ey) / length
            if qx + t * ex > p[2]:
                dx, dy = qx - p[2], qy - p[3]
                b, q = dx * ex + dy * ey, dx * dx + dy * dy - p[3] * p[3]
                root = b * b - length * length * q
                t = (-b - math.sqrt(max(root, 0.0))) / (length * length)
                nx, ny = (dx + t * ex) / p[3], (dy + t * ey) / p[3]
                cosine, sine = -(nx * vx + ny * vy), abs(nx * ex + ny * ey) / length
                if root <= 0 or nx < 0 or ny > 0:  # past the end of the bend
                    lost += math.exp(-0.5 * node * node)
                    continue
            if cosine > 0:
                w = math.exp(-0.5 * node * node) * cosine * cosine / max(sine, _LEAST_SINE)
                weight, first, second = weight + w, first + w * t, second + w * t * t
        flank = lost * max(-vx, 0.0) ** 2
        if weight > 0:
            out[i, MEAN] = first / weight
            out[i, SPREAD] = second / weight - out[i, MEAN] ** 2
            out[i, LIGHT] = weight * 2 * _REACH / (_NODES - 1) / math.sqrt(2 * math.pi)
        out[i, BEYOND] = flank / max(weight + flank, 1e-12)
        out[i, TURN] = math.asin(min(max((x - p[2]) / p[3], 0.0), 1.0))
    return out
