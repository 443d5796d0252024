"""The model of a spot: one oriented Gaussian on a sloped background. Nothing else knows its shape.

A pixel (x columns, y rows from the spot's centre u, v; i, j from the window's first pixel) has the mean

    μ = A exp(-½ (a x² + 2 h x y + c y²)) + b + p i + q j.

[a h; h c] is the inverse of (the spot's covariance + I/12): adding a pixel's own variance 1/12 is its integration,
right to the fourth order in pixel/σ. The form has no angle, so that round spots are not singular.

The derivatives by the parameters are combinations of the terms g · (1, x, y, x²/2, xy, y²/2), 1, i, j with g the bell:
a step in the space of these terms is `moved` back to parameters. `extraction.spots.bound` is deliberately not made of
this: it is the truth by quadrature that tests hold against it.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Records = NDArray[np.void]

# the terms are the bell (the first six) or one, times x^POWER_X y^POWER_Y FACTOR
BELLS, FLAT, SLOPED = 6, 7, 9  # how many: with the bell; with a constant background; with a sloped one
POWER_X = np.array([0, 1, 0, 2, 1, 0, 0, 1, 0])
POWER_Y = np.array([0, 0, 1, 0, 1, 2, 0, 0, 1])
FACTOR = np.array([1.0, 1.0, 1.0, 0.5, 1.0, 0.5, 1.0, 1.0, 1.0])
BY_U, BY_V = 1, 2  # the terms that move the centre
PIXEL_VARIANCE_PX2 = 1.0 / 12.0  # of a uniform pixel
MIN_VARIANCE_PX2 = 0.03  # narrower than any lens images: one pixel's spike
MAX_STEP_PX = 1.0  # the quadratic form holds for a spot's width, not farther
HEIGHT_FACTORS = (0.3, 3.0)  # of one step: height and widths move by factors, and stay positive


class Spot(NamedTuple):
    """Parameters: centre u, v [px] from the window's first pixel; height over the background [DN]; precision a, h, c
    [1/px²]; background at that pixel [DN] and its slopes [DN/px].
    """

    u: float
    v: float
    height: float
    a: float
    h: float
    c: float
    level: float
    slope_u: float
    slope_v: float


SPOT = np.dtype([(name, np.float64) for name in Spot._fields])


@kernel
def spot_of(record: Any) -> Spot:
    """The spot of one record of a SPOT array."""
    return Spot(
        record.u, record.v, record.height, record.a, record.h, record.c, record.level, record.slope_u, record.slope_v
    )


@kernel
def distance2(spot: Spot, x: float, y: float) -> float:
    """Squared distance from the centre in the spot's own widths, of the point x, y from it."""
    return spot.a * x * x + 2.0 * spot.h * x * y + spot.c * y * y


@kernel
def background(spot: Spot, i: float, j: float) -> float:
    """What the pixel would have without the spot [DN]."""
    return spot.level + spot.slope_u * i + spot.slope_v * j


@kernel
def precision(uu: float, uv: float, vv: float) -> tuple[float, float, float]:
    """(a, h, c) of a covariance, that of the pixel included."""
    det = uu * vv - uv * uv
    return vv / det, -uv / det, uu / det


@kernel
def centre_by_terms(spot: Spot) -> tuple[float, float, float]:
    """The symmetric matrix (uu, uv, vv) that takes the coefficients of the terms BY_U, BY_V to a step of the centre."""
    det = (spot.a * spot.c - spot.h * spot.h) * spot.height
    return spot.c / det, -spot.h / det, spot.a / det


@kernel
def long_axis(spot: Spot) -> tuple[float, float, float]:
    """Cosine and sine of the direction of the long axis, and the inverse of the width along it [1/px]."""
    angle = 0.5 * math.atan2(-2.0 * spot.h, spot.c - spot.a)  # the small eigenvalue of the precision
    cosine, sine = math.cos(angle), math.sin(angle)
    along2 = spot.a * cosine**2 + 2.0 * spot.h * cosine * sine + spot.c * sine**2
    return cosine, sine, math.sqrt(max(along2, 1e-12))


@kernel
def seen_from(spot: Spot, left: int, top: int) -> Spot:
    """The same spot in a window that begins at the pixel (left, top)."""
    return Spot(
        spot.u - left, spot.v - top, spot.height, spot.a, spot.h, spot.c,
        spot.level + spot.slope_u * left + spot.slope_v * top, spot.slope_u, spot.slope_v,
    )  # fmt: skip


@kernel
def moved(spot: Spot, q: Array, n: int) -> tuple[bool, Spot]:
    """The spot after the step q (n,) of the terms' coefficients; False where it is no spot any more."""
    uu, uv, vv = centre_by_terms(spot)
    du, dv = uu * q[1] + uv * q[2], uv * q[1] + vv * q[2]
    if not abs(du) + abs(dv) < np.inf:
        return False, spot
    scale = min(1.0, MAX_STEP_PX / max(abs(du), abs(dv), 1e-12))
    share = scale / spot.height
    height = spot.height * min(max(1.0 + share * q[0], HEIGHT_FACTORS[0]), HEIGHT_FACTORS[1])
    a, h, c = spot.a - share * q[3], spot.h - share * q[4], spot.c - share * q[5]
    level, slope_u, slope_v = spot.level + scale * q[6], spot.slope_u, spot.slope_v
    if n == SLOPED:  # the slopes' terms are about the spot's centre
        level -= scale * (q[7] * spot.u + q[8] * spot.v)
        slope_u += scale * q[7]
        slope_v += scale * q[8]
    new = Spot(spot.u + scale * du, spot.v + scale * dv, height, a, h, c, level, slope_u, slope_v)
    is_spot = height > 0.0 and a > 0.0 and a * c - h * h > 0.0
    return is_spot and a + c < 2.0 / (MIN_VARIANCE_PX2 + PIXEL_VARIANCE_PX2), new


def shapes_px2(spots: Records) -> Array:
    """Covariance (N, 2, 2) of the light of spots (N,), the pixel's own share taken off."""
    a, h, c = spots["a"], spots["h"], spots["c"]
    shape = np.stack([c, -h, -h, a], axis=1) / (a * c - h * h)[:, None]
    shape[:, ::3] -= PIXEL_VARIANCE_PX2
    return np.asarray(shape.reshape(-1, 2, 2))
