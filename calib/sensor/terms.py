"""The two kinds of evidence of a sensor's calibration: corners of boards, and the laser's stripe on them.

Unknowns: "camera" (18, CAMERA_PARAMETERS), "board" the pose T_camera_board of every view, "plane" the vector p (3)
[1/mm] of the laser plane p · X = 1 in the camera's frame; of a board that is not as stated, "bend" its curvatures (3)
[1/mm] and "print" (3 P) the offsets of its corners [mm].
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calib.sensor.lens import project, rays, undistort
from calib.sensor.shape import BEND, PRINT, BoardShape
from calib.sensor.views import BoardViews
from geometry import Linearised, State

Array = NDArray[np.float64]
Index = NDArray[np.intp]

CAMERA, BOARD, PLANE = "camera", "board", "plane"

_NEWTON = 3  # steps to where board and plane meet: doubles digits, from tenths of a pixel
_BENT = 3  # steps along a ray to a bent board, from the plane that touches it: doubles digits, from a millimetre
_ROWS = 16  # of a group: sums over groups are then products of matrices


@dataclass(frozen=True, eq=False)
class StripeNoise:
    """How residuals of stripes scatter.

    Parameters
    ----------
    scale : ndarray (V,) or (1,)
        Their σ over the σ that extraction states, view by view.
    length_px : float
        Over which neighbours' errors are alike (to 1/e); 0 where they are independent.
    offset_px : float
        Standard deviation of what a view's points have in common, a shift and, at their rms distance from the middle,
        a turn: a board that is not flat, a stripe that is drawn aside.
    """

    scale: Array = field(default_factory=lambda: np.ones(1))
    length_px: float = 0.0
    offset_px: float = 0.0


@dataclass(frozen=True, eq=False)
class ResidualRows:
    """Independent residuals (R,) of unit variance with Jacobians (R, n) by block, and whose view each is (R,)."""

    residual: Array
    jacobian: dict[str, Array]
    view: Index

    def linearised(self) -> Linearised:
        """In groups of _ROWS of one view: as independent, and faster to sum than one by one."""
        start = np.flatnonzero(np.diff(self.view, prepend=-1))
        within = np.arange(len(self.view)) - np.repeat(start, np.diff([*start, len(self.view)]))
        group = np.cumsum(within % _ROWS == 0) - 1
        count = int(group[-1]) + 1 if len(group) else 0
        place = (group, within % _ROWS)
        view = np.zeros(count, dtype=np.intp)
        view[group] = self.view

        def laid(rows: Array) -> Array:
            out = np.zeros((count, _ROWS, *rows.shape[1:]), dtype=rows.dtype)
            out[place] = rows
            return out

        jacobian = {name: laid(rows) for name, rows in self.jacobian.items()}
        unit = np.broadcast_to(np.eye(_ROWS), (count, _ROWS, _ROWS))
        return Linearised(laid(self.residual), jacobian, unit, {BOARD: view})


@dataclass(frozen=True, eq=False)
class CornerErrors:
    """Seen less projected, reversed in sign (N, 2) [px], with Jacobians (N, 2, n) by block."""

    residual: Array
    jacobian: dict[str, Array]


@dataclass(frozen=True, eq=False)
class CornerResiduals:
    """Corners of boards: projected less seen, two rows a corner; scale is of their stated σ.

    shape: of what the state's curvatures and offsets are; None where it has none.
    """

    views: BoardViews
    scale: float = 1.0
    shape: BoardShape | None = None

    def linearise(self, state: State) -> Linearised:
        """Reprojection errors in units of their σ."""
        return self.independent_rows(state).linearised()

    def independent_rows(self, state: State) -> ResidualRows:
        """As ``errors``, independent and of unit variance."""
        found = self.errors(state)
        white = self._white
        jacobian = {n: (white @ j).reshape(-1, j.shape[-1]) for n, j in found.jacobian.items()}
        residual = (white @ found.residual[..., None]).reshape(-1)
        return ResidualRows(residual, jacobian, np.repeat(self.views.view_of_corner, 2))

    @cached_property
    def _white(self) -> Array:
        root = np.linalg.cholesky(self.views.corners.covariance_px2) * self.scale
        return np.asarray(np.linalg.inv(root))

    def errors(self, state: State) -> CornerErrors:
        """Reprojection errors as they are [px]."""
        corners, member = self.views.corners, self.views.view_of_corner
        board = state.pose(BOARD)
        R, t = board.R[member], board.t[member]
        p, by_shape = self._on_board(state)
        X = (R @ p[..., None])[..., 0] + t
        xy, by_x = _normalised(X)
        seen = project(state.vector(CAMERA), xy)
        by_place = seen.by_point @ by_x @ R
        jacobian = {CAMERA: seen.by_camera, BOARD: np.concatenate([by_place, np.cross(p[:, None], by_place)], -1)}
        return CornerErrors(
            seen.value - corners.uv_px, jacobian | {name: _by(by_place) for name, _by in by_shape.items()}
        )

    def _on_board(self, state: State) -> tuple[Array, dict[str, Callable[[Array], Array]]]:
        """Where the corners are (N, 3), and what takes Jacobians by it (N, 2, 3) to those by bend and print."""
        xy = self.views.corners.xy_mm
        p = np.concatenate([xy, np.zeros((len(xy), 1))], 1)
        by: dict[str, Callable[[Array], Array]] = {}
        if self.shape is None:
            return p, by
        if BEND in state.values:
            h = self.shape.height(state.vector(BEND), xy)
            lies = self.views.axes[self.views.view_of_corner]
            p = p + (lies * h.z_mm)[:, None] * [0.0, 0.0, 1.0]
            by_bend = lies[:, None, None] * h.by_bend[:, None, :]
            by[BEND] = lambda by_place: by_place[:, :, 2:] * by_bend
        if PRINT in state.values:
            known = np.flatnonzero(self._place >= 0)
            place, count = self._place[known], len(self.shape.corners_mm)
            moved = np.zeros_like(p, dtype=state.vector(PRINT).dtype)
            moved[known] = state.vector(PRINT).reshape(count, 3)[place]
            p = p + moved

            def by_print(by_place: Array) -> Array:
                out = np.zeros((len(xy), 2, count, 3), dtype=by_place.dtype)
                out[known, :, place] = by_place[known]
                return out.reshape(len(xy), 2, 3 * count)

            by[PRINT] = by_print
        return p, by

    @cached_property
    def _place(self) -> Index:
        """Which of the board's corners each is (N,); -1 where that is not known."""
        if self.shape is None:
            return np.full(len(self.views.corners), -1)
        place = self.shape.place(self.views.corners.xy_mm)
        return np.where(self.views.named[self.views.view_of_corner], place, -1)


@dataclass(frozen=True, eq=False)
class StripeErrors:
    """Errors of stripe points (M,) and their Jacobians (M, n) by block; by_pixel (M,): by a shift along the normal."""

    residual: Array
    jacobian: dict[str, Array]
    by_pixel: Array


@dataclass(frozen=True, eq=False)
class MetBoards:
    """Where rays (M,) meet boards.

    reach: how far along them; normal (M, 3): the boards' there, its part along their own z 1; by_bend (M, 3): their
    heights by their curvatures, None where they are flat.
    """

    reach: Array
    normal: Array
    by_bend: Array | None


@dataclass(frozen=True, eq=False)
class StripeOnBoard:
    """The ray through a stripe's centre meets its board's plane in a point of the laser plane: one row a point [px].

    The residual is how far the stripe was seen, along its normal, from where board and laser plane meet. (The distance
    from the plane in millimetres shrinks with the whole scene, and would draw the focal length along.) Rows are carried
    over to independent ones of unit variance: neighbours' errors are alike along the stripe (a first order
    autoregression), and all of a view have a shift and a turn in common.
    """

    views: BoardViews
    noise: StripeNoise = field(default_factory=StripeNoise)
    shape: BoardShape | None = None

    def linearise(self, state: State) -> Linearised:
        """Errors in units of their σ, a view's rows mixed with each other only."""
        return self.independent_rows(state).linearised()

    def independent_rows(self, state: State) -> ResidualRows:
        """As ``errors``, independent and of unit variance."""
        found = self.errors(state)
        names = tuple(found.jacobian)
        table = np.concatenate([found.residual[:, None], *(found.jacobian[n] for n in names)], 1)
        table = self.independent(table)
        ends = np.cumsum([1, *(found.jacobian[n].shape[1] for n in names)])
        jacobian = {n: table[:, i:j] for n, i, j in zip(names, ends[:-1], ends[1:], strict=True)}
        return ResidualRows(table[:, 0], jacobian, self.views.view_of_stripe)

    def errors(self, state: State) -> StripeErrors:
        """How far along their normals [px] the stripes are seen from where boards and plane meet."""
        stripe = self.views.stripe
        shift, near = np.zeros(len(stripe)), None
        for _ in range(_NEWTON):
            residual, by_pixel, near = self._off(state, stripe.uv_px - shift[:, None] * stripe.normal, near)
            shift = shift + residual / by_pixel
        found = self._distances(state, stripe.uv_px - shift[:, None] * stripe.normal, near)
        jacobian = {name: j / found.by_pixel[:, None] for name, j in found.jacobian.items()}
        return StripeErrors(shift + found.residual / found.by_pixel, jacobian, np.ones(len(stripe)))

    def distances(self, state: State) -> StripeErrors:
        """Distances of the stripes' points on their boards from the laser plane [mm]."""
        return self._distances(state, self.views.stripe.uv_px)

    def _off(self, state: State, uv: Array, near: Array | None) -> tuple[Array, Array, Array]:
        """Distances (M,) from the plane [mm], by a shift along the normal, and the rays (M, 2), found from near."""
        stripe, plane = self.views.stripe, state.vector(PLANE)
        ray = rays(state.vector(CAMERA), uv, near)
        q = np.concatenate([ray.value, np.ones((len(stripe), 1))], 1)
        met = self.met(state, q)
        unit = plane / np.sqrt(plane @ plane)
        by_uv = (_by_ray(met, q, unit)[:, None, :2] @ ray.by_point)[:, 0]
        return met.reach * (q @ unit) - 1 / np.sqrt(plane @ plane), _dot(by_uv, stripe.normal), ray.value

    def met(self, state: State, q: Array) -> MetBoards:
        """Where the points' rays (M, 3), or others in their place, meet their boards."""
        member, board = self.views.view_of_stripe, state.pose(BOARD)
        R, t = board.R[member], board.t[member]
        normal = R[:, :, 2]
        reach = _dot(normal, t) / _dot(normal, q)
        if self.shape is None or BEND not in state.values:
            return MetBoards(reach, normal, None)
        bend, lies = state.vector(BEND), self.views.axes[member]
        way, origin = _turned_back(R, q), _turned_back(R, t)
        for _ in range(_BENT):
            p = reach[:, None] * way - origin
            h = self.shape.height(bend, p[:, :2])
            upward = np.column_stack([-h.slope * lies[:, None], np.ones(len(q))])
            reach = reach - (p[:, 2] - lies * h.z_mm) / _dot(upward, way)
        h = self.shape.height(bend, reach[:, None] * way[:, :2] - origin[:, :2])
        upward = np.column_stack([-h.slope * lies[:, None], np.ones(len(q))])
        return MetBoards(reach, (R @ upward[..., None])[..., 0], h.by_bend * lies[:, None])

    def _distances(self, state: State, uv: Array, near: Array | None = None) -> StripeErrors:
        stripe, member = self.views.stripe, self.views.view_of_stripe
        board, plane = state.pose(BOARD), state.vector(PLANE)
        R, t = board.R[member], board.t[member]
        ray = undistort(state.vector(CAMERA), uv, near)
        q = np.concatenate([ray.value, np.ones((len(stripe), 1))], 1)
        met = self.met(state, q)
        X = met.reach[:, None] * q
        size = np.sqrt(plane @ plane)
        residual = (X @ plane - 1) / size
        unit = plane / size
        slope = q @ unit / _dot(met.normal, q)  # of the residual, by a shift of the board along its normal
        by_xy = _by_ray(met, q, unit)[:, :2]
        by_uv = (by_xy[:, None] @ ray.by_point)[:, 0]
        upward, place = _turned_back(R, met.normal), _turned_back(R, X - t)
        jacobian = {
            CAMERA: (by_xy[:, None] @ ray.by_camera)[:, 0],
            BOARD: slope[:, None] * np.concatenate([upward, np.cross(place, upward)], -1),
            PLANE: X / size - residual[:, None] * plane / size**2,
        }
        if met.by_bend is not None:
            jacobian[BEND] = slope[:, None] * met.by_bend
        return StripeErrors(residual, jacobian, _dot(by_uv, stripe.normal))

    def independent(self, table: Array) -> Array:
        """Rows (M, n) [px] carried over to independent ones of unit variance."""
        alike, first = self._likeness()
        scale = np.broadcast_to(self.noise.scale, len(self.views))
        sigma = self.views.stripe.sigma_px * scale[self.views.view_of_stripe]
        table = np.concatenate([table, self.noise.offset_px * self.in_common], 1) / sigma[:, None]
        previous = np.concatenate([np.zeros((1, table.shape[1])), table[:-1]])
        previous[first] = 0
        table = (table - alike[:, None] * previous) / np.sqrt(1 - alike**2)[:, None]
        table, common = table[:, :-2], table[:, -2:].real
        if self.noise.offset_px == 0:
            return table
        # (I + U Uᵀ)^(-1/2) of a view's two common errors U, by the eigenvectors of UᵀU
        for start, end in self._spans:
            u = common[start:end]
            power, axes = np.linalg.eigh(u.T @ u)
            share = np.where(power > 1e-12, (1 - 1 / np.sqrt(1 + power)) / np.maximum(power, 1e-12), 0.5)
            u = u @ axes
            table[start:end] = table[start:end] - u @ (share[:, None] * (u.T @ table[start:end]))
        return table

    @cached_property
    def _spans(self) -> tuple[tuple[int, int], ...]:
        """First and last point (excluded) of every view's stripe."""
        ends = np.cumsum([0, *(len(v.stripe) for v in self.views.views)])
        return tuple((int(i), int(j)) for i, j in pairwise(ends) if j > i)

    @cached_property
    def in_common(self) -> Array:
        """What a view's points have in common (M, 2), of unit mean square: a shift, and a turn about their middle."""
        out = np.ones((len(self.views.stripe), 2))
        for start, end in self._spans:
            uv = self.views.stripe.uv_px[start:end]
            along = np.linalg.norm(uv - uv[0], axis=1)
            along = along - along.mean()
            out[start:end, 1] = along / max(float(np.sqrt(np.mean(along**2))), 1e-9)
        return out

    def _likeness(self) -> tuple[Array, NDArray[np.bool_]]:
        """Correlation (M,) of each point's error with that of the one before, and which are the first of a view."""
        member, uv = self.views.view_of_stripe, self.views.stripe.uv_px
        first = np.ones(len(member), dtype=bool)
        first[1:] = member[1:] != member[:-1]
        if self.noise.length_px <= 0:
            return np.zeros(len(member)), first
        step = np.concatenate([[0.0], np.linalg.norm(np.diff(uv, axis=0), axis=1)])
        return np.where(first, 0.0, np.exp(-step / self.noise.length_px)), first


def _normalised(X: Array) -> tuple[Array, Array]:
    """Normalised coordinates (N, 2) of points (N, 3), and their Jacobian (N, 2, 3)."""
    xy = X[:, :2] / X[:, 2:]
    by_x = np.zeros((len(X), 2, 3), dtype=X.dtype)
    by_x[:, 0, 0] = by_x[:, 1, 1] = 1 / X[:, 2]
    by_x[:, :, 2] = -xy / X[:, 2:]
    return xy, by_x


def _by_ray(met: MetBoards, q: Array, unit: Array) -> Array:
    """Distances along a unit vector of where rays (M, 3) meet boards, by the rays (M, 3).

    A point moves by its reach times the ray's turn, less what brings it back onto the board.
    """
    slope = q @ unit / _dot(met.normal, q)
    return np.asarray(met.reach[:, None] * (unit - slope[:, None] * met.normal))


def _turned_back(R: Array, v: Array) -> Array:
    """Vectors (M, 3) in the frames that rotations (M, 3, 3) come from."""
    return np.asarray((np.swapaxes(R, 1, 2) @ v[..., None])[..., 0])


def _dot(a: Array, b: Array) -> Array:
    return np.asarray(np.sum(a * b, axis=-1))
