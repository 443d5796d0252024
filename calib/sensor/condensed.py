"""Every view's stripe condensed to two numbers against its board and the plane: a shift and a turn.

In them the corners, the plane and what all stripes have in common can be weighed in closed form: which stripes the
others contradict, and by how much whole stripes are off beyond their own noise, follow from them.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.engine import Result, scaled_solve
from calib.sensor.bundle import SensorBundle
from calib.sensor.left_out import pose_eliminated, rows_by_term

Array = NDArray[np.float64]
Index = NDArray[np.intp]

PLANE_FREEDOM = 3
STRIPE_FREEDOM = 2  # a stripe's shift and its turn
_HALVINGS = 60
_AT_ONCE = 200  # sets that are solved together: their matrices' memory


@dataclass(frozen=True, eq=False)
class CondensedStripes:
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
        weight = np.linalg.inv(self.own + common_px**2 * np.eye(STRIPE_FREEDOM))
        weighed = np.swapaxes(self.by, 1, 2) @ weight
        square = np.einsum("vi,vij,vj->v", self.value, weight, self.value)
        return weighed @ self.by, (weighed @ self.value[..., None])[..., 0], square

    def deviance(self, common_px: float, without: Index) -> Array:
        """Least squares (S,) of the stripes that stay, one for every row (K,) of indices that are taken out."""
        if len(without) > _AT_ONCE:
            parts = (without[i : i + _AT_ONCE] for i in range(0, len(without), _AT_ONCE))
            return np.concatenate([self.deviance(common_px, part) for part in parts])
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

    def common_error(self, kept: NDArray[np.bool_] | None = None, by_chance: float = 0.0) -> float:
        """The common error [px] at which the ``kept`` stripes scatter as they should; 0 where their own σ are enough.

        by_chance: standard deviations of χ² that count as enough.

        References
        ----------
        Paule & Mandel, J. Res. NBS 87 (1982) 377.
        """
        kept = np.ones(len(self.view), dtype=bool) if kept is None else kept
        out = np.flatnonzero(~kept)[None]
        dof = STRIPE_FREEDOM * int(kept.sum()) - PLANE_FREEDOM
        if dof < 1 or self.deviance(0.0, out)[0] <= dof + by_chance * np.sqrt(2 * dof):
            return 0.0
        low, high = 0.0, float(np.abs(self.value).max() * np.sqrt(2 * len(self.value)))
        for _ in range(_HALVINGS):
            middle = (low + high) / 2
            low, high = (middle, high) if self.deviance(middle, out)[0] > dof else (low, middle)
        return high


def condensed_stripes(bundle: SensorBundle, result: Result) -> CondensedStripes:
    """Every stripe condensed to shift and turn, its board's pose by its corners; of the bundle's noise without offset.

    The state of ``result`` needs to be near a solution only: the corners are taken to be linear from there.
    """
    alone = replace(bundle, stripe_noise=replace(bundle.stripe_noise, offset_px=0.0))
    rows = rows_by_term(alone, result)
    u = result.unknowns
    weight = u.prior_weight[u.free]
    at = np.concatenate([result.state.vector(b.name) for b in u.common])[u.free]  # priors have their mean at zero
    corners, gradient = np.diag(weight), weight * at
    for v in range(len(bundle.views)):
        boards = pose_eliminated([rows[0].of(v)])
        corners = corners + boards.information
        gradient = gradient + boards.gradient
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
    return CondensedStripes(seen, np.array(value), np.array(by), np.array(own), corners)
