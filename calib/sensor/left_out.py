"""Views left out one at a time: what the others predict of them, to second order about the common solution.

The solution without a view is one Gauss-Newton step away from that with it; the left-out view's pose is fitted anew to
its corners alone, so that its stripe tells of the plane of the others.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.engine import Result, scaled_solve
from calib.sensor.bundle import SensorBundle
from calib.sensor.terms import BOARD, ResidualRows
from geometry import Unknowns

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BOARD_FREEDOM = 6


@dataclass(frozen=True, eq=False)
class LeftOutViews:
    """Of every view (V,), predicted by the others.

    Parameters
    ----------
    corner_px : ndarray (V,)
        Root mean square reprojection error of its corners.
    corner_deviance : ndarray (V,)
        Squared whitened reprojection errors.
    corner_dof : ndarray (V,)
        Their number less the pose's six.
    stripe_mm : ndarray (V,)
        Root mean square distance of its stripe's points from the plane; NaN where there is no stripe.
    stripe_deviance : ndarray (V,)
        Squared whitened distances.
    offset_px, offset_sigma_px : ndarray (V,)
        Weighted mean of the stripe's errors along its normal and its standard deviation.
    corner_count, stripe_count : ndarray (V,)
        How many corners and stripe points.
    surprise : ndarray (V,)
        Minus twice the log of the density that the others predict for its corners and stripe together, up to what is
        alike for all models: what the others do not know of the camera and the plane is in it, so that a stripe that is
        predicted badly because little is known of it does not decide between models.
    """

    corner_px: Array
    corner_deviance: Array
    corner_dof: Array
    stripe_mm: Array
    stripe_deviance: Array
    offset_px: Array
    offset_sigma_px: Array
    corner_count: Array
    stripe_count: Array
    surprise: Array

    @property
    def reprojection_rms_px(self) -> float:
        """Over all views."""
        return float(np.sqrt(np.sum(self.corner_px**2 * self.corner_count) / np.sum(self.corner_count)))

    @property
    def plane_rms_mm(self) -> float:
        """Over all views with a stripe."""
        seen = self.stripe_count > 0
        total = np.sum(self.stripe_count[seen])
        return float(np.sqrt(np.sum(self.stripe_mm[seen] ** 2 * self.stripe_count[seen]) / total)) if total else np.nan


def left_out(bundle: SensorBundle, result: Result) -> LeftOutViews:
    """What the others predict of each view."""
    u, views = result.unknowns, bundle.views
    free = u.free
    rows = rows_by_term(bundle, result)
    corners = bundle.corner_term.errors(result.state)
    by_corner = common_columns(corners.jacobian, u, free)
    raw = bundle.stripe_term.distances(result.state) if bundle.has_plane else None
    reduced = [pose_eliminated([r.of(v) for r in rows]) for v in range(len(views))]
    hessian = sum((s.information for s in reduced), np.diag(u.prior_weight[free]))
    ones = bundle.stripe_term.independent(np.ones((len(raw.residual), 1)))[:, 0] if raw is not None else None
    table = np.full((len(views), 10), np.nan)
    for v, own in enumerate(reduced):
        rest = hessian - own.information
        step = scaled_solve(rest, own.gradient)  # of the common unknowns: the others' gradient is minus this view's
        table[v, 9] = _surprise(own, rest, step)
        a, b, r = rows[0].of(v)
        moved = r + a @ step
        pose = np.linalg.lstsq(b, -moved, rcond=None)[0]
        white = moved + b @ pose
        mine = views.view_of_corner == v
        pixels = corners.residual[mine] + by_corner[mine] @ step + corners.jacobian[BOARD][mine] @ pose
        n = int(mine.sum())
        table[v, :3] = np.sqrt(np.mean(np.sum(pixels**2, axis=1))), white @ white, 2 * n - BOARD_FREEDOM
        table[v, 7:9] = n, 0
        seen = views.view_of_stripe == v
        if raw is not None and ones is not None and np.any(seen):
            a_s, b_s, r_s = rows[1].of(v)
            predicted = r_s + a_s @ step + b_s @ pose
            distance = (
                raw.residual[seen]
                + common_columns(raw.jacobian, u, free)[seen] @ step
                + raw.jacobian[BOARD][seen] @ pose
            )
            one = ones[seen]
            gain = one / (one @ one)  # the mean's weights, for independent rows
            by_pose = gain @ b_s
            from_pose = np.linalg.lstsq(b.T @ b, by_pose, rcond=None)[0]
            by_common = gain @ a_s - (a.T @ b) @ from_pose
            variance = 1 / (one @ one) + by_pose @ from_pose + by_common @ scaled_solve(rest, by_common)
            table[v, 3:7] = (
                np.sqrt(np.mean(distance**2)),
                predicted @ predicted,
                gain @ predicted,
                np.sqrt(max(float(variance), 0.0)),
            )
            table[v, 8] = seen.sum()
    return LeftOutViews(*table.T)


@dataclass(frozen=True, eq=False)
class WhiteRows:
    """Whitened rows by the free common unknowns (R, C) and the pose (R, 6), residuals (R,), and whose view each is."""

    common: Array
    pose: Array
    residual: Array
    view: NDArray[np.intp]

    def of(self, view: int) -> tuple[Array, Array, Array]:
        """The rows of one view."""
        mine = self.view == view
        return self.common[mine], self.pose[mine], self.residual[mine]


def rows_by_term(bundle: SensorBundle, result: Result) -> list[WhiteRows]:
    """The rows of corners and, where any was seen, of stripes."""
    u = result.unknowns
    return [_rows(term.independent_rows(result.state), u, u.free) for term in bundle.evidence]


def _rows(rows: ResidualRows, unknowns: Unknowns, free: Mask) -> WhiteRows:
    return WhiteRows(common_columns(rows.jacobian, unknowns, free), rows.jacobian[BOARD], rows.residual, rows.view)


def common_columns(jacobian: dict[str, Array], unknowns: Unknowns, free: Mask) -> Array:
    """Columns (…, C) by the free common unknowns."""
    shape = jacobian[BOARD].shape[:-1]
    columns = [jacobian.get(b.name, np.zeros((*shape, b.size))) for b in unknowns.common]
    return np.asarray(np.concatenate(columns, -1)[..., free])


@dataclass(frozen=True, eq=False)
class Reduced:
    """A view's squared residuals as a quadratic in the common unknowns, its pose eliminated: r·r + 2 g·x + x·A·x."""

    information: Array
    gradient: Array
    square: float


def pose_eliminated(parts: list[tuple[Array, Array, Array]]) -> Reduced:
    """Of rows (a, b, r) by the common unknowns and by the pose."""
    a, b, r = (np.concatenate(p) for p in zip(*parts, strict=True))
    q = np.linalg.qr(b)[0]
    a, r = a - q @ (q.T @ a), r - q @ (q.T @ r)
    return Reduced(a.T @ a, a.T @ r, float(r @ r))


def _surprise(own: Reduced, rest: Array, step: Array) -> float:
    """Minus twice the log density of a view's residuals (R,) with covariance I + a rest⁻¹ aᵀ, less R log 2π.

    By the matrix inversion and determinant lemmas, so that no matrix of the residuals' size appears.
    """
    moved = own.gradient + own.information @ step  # by the unknowns, where the others expect them
    square = own.square + own.gradient @ step + moved @ step
    both = rest + own.information
    scale = 1 / np.sqrt(np.maximum(np.diag(both), 1e-300))
    (s, log_both), (t, log_rest) = (np.linalg.slogdet(m * np.outer(scale, scale)) for m in (both, rest))
    if s <= 0 or t <= 0:
        return float("inf")  # without this view a direction is open
    return float(square - moved @ scaled_solve(both, moved) + log_both - log_rest)
