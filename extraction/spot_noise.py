"""Error budget of fitted spots: what camera noise and correlated speckle do to them, and what their residuals say.

Speckle puts the error c · s_i · e_i into pixel i: s the spot's signal, e of unit variance, correlated by ρ(distance).
A linear estimate moves by Σ h_i · error_i with the influence h_i = F⁻¹ J_i w_i, so that whatever the weights w were

    Cov = Σ_i h_i V_i h_iᵀ + c² Σ_ij h_i s_i ρ_ij s_j h_jᵀ,    V the camera's variance,

and the residuals r = (1 - H) error, H_ij = J_iᵀ F⁻¹ J_j w_j, have moments of the same form. Both follow from the
matrices M_k = Σ_ij (w s J)_i (w s J)_jᵀ over the pairs whose distance is of class k, so that the contrast c and the
correlation ρ can be chosen afterwards. All spots of an image are taken at once, in windows of one size.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from extraction.compiled import compiled
from extraction.gaussian_fit import PREC_UU, PREC_UV, PREC_VV, model_planes

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# squared distances of two pixels that are told apart; farther ones are taken as uncorrelated
DISTANCES2 = np.array([0, 1, 2, 4, 5, 8, 9])
CLASSES = len(DISTANCES2)
REACH = 3
# class of distance, rows down, columns right (LAGS, 3)
LAGS = np.array(
    [
        (k, b, a)
        for k, d in enumerate(DISTANCES2)
        for b in range(-REACH, REACH + 1)
        for a in range(-REACH, REACH + 1)
        if a * a + b * b == d
    ]
)
HALF_LAGS = LAGS[(LAGS[:, 1] > 0) | ((LAGS[:, 1] == 0) & (LAGS[:, 2] >= 0))]  # one of every two opposite ones
CORE = 0.2  # share of the height above which a pixel's residual tells of the speckle
BRIGHT = 0.1  # the same for the pixels that the terms are fitted to, when residuals are judged
# after the fit's nine terms: third and fourth moment along the long axis. A spot is no perfect Gaussian along its
# string (dim light on the rest of it, the sheet's wings); without these terms that would pass for speckle.
FIT_TERMS, SKEW_TERM, TERMS = 9, 9, 11


@dataclass(frozen=True, eq=False)
class SpotNoise:
    """Error budget of N spots; the last axis of what comes from speckle of contrast 1 is the class of distance (K,).

    camera (N, 3, 3), speckle (N, 3, 3, K): Cov of (u, v, skew). skew (N,): third moment along the long axis that the
    fit left. variance, neighbour (N,): Σ residual² over the core and Σ of neighbours' products, over the height's
    square, the camera's part taken off; variance_camera (N,): that part of the former.
    variance_speckle, neighbour_speckle (N, K): expectation of both.
    """

    camera: Array
    speckle: Array
    skew: Array
    variance: Array
    neighbour: Array
    variance_camera: Array
    variance_speckle: Array
    neighbour_speckle: Array


def concatenate(parts: Sequence[SpotNoise]) -> SpotNoise:
    """The budgets of several groups of spots as one."""
    return SpotNoise(*(np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(SpotNoise)))


def take(about: SpotNoise, index: NDArray[np.intp]) -> SpotNoise:
    """The budgets of the spots ``index``."""
    return SpotNoise(*(getattr(about, f.name)[index] for f in fields(SpotNoise)))


@dataclass(frozen=True, eq=False)
class _Planes:
    """Basis e (N, TERMS, L), and signal, camera variance, weight, residual (N, L) of the pixels, flat; shape (R, C)."""

    e: Array
    signal: Array
    variance: Array
    weight: Array
    residual: Array
    shape: tuple[int, int]


def spot_noise(data: Array, use: Mask, parameters: Array, terms: NDArray[np.int64], noises: Array) -> SpotNoise:
    """Error budget of the fits ``parameters`` (N, 9) of the windows data (N, R, C) over the pixels ``use``.

    terms (N,), noises (N, 5): as in `gaussian_fit.fit_window`; positions from each window's first pixel.
    """
    planes = _planes(data, use, parameters, terms, noises)
    weighted = planes.e * planes.weight[:, None]
    fisher = weighted @ planes.e.transpose(0, 2, 1)
    # a term that was not fitted has no information and must not enter
    free = np.arange(9) < terms[:, None]
    free = np.column_stack([free, np.ones((len(free), TERMS - FIT_TERMS), dtype=np.bool_)])
    normal = fisher + np.where(free, 0.0, 1.0)[:, :, None] * np.eye(TERMS)
    influence = _influence(parameters, fisher, _inverse(normal[:, :FIT_TERMS, :FIT_TERMS], 1e-15))
    moved = influence @ weighted
    signalled = weighted * planes.signal[:, None]
    used = np.append(np.flatnonzero(np.arange(FIT_TERMS) < terms.max()), SKEW_TERM)
    matrices = _matrices(signalled[:, used], planes.shape)
    fitted = influence[:, None, :, used]
    return SpotNoise(
        camera=(moved * planes.variance[:, None]) @ moved.transpose(0, 2, 1),
        speckle=np.moveaxis(fitted @ matrices @ fitted.transpose(0, 1, 3, 2), 1, -1),
        skew=np.sum(moved[:, 2] * planes.residual, axis=1),
        **_residual_moments(_bright(planes), free),
    )


def _inverse(normal: Array, least: float) -> Array:
    """Pseudo-inverse of symmetric matrices (N, R, R), without what is below ``least`` of the largest eigenvalue.

    Taken of unit diagonals: the terms' units differ by powers of ten.
    """
    normal = np.where(np.all(np.isfinite(normal), axis=(1, 2), keepdims=True), normal, 0.0)
    size = np.sqrt(np.maximum(np.diagonal(normal, axis1=1, axis2=2), 1e-300))
    scale = 1.0 / (size[:, :, None] * size[:, None])
    values, vectors = np.linalg.eigh(normal * scale)
    kept = values > least * values[:, -1:]
    share = np.where(kept, 1.0, 0.0) / np.where(kept, values, 1.0)
    return np.asarray((vectors * share[:, None]) @ vectors.transpose(0, 2, 1) * scale)


def _matrices(signalled: Array, shape: tuple[int, int]) -> Array:
    """M (N, K, T, T) of the planes (N, T, L)."""
    half = (signalled @ _near(signalled, shape, HALF_LAGS).transpose(0, 1, 3, 2)).transpose(1, 0, 2, 3)
    out = half + half.transpose(0, 1, 3, 2)
    out[:, 0] = half[:, 0]
    return np.asarray(out)


def _bright(planes: _Planes) -> _Planes:
    """The planes cut to the bright part: there a spot is a Gaussian, its wings do not matter."""
    rows, columns = planes.shape
    bright = planes.signal > BRIGHT * planes.signal.max(axis=1, keepdims=True)
    box = np.any(bright & (planes.weight > 0), axis=0).reshape(rows, columns)
    down, right = np.flatnonzero(box.any(axis=1)), np.flatnonzero(box.any(axis=0))
    if not len(down):
        return planes
    part = np.s_[..., down[0] : down[-1] + 1, right[0] : right[-1] + 1]

    def cut(values: Array) -> Array:
        return values.reshape(*values.shape[:-1], rows, columns)[part].reshape(*values.shape[:-1], -1)

    weight = np.where(bright, planes.weight, 0.0)
    size = (int(down[-1] - down[0]) + 1, int(right[-1] - right[0]) + 1)
    return _Planes(cut(planes.e), cut(planes.signal), cut(planes.variance), cut(weight), cut(planes.residual), size)


def _planes(data: Array, use: Mask, p: Array, terms: NDArray[np.int64], noises: Array) -> _Planes:
    bell, x, y = model_planes(p, data.shape[1:])
    i, j = np.arange(data.shape[2]) + 0.0 * bell, np.arange(data.shape[1])[:, None] + 0.0 * bell
    height, level = p[:, 2, None, None], noises[:, 2, None, None]
    signal = height * bell
    mu = signal + p[:, 6, None, None] + p[:, 7, None, None] * i + p[:, 8, None, None] * j
    variance = noises[:, 0, None, None] + noises[:, 1, None, None] * np.maximum(mu - level, 0.0)
    weight = np.where(use, 1.0 / (variance + noises[:, 3, None, None] * signal**2 + noises[:, 4, None, None]), 0.0)
    a, b, c = p[:, PREC_UU], p[:, PREC_UV], p[:, PREC_VV]
    angle = 0.5 * np.arctan2(-2.0 * b, c - a)  # long axis: the small eigenvalue of the precision
    cosine, sine = np.cos(angle), np.sin(angle)
    along = np.sqrt(np.maximum(a * cosine**2 + 2.0 * b * cosine * sine + c * sine**2, 1e-12))
    t = (along * cosine)[:, None, None] * x + (along * sine)[:, None, None] * y
    slope = (terms == 9)[:, None, None]
    e = np.stack(
        [bell, bell * x, bell * y, 0.5 * bell * x * x, bell * x * y, 0.5 * bell * y * y, np.ones_like(bell),
         slope * i, slope * j, signal * (t**3 - 3.0 * t) / 6.0, signal * (t**4 - 6.0 * t**2 + 3.0) / 24.0], axis=1,
    )  # fmt: skip
    n = len(p)
    return _Planes(
        e.reshape(n, TERMS, -1), signal.reshape(n, -1), variance.reshape(n, -1), weight.reshape(n, -1),
        np.where(use, data - mu, 0.0).reshape(n, -1), (data.shape[1], data.shape[2]),
    )  # fmt: skip


def _influence(p: Array, fisher: Array, inverse: Array) -> Array:
    """Influence (N, 3, TERMS) of a grey level on u, v and the skew, in terms of the weighted basis."""
    out = np.zeros((len(p), 3, TERMS))
    det = ((p[:, 3] * p[:, 5] - p[:, 4] ** 2) * p[:, 2])[:, None]
    first, second = inverse[:, 1], inverse[:, 2]
    out[:, 0, :9] = (p[:, 5, None] * first - p[:, 4, None] * second) / det
    out[:, 1, :9] = (p[:, 3, None] * second - p[:, 4, None] * first) / det
    # what the fit leaves of the third moment: the part that is orthogonal to all its terms
    cross = fisher[:, SKEW_TERM, :9]
    share = np.einsum("nrs,ns->nr", inverse, cross)
    size = np.maximum(fisher[:, SKEW_TERM, SKEW_TERM] - np.einsum("nr,nr->n", share, cross), 1e-30)[:, None]
    out[:, 2, :9], out[:, 2, SKEW_TERM] = -share / size, 1.0 / size[:, 0]
    return out


def _near(q: Array, shape: tuple[int, int], lags: NDArray[np.int64] = LAGS) -> Array:
    """Σ q (N, T, L) over the pixels at each class of distance from every pixel: (K, N, T, L)."""
    n, terms, _ = q.shape
    out = np.zeros((CLASSES, n * terms, *shape))
    _add_neighbours(np.ascontiguousarray(q).reshape(n * terms, *shape), lags, out)
    return out.reshape(CLASSES, n, terms, -1)


@compiled
def _add_neighbours(q: Array, lags: NDArray[np.int64], out: Array) -> None:
    """Add to out (K, M, R, C) the planes q (M, R, C) shifted by every lag of each class."""
    count, rows, columns = q.shape
    for m in range(count):
        for lag in range(len(lags)):
            k, b, a = lags[lag, 0], lags[lag, 1], lags[lag, 2]
            first, last = max(0, -a), columns - max(0, a)
            for j in range(max(0, -b), rows - max(0, b)):
                target, source = out[k, m, j, first:last], q[m, j + b, first + a : last + a]
                for i in range(last - first):
                    target[i] += source[i]


def _residual_moments(planes: _Planes, free: Mask) -> dict[str, Array]:
    """Variance and neighbour products of the core's residuals over the height's square, and what they are made of."""
    weighted = planes.e * planes.weight[:, None]
    normal = weighted @ planes.e.transpose(0, 2, 1) + np.where(free, 0.0, 1.0)[:, :, None] * np.eye(TERMS)
    inverse = _inverse(normal, 1e-12)
    signalled = weighted * planes.signal[:, None]
    near = _near(signalled, planes.shape)
    matrices = np.asarray((signalled @ near.transpose(0, 1, 3, 2)).transpose(1, 0, 2, 3))
    core = _core(planes, weighted, inverse, near, matrices)
    n, count = len(inverse), len(core.spot)
    own = np.arange(count)
    position = np.full(planes.signal.shape, -1)
    position[core.spot, core.pixel] = own
    after = (_step(position, planes.shape, 1), _step(position, planes.shape, planes.shape[1]))
    first, second = np.concatenate([_pairs(position, other) for other in after], axis=1)
    product, camera, speckle = _pair_moments(core, own, own)
    neighbours, _, neighbour_speckle = _pair_moments(core, first, second)
    return {
        "variance": _per_spot(product, core.spot, n),
        "variance_camera": _per_spot(camera, core.spot, n),
        "variance_speckle": _per_spot(speckle, core.spot, n),
        "neighbour": _per_spot(neighbours, core.spot[first], n),
        "neighbour_speckle": _per_spot(neighbour_speckle, core.spot[first], n),
    }


@dataclass(frozen=True, eq=False)
class _Core:
    """The core pixels of all spots (C,): where they are, residual, signal, camera variance, height² of their spot;
    z = F⁻¹ e (C, TERMS), what the camera makes of it, `w V e` (C, TERMS), M_k z (C, K, TERMS), near (C, K, TERMS).
    """

    spot: NDArray[np.intp]
    pixel: NDArray[np.intp]
    left: Array
    signal: Array
    variance: Array
    height2: Array
    z: Array
    camera_z: Array
    scattered: Array
    matrices_z: Array
    near: Array


def _core(planes: _Planes, weighted: Array, inverse: Array, near: Array, matrices: Array) -> _Core:
    height = planes.signal.max(axis=1)
    spot, pixel = np.nonzero((planes.weight > 0) & (planes.signal > CORE * height[:, None]))
    scattered = weighted * planes.variance[:, None]
    camera = scattered @ weighted.transpose(0, 2, 1)
    left = planes.residual - _fitted(planes, weighted, inverse)
    e = planes.e[spot, :, pixel]
    z, camera_z = np.empty_like(e), np.empty_like(e)
    matrices_z = np.empty((len(spot), CLASSES, TERMS))
    ends = np.searchsorted(spot, np.arange(len(inverse) + 1))
    for n, (a, b) in enumerate(pairwise(ends)):
        z[a:b] = e[a:b] @ inverse[n]
        camera_z[a:b] = z[a:b] @ camera[n]
        matrices_z[a:b] = (z[a:b] @ matrices[n]).transpose(1, 0, 2)
    return _Core(
        spot, pixel, left[spot, pixel], planes.signal[spot, pixel], planes.variance[spot, pixel], height[spot] ** 2,
        z, camera_z, scattered[spot, :, pixel], matrices_z, near.transpose(1, 3, 0, 2)[spot, pixel],
    )  # fmt: skip


def _fitted(planes: _Planes, weighted: Array, inverse: Array) -> Array:
    """What all terms together take of the residuals (N, L)."""
    step = np.einsum("nrs,ns->nr", inverse, np.einsum("nrl,nl->nr", weighted, planes.residual))
    return np.asarray(np.einsum("nr,nrl->nl", step, planes.e))


def _step(position: NDArray[np.intp], shape: tuple[int, int], step: int) -> NDArray[np.intp]:
    """The position table as seen from the pixel before: one column (step 1) or one row (step = columns) on."""
    out = np.full(position.shape, -1)
    out[:, :-step] = position[:, step:]
    if step == 1:
        out[:, shape[1] - 1 :: shape[1]] = -1
    return out


def _pairs(position: NDArray[np.intp], other: NDArray[np.intp]) -> NDArray[np.intp]:
    both = (position >= 0) & (other >= 0)
    return np.stack([position[both], other[both]])


def _per_spot(values: Array, spot: NDArray[np.intp], n: int) -> Array:
    out = np.zeros((n, *values.shape[1:]))
    np.add.at(out, spot, values)
    return out


def _pair_moments(core: _Core, c: NDArray[np.intp], d: NDArray[np.intp]) -> tuple[Array, Array, Array]:
    """For pairs of core pixels: residual product freed of the camera's part (P,), that part (P,), speckle's (P, K)."""
    same = c == d
    zi, zj, si, sj, height2 = core.z[c], core.z[d], core.signal[c], core.signal[d], core.height2[c]
    noise = np.where(same, core.variance[c], 0.0)
    noise += np.sum((core.camera_z[c] - core.scattered[c]) * zj - zi * core.scattered[d], axis=1)
    speckle = np.einsum("pkr,pr->pk", core.matrices_z[c] - core.near[c] * si[:, None, None], zj)
    speckle -= np.einsum("pkr,pr->pk", core.near[d], zi) * sj[:, None]
    speckle[np.arange(len(c)), np.where(same, 0, 1)] += si * sj
    return (core.left[c] * core.left[d] - noise) / height2, noise / height2, speckle / height2[:, None]
