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

from calib.engine import Result, scaled_solve
from calib.sensor.bundle import SensorBundle
from calib.sensor.left_out import pose_eliminated, rows_by_term
from calib.sensor.noise import with_noise
from calib.sensor.terms import PLANE

Array = NDArray[np.float64]
Index = NDArray[np.intp]

CHANCE = 1e-4  # of a set without fault in which any stripe is thought to contradict the others
MAX_SETS = 5000  # of stripes that are taken out together
_PLANE_FREEDOM = 3
_VIEW_FREEDOM = 2  # a stripe's shift and its turn
_LEAST_DOF = 3  # of what stays: two stripes alone always agree to one number
_HALVINGS = 60


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
    stripes = _stripes(bundle, result)
    count = len(stripes.view)
    spread = stripes.common_error(np.ones(count, dtype=bool))
    for k in range(1, most + 1):
        dof = _VIEW_FREEDOM * (count - k) - _PLANE_FREEDOM
        if dof < _LEAST_DOF or comb(count, k) > MAX_SETS:
            break
        sets = np.array(list(combinations(range(count), k)))
        out = sets[int(np.argmin(stripes.deviance(spread, sets)))]
        kept = np.ones(count, dtype=bool)
        kept[out] = False
        own = stripes.common_error(kept)
        every, rest = (float(stripes.deviance(own, s[None])[0]) for s in (out[:0], out))
        ratio = (every - rest) / (_VIEW_FREEDOM * k)
        if _chance(ratio, _VIEW_FREEDOM * k, dof) * comb(count, k) < CHANCE:
            off = stripes.predicted(own, kept)[out]
            order = np.argsort(-np.linalg.norm(off, axis=1), kind="stable")
            return StripeContradiction(stripes.view[out][order], np.linalg.norm(off, axis=1)[order])
    return None


def common_error_px(bundle: SensorBundle, result: Result) -> float:
    """How far [px] whole stripes lie from where boards and plane meet, beyond their own noise, root mean square.

    The corners' σ is that of the boards alone: stripes that contradict few boards bend the boards' poses too.
    """
    boards = bundle.without_stripes()
    scale = with_noise(boards, boards.settle(result.state)).corner_scale
    stripes = _stripes(replace(bundle, corner_scale=min(scale, bundle.corner_scale)), result)
    return stripes.common_error(np.ones(len(stripes.view), dtype=bool))


def _chance(ratio: float, above: int, below: int) -> float:
    """That a ratio of mean squares with these degrees of freedom is larger."""
    from scipy.special import fdtrc  # a tenth of a second, and most commands need none of it

    return float(fdtrc(above, below, max(ratio, 0.0)))


@dataclass(frozen=True, eq=False)
class _Stripes:
    """Shift and turn [px] of every stripe against its board and the plane, as linear in the common unknowns x.

    Given x they are value + by · x with covariance own, and one more that all views have alike. The corners say
    x ~ N(0, corners⁻¹), the plane in x open. view (V,): whose stripes they are.
    """

    view: Index
    value: Array
    by: Array
    own: Array
    corners: Array

    def _information(self, common_px: float) -> tuple[Array, Array, Array]:
        """Of every stripe on x: information (V, P, P), gradient (V, P) and square (V,)."""
        weight = np.linalg.inv(self.own + common_px**2 * np.eye(_VIEW_FREEDOM))
        weighed = np.swapaxes(self.by, 1, 2) @ weight
        square = np.einsum("vi,vij,vj->v", self.value, weight, self.value)
        return weighed @ self.by, (weighed @ self.value[..., None])[..., 0], square

    def deviance(self, common_px: float, without: Index) -> Array:
        """Least squares (S,) of the stripes that stay, one for every row (K,) of indices that are taken out."""
        information, gradient, square = self._information(common_px)
        left = self.corners + information.sum(axis=0) - information[without].sum(axis=1)
        g = gradient.sum(axis=0) - gradient[without].sum(axis=1)
        scale = 1 / np.sqrt(np.maximum(np.diag(self.corners + information.sum(axis=0)), 1e-300))
        scaled = left * np.outer(scale, scale)
        solved = np.linalg.solve(scaled, (g * scale)[..., None])[..., 0]
        return np.asarray(square.sum() - square[without].sum(axis=1) - np.sum(solved * g * scale, axis=1))

    def predicted(self, common_px: float, kept: NDArray[np.bool_]) -> Array:
        """Shift and turn (V, 2) of every stripe at the x that the corners and the ``kept`` stripes give."""
        information, gradient, _ = self._information(common_px)
        x = -scaled_solve(self.corners + information[kept].sum(axis=0), gradient[kept].sum(axis=0))
        return np.asarray(self.value + self.by @ x)

    def common_error(self, kept: NDArray[np.bool_]) -> float:
        """The common error [px] at which the ``kept`` stripes scatter as they should; 0 where their own σ are enough.

        References
        ----------
        Paule & Mandel, J. Res. NBS 87 (1982) 377.
        """
        out = np.flatnonzero(~kept)[None]
        dof = _VIEW_FREEDOM * int(kept.sum()) - _PLANE_FREEDOM
        if dof < 1 or self.deviance(0.0, out)[0] <= dof:
            return 0.0
        low, high = 0.0, float(np.abs(self.value).max() * np.sqrt(2 * len(self.value)))
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if self.deviance(middle, out)[0] > dof else (low, middle)
        return high


def _stripes(bundle: SensorBundle, result: Result) -> _Stripes:
    """Every stripe condensed to shift and turn, its board's pose by its corners."""
    every = rows_by_term(bundle, result)
    alone = replace(bundle, stripe_noise=replace(bundle.stripe_noise, offset_px=0.0))
    rows = rows_by_term(alone, result)
    weight = result.unknowns.prior_weight[result.unknowns.free]
    corners = np.diag(weight)
    # of the corners and the priors together: at the solution the priors' gradient is minus that of all rows
    gradient = np.zeros(len(weight))
    for v in range(len(bundle.views)):
        boards = pose_eliminated([rows[0].of(v)])
        corners = corners + boards.information
        gradient += boards.gradient - pose_eliminated([r.of(v) for r in every]).gradient
    gradient[_plane_columns(result)] = 0.0
    x = -scaled_solve(corners, gradient)
    seen = np.unique(bundle.views.view_of_stripe)
    common = alone.stripe_term.independent(alone.stripe_term.in_common)
    value, by, own = [], [], []
    for v in seen:
        a, b, r = rows[0].of(v)
        a_s, b_s, r_s = rows[1].of(v)
        shapes = common[rows[1].view == v]
        condensed = np.linalg.lstsq(shapes, np.column_stack([r_s, a_s, b_s]), rcond=None)[0]
        pose = condensed[:, 1 + a.shape[1] :]
        found = np.linalg.lstsq(b, np.column_stack([r, a]), rcond=None)[0]  # minus the pose that the corners give
        by.append(condensed[:, 1 : 1 + a.shape[1]] - pose @ found[:, 1:])
        value.append(condensed[:, 0] - pose @ found[:, 0] + by[-1] @ x)
        noise = np.linalg.inv(shapes.T @ shapes) + pose @ scaled_solve(b.T @ b, pose.T)
        own.append((noise + noise.T) / 2)
    return _Stripes(seen, np.array(value), np.array(by), np.array(own), corners)


def _plane_columns(result: Result) -> NDArray[np.bool_]:
    """Which of the free common unknowns are the plane's (P,)."""
    u = result.unknowns
    plane = np.zeros(u.size, dtype=bool)
    plane[u[PLANE]] = True
    return plane[u.free]
