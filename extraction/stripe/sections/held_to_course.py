"""Points that lie off their stripe's course among a crowd of other ridges: a print's border under it pulls at them."""

from __future__ import annotations

import math

import numpy as np

from extraction.order import median_of, positions_of
from extraction.stripe.sections.model import Array, Mask, Records
from extraction.stripe.view import IntArray
from geometry.compiled import kernel

_REACH = 40  # points on either side, that give the course: some squares
_ROUNDS = 4  # of a line, and of what lies farther off than it should
_KEPT = 2.0  # times the median distance from the line, to which points stay
# off the course: times a point's σ, and of the stripe's own: beyond, an edge under the stripe has moved it
_OFF, _OFF_WIDTHS = 3.0, 0.25


@kernel
def off_course(section: IntArray, course: IntArray, fits: Records, good: Mask) -> Mask:
    """Which fits (N,) lie off the line through most of the good ones about them, course by course; all if none is."""
    courses, every, own = 0, np.empty(len(section), np.int64), np.empty(len(section), np.int64)
    for k in course:
        courses = max(courses, k + 1)
    x, y, off = np.empty(2 * _REACH), np.empty(2 * _REACH), np.empty(2 * _REACH)
    away = np.ones(len(section), np.bool_)
    for k in range(courses):
        total, n = positions_of(course, k, every), 0
        for i in every[:total]:
            if good[i]:
                own[n] = i
                n += 1
        at = 0
        for i in every[: total if n else 0]:
            while at < n and own[at] < i:
                at += 1
            low, high = max(at - _REACH, 0), min(at + _REACH, n)
            for m in range(low, high):
                x[m - low], y[m - low] = section[own[m]] - section[i], fits[own[m]].centre
            far = abs(fits[i].centre - _course(x[: high - low], y[: high - low], off))
            away[i] = not far <= max(_OFF * math.sqrt(fits[i].variance), _OFF_WIDTHS * fits[i].width)
    return away


@kernel
def _course(x: Array, y: Array, off: Array) -> float:
    """Where the line through most of the points (n,) is at x = 0."""
    n, limit, level, slope = len(x), np.inf, 0.0, 0.0
    for i in range(n):
        off[i] = 0.0
    for _ in range(_ROUNDS):
        count = sx = sy = sxx = sxy = 0.0
        for i in range(n):
            if off[i] <= limit:
                count, sx, sy = count + 1, sx + x[i], sy + y[i]
                sxx, sxy = sxx + x[i] * x[i], sxy + x[i] * y[i]
        bend = count * sxx - sx * sx
        slope = (count * sxy - sx * sy) / bend if bend > 0 else 0.0
        level = (sy - slope * sx) / count
        for i in range(n):
            off[i] = abs(y[i] - level - slope * x[i])
        limit = _KEPT * median_of(off, 0, n)
    return level
