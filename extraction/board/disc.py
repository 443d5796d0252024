"""Dots of a board to the limit of the pixels' noise: a disc in perspective with a blurred rim, fitted to grey levels.

A dot's grey levels are (1 + g · x) (dark + step · (1 + E(d)) / 2) with E the error function of the distance d from the
disc's rim over the blur's width, and g the slope of the light. The rim is the image of a circle by the board's pose and
the lens's bend, so that the place that is fitted is the image of the circle's middle, not the middle of an ellipse.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.board.climb import climb, position_covariance
from extraction.board.plane import board_homography, mapped
from geometry.special import erf

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_BLUR_PX = (0.3, 12.0)  # Gaussian σ of a rim: from as sharp as pixels allow to far out of focus
_SIZE = np.log(2.0)  # of the radius, up or down, from where the fit starts
_BAND_PX, _BAND_SHARE = 4.0, 0.35  # of the rim, to either side: what tells where it is; the share is of the radius
_BEND_STEPS, _BEND_TRIED, _MOST_BEND = 6, 1e-3, 0.5  # Newton's steps; shares of the image corner's distance
_PARAMETERS = 8  # u, v, log radius, log blur, dark, step, two slopes of the light


@dataclass(frozen=True, eq=False)
class FlatBoard:
    """From pixels to the board: a homography (3, 3) from the board to pixels that the lens has not bent.

    bend: a, b of w (1 + a s + b s²), by which pixels w from the image's middle (2,) come to where a pinhole has them;
    s = |w|² over that of the image's corner.
    """

    homography: Array
    bend: Array
    middle_px: Array

    @staticmethod
    def of(xy_mm: Array, uv_px: Array, shape: tuple[int, ...]) -> FlatBoard:
        """By points of the board (N, 2) and their images."""
        middle = (np.array(shape[1::-1]) - 1) / 2

        def fitted(bend: Array) -> tuple[FlatBoard, Array]:
            straight = uv_px + (uv_px - middle) * _bent(uv_px - middle, bend, middle)[0][:, None]
            flat = FlatBoard(board_homography(xy_mm, straight), bend, middle)
            return flat, (mapped(flat.homography, xy_mm) - straight).ravel()

        bend = np.zeros(2)
        for _ in range(_BEND_STEPS):
            left = fitted(bend)[1]
            by = np.stack([fitted(bend + one)[1] - left for one in _BEND_TRIED * np.eye(2)], -1) / _BEND_TRIED
            bend = np.clip(bend - np.linalg.lstsq(by, left, rcond=None)[0], -_MOST_BEND, _MOST_BEND)
        return fitted(bend)[0]

    def on_board(self, uv_px: Array) -> tuple[Array, Array]:
        """Points (…, 2) [mm] of pixels, and their Jacobian (…, 2, 2)."""
        w = uv_px - self.middle_px
        inverse = np.linalg.inv(self.homography)
        more, slope = _bent(w, self.bend, self.middle_px)
        q = (uv_px + w * more[..., None]) @ inverse[:, :2].T + inverse[:, 2]
        on = q[..., :2] / q[..., 2:]
        by = (inverse[:2, :2] - on[..., None] * inverse[2, :2]) / q[..., 2:, None]
        along = slope[..., None, None] * (by @ w[..., None]) * w[..., None, :]
        return on, by * (1 + more[..., None, None]) + along

    def seen(self, xy_mm: Array) -> Array:
        """Pixels (N, 2) of points of the board."""
        straight = mapped(self.homography, xy_mm) - self.middle_px
        w = straight
        for _ in range(_BEND_STEPS):
            w = straight / (1 + _bent(w, self.bend, self.middle_px)[0][:, None])
        return np.asarray(w + self.middle_px)


def _bent(w: Array, bend: Array, middle_px: Array) -> tuple[Array, Array]:
    """A s + b s² of pixels w, and what it grows by along w, over w."""
    unit = float(middle_px @ middle_px)
    s = np.sum(w * w, axis=-1) / unit
    return s * (bend[0] + s * bend[1]), 2 / unit * (bend[0] + 2 * s * bend[1])


@dataclass(frozen=True, eq=False)
class Discs:
    """Fitted dots.

    uv_px (N, 2): images of their middles, covariance_px2 (N, 2, 2), radius_mm (N,), blur_px (N,): σ of the rims,
    step_dn (N,): from dark to bright, positive for dark dots, misfit_dn (N,): root mean square residual.
    """

    uv_px: Array
    covariance_px2: Array
    radius_mm: Array
    blur_px: Array
    step_dn: Array
    misfit_dn: Array


def fit_discs(
    image: NDArray[np.generic], board: FlatBoard, xy_mm: Array, start_px: Array, radius_mm: float, reach_px: Array
) -> Discs:
    """Fit dots of about a radius near their start (N, 2), each by the pixels within its reach (N,)."""
    ring = _rings(image, board, xy_mm, start_px, radius_mm, reach_px)
    p = np.zeros((len(xy_mm), _PARAMETERS))
    p[:, :2] = start_px - ring.expected
    p[:, 2] = np.log(radius_mm)
    p[:, 4:] = ring.levels(p)
    low, high = np.full(_PARAMETERS, -np.inf), np.full(_PARAMETERS, np.inf)
    low[2], high[2] = p[0, 2] - _SIZE, p[0, 2] + _SIZE
    low[3], high[3] = np.log(_BLUR_PX)
    most = np.array([1.0, 1.0, 0.2, 0.5, *[np.inf] * 4])
    p, cost, jac = climb(ring.model, p, (low, high), most)
    count = ring.weight.sum(axis=1)
    return Discs(
        ring.expected + p[:, :2],
        position_covariance(jac, cost, count),
        np.exp(p[:, 2]),
        np.exp(p[:, 3]),
        p[:, 5],
        np.sqrt(cost / np.maximum(count, 1)),
    )


@dataclass(frozen=True, eq=False)
class _Rings:
    """Pixels about the rims, dot by dot: places (N, P, 2), grey levels and weights (N, P); middles expected (N, 2)."""

    board: FlatBoard
    xy_mm: Array
    expected: Array
    uv: Array
    grey: Array
    weight: Array

    def distance(self, p: Array) -> tuple[Array, Array, Array]:
        """From the rim (N, P) [px], the unit way out (N, P, 2), and millimetres a pixel along it (N, P)."""
        on, by_pixel = self.board.on_board(self.uv - p[:, None, :2])
        away = on - self.xy_mm[:, None]
        size = np.maximum(np.linalg.norm(away, axis=-1), 1e-9)
        slope = np.einsum("npk,npkj->npj", away / size[..., None], by_pixel)
        steep = np.linalg.norm(slope, axis=-1)
        return (size - np.exp(p[:, 2, None])) / steep, slope / steep[..., None], steep

    def model(self, p: Array) -> tuple[Array, Array, Array]:
        """Cost (N,), weighted Jacobian (N, P, 8) and residual (N, P)."""
        d, out, steep = self.distance(p)
        blur, xy = np.exp(p[:, 3, None]), self.uv - self.expected[:, None]
        share = (1 + erf(d / (np.sqrt(2) * blur))) / 2
        light = 1 + xy[..., 0] * p[:, 6, None] + xy[..., 1] * p[:, 7, None]
        level = p[:, 4, None] + p[:, 5, None] * share
        res = (light * level - self.grey) * self.weight
        by_d = light * p[:, 5, None] * np.exp(-0.5 * (d / blur) ** 2) / (np.sqrt(2 * np.pi) * blur)
        jac = np.empty((*self.grey.shape, _PARAMETERS))
        jac[..., :2] = -by_d[..., None] * out
        jac[..., 2] = -by_d * np.exp(p[:, 2, None]) / steep
        jac[..., 3] = -by_d * d
        jac[..., 4], jac[..., 5] = light, light * share
        jac[..., 6:] = xy * level[..., None]
        jac *= self.weight[..., None]
        return np.sum(res**2, axis=1), jac, res

    def levels(self, p: Array) -> Array:
        """Dark level, step and slopes (N, 4) that fit best at the start: the light even."""
        share = (1 + erf(self.distance(p)[0] / np.sqrt(2))) / 2
        basis = np.stack([np.ones_like(share), share], -1) * self.weight[..., None]
        normal = np.einsum("npi,npj->nij", basis, basis) + 1e-9 * np.eye(2)
        best = np.linalg.solve(normal, np.einsum("npi,np->ni", basis, self.grey * self.weight)[..., None])[..., 0]
        return np.concatenate([best, np.zeros_like(best)], axis=1)


def _rings(
    image: NDArray[np.generic], board: FlatBoard, xy_mm: Array, start_px: Array, radius_mm: float, reach_px: Array
) -> _Rings:
    """The pixels on both sides of the rims."""
    expected = board.seen(xy_mm)
    span = np.arange(-int(reach_px.max()), int(reach_px.max()) + 1)
    grid = np.stack(np.meshgrid(span, span), -1).reshape(-1, 2)
    places = np.round(start_px).astype(int)[:, None] + grid
    whole = _Rings(board, xy_mm, expected, places.astype(float), np.empty(0), np.empty(0))
    start = np.column_stack([start_px - expected, np.full(len(xy_mm), np.log(radius_mm))])
    d, _, steep = whole.distance(start)
    band = max(_BAND_PX, _BAND_SHARE * radius_mm / float(np.median(steep)))
    near = (np.abs(d) < band) & (np.linalg.norm(grid, axis=-1) <= reach_px[:, None])
    height, width = image.shape
    near &= (places >= 0).all(-1) & (places[..., 0] < width) & (places[..., 1] < height)
    order = np.argsort(~near, axis=1, kind="stable")[:, : max(int(near.sum(axis=1).max()), 1)]
    places = np.take_along_axis(places, order[..., None], axis=1)
    weight = np.take_along_axis(near, order, axis=1).astype(float)
    u, v = np.clip(places[..., 0], 0, width - 1), np.clip(places[..., 1], 0, height - 1)
    return _Rings(board, xy_mm, expected, places.astype(float), image[v, u].astype(float), weight)
