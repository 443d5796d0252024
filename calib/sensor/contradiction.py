"""Which views' stripes the others contradict: each view's stripe, and every few of them, taken out of the one bundle.

A stripe that lies elsewhere (its board moved after the picture without it) bends the plane of all, so that every view
seems off, and its error would count as the noise that all have. Here the noise is that of the views which stay.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import combinations
from math import comb

import numpy as np
from numpy.typing import NDArray

from calib.engine import Result
from calib.sensor.bundle import SensorBundle
from calib.sensor.condensed import PLANE_FREEDOM, STRIPE_FREEDOM, condensed_stripes
from calib.sensor.noise import with_noise
from calib.sensor.valley import settled

Array = NDArray[np.float64]
Index = NDArray[np.intp]

CHANCE = 1e-4  # of a set without fault in which any stripe is thought to contradict the others
MAX_SETS = 5000  # of stripes that are taken out together
_LEAST_DOF = 3  # of what stays: two stripes alone always agree to one number


@dataclass(frozen=True, eq=False)
class StripeContradiction:
    """Views whose stripes the others contradict.

    Parameters
    ----------
    views : ndarray (K,)
        Their indices, the worst first.
    off_px : ndarray (K,)
        How far along its normal each stripe lies from where the others expect it.
    """

    views: Index
    off_px: Array


def contradicting_stripes(bundle: SensorBundle, result: Result, most: int) -> StripeContradiction | None:
    """The smallest set of at most ``most`` stripes that the others contradict, None where none do.

    Of all sets of one size that one counts without which the rest agree best; it is tested by an F test of what it
    saves, at the common error that the rest show, with the number of sets in the bound on chance.
    """
    stripes = condensed_stripes(bundle, result)
    count = len(stripes.view)
    spread = stripes.common_error()
    for k in range(1, most + 1):
        dof = STRIPE_FREEDOM * (count - k) - PLANE_FREEDOM
        if dof < _LEAST_DOF or comb(count, k) > MAX_SETS:
            break
        sets = np.array(list(combinations(range(count), k)))
        out = sets[int(np.argmin(stripes.deviance(spread, sets)))]
        kept = np.ones(count, dtype=bool)
        kept[out] = False
        own = stripes.common_error(kept)
        every, rest = (float(stripes.deviance(own, s[None])[0]) for s in (out[:0], out))
        ratio = (every - rest) / (STRIPE_FREEDOM * k)
        if _chance(ratio, STRIPE_FREEDOM * k, dof) * comb(count, k) < CHANCE:
            off = stripes.predicted(own, kept)[out]
            order = np.argsort(-np.linalg.norm(off, axis=1), kind="stable")
            return StripeContradiction(stripes.view[out][order], np.linalg.norm(off, axis=1)[order])
    return None


def common_error_px(bundle: SensorBundle, result: Result) -> float:
    """How far [px] whole stripes lie from where boards and plane meet, beyond their own noise, root mean square.

    The corners' σ is that of the boards alone: stripes that contradict few boards bend the boards' poses too.
    """
    boards = bundle.without_stripes()
    scale = with_noise(boards, settled(boards, result.state)).corner_scale
    stripes = condensed_stripes(replace(bundle, corner_scale=min(scale, bundle.corner_scale)), result)
    return stripes.common_error()


def _chance(ratio: float, above: int, below: int) -> float:
    """That a ratio of mean squares with these degrees of freedom is larger."""
    from geometry.special import fdtrc  # a tenth of a second, and most commands need none of it

    return float(fdtrc(above, below, max(ratio, 0.0)))
