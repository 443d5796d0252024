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
_DARK = 1e-9  # of light: below, a section sees nothing
# the bend's quadrature: a panel of four Gauss-Legendre nodes for each σ of the blur along it, few at least; where the
# blur's weight is nothing it is left out. Its ends are the bend's own, so that no node comes or goes with a parameter
_PANEL, _FEWEST, _REACH = 1.5, 3, 5.0
_NODES = (-0.8611363115940526, -0.3399810435848563, 0.3399810435848563, 0.8611363115940526)
_WEIGHTS = (0.34785484513745385, 0.6521451548625461, 0.6521451548625461, 0.34785484513745385)


@kernel
def edge_light(p: Array, at: Array, along: Array, across: Array, view: Array, blur: float) -> Array:
    """What sections see of a face with a bend: (N, 5) = displacement, variance [px, px²], light, beyond, angle.

    p: (angle, offset, tangent, radius) as in `PanelEdge`; at, along, across, view: points and directions (N, 2) in the
    frame of the face. blur: σ of the image's blur [px]. displacement: from the point to where the section's light
    lies. light: relative. beyond: share that a flank behind the bend's end would have. angle: of the surface [rad].

    Places are δ · across + t · along from the point. On the face t is linear in δ, and its moments are those of a
    Gaussian cut at the tangent. On the bend the integral runs over its angle φ, from 0 to where the surface turns away
    from section or camera, or has turned by 90°: dδ / |n·e| = r |e| / |a × e| dφ.
    """
    out = np.zeros((len(at), 5))
    c, s = math.cos(p[0]), math.sin(p[0])
    for i in range(len(at)):
        x, y = c * at[i, 0] + s * at[i, 1], c * at[i, 1] - s * at[i, 0] - p[1]
        ex, ey = c * along[i, 0] + s * along[i, 1], c * along[i, 1] - s * along[i, 0]
        ax, ay = c * across[i, 0] + s * across[i, 1], c * across[i, 1] - s * across[i, 0]
        vx, vy = c * view[i, 0] + s * view[i, 1], c * view[i, 1] - s * view[i, 0]
        area = ax * ey - ay * ex
        if area < 0:  # δ grows towards the gap
            ax, ay, area = -ax, -ay, -area
        length = math.hypot(ex, ey)
        z = ((p[2] - x) * ey + y * ex) / area / blur  # of the tangent
        inside, density = 0.5 * math.erfc(-z / math.sqrt(2)), math.exp(-0.5 * z * z) / math.sqrt(2 * math.pi)
        t0, t1 = -y / ey, -ay / ey * blur
        bright = vy * vy * length / abs(ey)
        weight, first = bright * inside, bright * (t0 * inside - t1 * density)
        second = bright * (t0 * t0 * inside - 2 * t0 * t1 * density + t1 * t1 * (inside - z * density))
        lost = 0.0
        if z < _REACH:
            last = 0.5 * math.pi
            if ex > 0:
                last = min(last, math.atan2(ey, ex))
            if vx > 0:
                last = min(last, math.atan2(vy, vx))
            end = ((p[2] + p[3] * math.sin(last) - x) * ey - (p[3] * (1 - math.cos(last)) - y) * ex) / area / blur
            lost = 0.5 * math.erfc(end / math.sqrt(2))
            panels = max(_FEWEST, math.ceil(last * p[3] / (_PANEL * blur * math.hypot(ax, ay))))
            half = 0.5 * last / panels
            scale = half * p[3] * length / (area * blur * math.sqrt(2 * math.pi))
            before = z
            for k in range(panels):
                turn = 2 * (k + 1) * half
                dx, dy = p[2] + p[3] * math.sin(turn) - x, p[3] * (1 - math.cos(turn)) - y
                if dx * ey - dy * ex < -_REACH * area * blur:  # the whole panel lies before what the blur reaches
                    continue
                if before > _REACH:
                    break
                for j in range(4):
                    turn = (2 * k + 1 + _NODES[j]) * half
                    nx, ny = math.sin(turn), math.cos(turn)
                    dx, dy = p[2] + p[3] * nx - x, p[3] * (1 - ny) - y
                    place = (dx * ey - dy * ex) / area / blur
                    cosine = ny * vy - nx * vx
                    w = _WEIGHTS[j] * scale * math.exp(-0.5 * place * place) * cosine * cosine
                    t = (ax * dy - ay * dx) / area
                    weight, first, second = weight + w, first + w * t, second + w * t * t
                before = place
        flank = lost * max(-vx, 0.0) ** 2
        if weight > _DARK:
            out[i, MEAN] = first / weight
            out[i, SPREAD] = second / weight - out[i, MEAN] ** 2
            out[i, LIGHT] = weight
        out[i, BEYOND] = flank / max(weight + flank, 1e-12)
        out[i, TURN] = math.asin(min(max((x - p[2]) / p[3], 0.0), 1.0))
    return out
