"""The curve that most points of a profile agree on, and which of them lie on it by their own noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.config import FeatureConfig
from extraction.features.shapes import Circle, Circles, Line, Lines

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Curve = Circle | Line
Valid = Callable[[Circles | Lines], Mask]  # which of M curves are looked for at all (M,)

_MAD = 1.4826  # of a Gaussian: σ over the median of its magnitude
_ROUNDS = 25  # of fitting and choosing anew; it settles in three to six
_WIDEST = 3.0  # times the tolerance of the search: a choice that would grow beyond bends away from its curve
_TRUST = 3.0  # no point weighs more or less than the usual one by more than this factor of σ
_FEWEST_BY_SHAPE: dict[type[Curve], int] = {Circle: 3, Line: 2}
_MANY_BY_SHAPE: dict[type[Curve], type[Circles | Lines]] = {Circle: Circles, Line: Lines}
_FIRST_SAMPLES, _MOST_SAMPLES = 32, 256  # drawn at once: few do where most points agree; many fit a processor's cache
_LEAST_NEAR = 0.5  # of the points that lie on a curve in the end, the search's distance from it holds this share


@dataclass(frozen=True, eq=False)
class Course:
    """Points (N, 2) of a profile in order along y, with their covariance, and what neighbours scatter by [mm]."""

    yz_mm: Array
    cov_yz_mm2: Array
    scatter_mm: float

    def sigma_across(self, curve: Curve) -> Array:
        """Stated σ (N,) of the points across a curve; the usual one where a point states none or an odd one."""
        n = curve.normals(self.yz_mm)
        variance = np.einsum("ni,nij,nj->n", n, self.cov_yz_mm2, n)
        stated = np.sqrt(np.maximum(variance, 0.0))
        usual = float(np.median(stated[stated > 0])) if np.any(stated > 0) else 1.0
        return np.asarray(np.clip(np.where(stated > 0, stated, usual), usual / _TRUST, usual * _TRUST))


@dataclass(frozen=True, eq=False)
class Agreement:
    """A curve, which points (N,) lie on it, the σ (N,) across it of every point, and its robust scatter [mm]."""

    curve: Curve
    inliers: Mask
    sigma_mm: Array
    scatter_mm: float


def course_of(yz_mm: Array, cov_yz_mm2: Array) -> Course:
    """Points in order along y with their local scatter."""
    return Course(yz_mm, cov_yz_mm2, local_scatter(yz_mm))


def local_scatter(yz_mm: Array) -> float:
    """Robust σ [mm] of points (N, 2) in order along y: each against its neighbours' chord."""
    if len(yz_mm) < 3:
        return 0.0
    before, here, after = yz_mm[:-2], yz_mm[1:-1], yz_mm[2:]
    chord = after - before
    length = np.maximum(np.hypot(*chord.T), 1e-12)
    off = here - (before + after) / 2
    across = (off[:, 1] * chord[:, 0] - off[:, 0] * chord[:, 1]) / length
    return _MAD * float(np.median(np.abs(across))) / float(np.sqrt(1.5))


def agree(
    course: Course,
    free: Mask,
    shape: type[Curve],
    valid: Valid,
    rng: np.random.Generator,
    config: FeatureConfig,
    least: int = 0,
) -> Agreement | None:
    """The curve on which most of the free points lie; None where there is none.

    Parameters
    ----------
    course
        The profile.
    free
        Which points (N,) may be used.
    shape
        Circle or Line.
    valid
        Which curves are looked for at all.
    rng
        Of the samples.
    config
        Of features.
    least
        Curves of fewer points matter to nobody, and are not searched for as long.

    Returns
    -------
    Agreement or None
    """
    at = np.flatnonzero(free)
    if len(at) < max(config.min_points, least):
        return None
    tolerance = max(config.tolerance_sigma * course.scatter_mm, config.min_tolerance_mm)
    thinned = at[:: -(-len(at) // config.ransac_points)]
    sought = int(_LEAST_NEAR * max(config.min_points, least) * len(thinned) / len(at))
    best = _most_agreed(course.yz_mm[thinned], shape, valid, sought, tolerance, rng, config)
    return None if best is None else _settled(course, free, best, valid, tolerance, config)


def _most_agreed(
    yz: Array, shape: type[Curve], valid: Valid, least: int, tolerance: float, rng: np.random.Generator,
    config: FeatureConfig,
) -> Curve | None:  # fmt: skip
    """The curve through a sample that has most points near it, of equal ones the first, fitted to these points.

    Samples are drawn, and their curves counted, some hundreds at once. They end once a curve with more points than the
    best one, or than ``least``, would have been met with the wanted certainty.
    """
    fewest, many = _FEWEST_BY_SHAPE[shape], _MANY_BY_SHAPE[shape]
    best, most, drawn, wanted = None, fewest, 0, _samples_for(least / len(yz), fewest, config)
    while drawn < wanted:
        count = min(max(drawn, _FIRST_SAMPLES), _MOST_SAMPLES, wanted - drawn)
        curves = many.through(yz[_distinct(len(yz), count, fewest, rng)])
        curves = curves.only(valid(curves))
        drawn += count
        if len(curves) == 0:
            continue
        near = curves.near(yz, tolerance)
        agreed = np.count_nonzero(near, axis=1)
        first = int(np.argmax(agreed))
        if agreed[first] > most:
            best, most = near[first], int(agreed[first])
            wanted = min(wanted, _samples_for(most / len(yz), fewest, config))
    if best is None:
        return None
    curve = shape.fit(yz[best], np.ones(most))
    return curve if curve is not None and _is_valid(curve, valid) else None


def _samples_for(share: float, fewest: int, config: FeatureConfig) -> int:
    """Samples after which one within so large a share of the points has been drawn, as sure as is wanted."""
    alike = min(share, 1.0) ** fewest
    if alike >= 1:
        return 1
    missed = float(np.log1p(-alike))
    return (
        config.ransac_trials
        if missed == 0
        else min(config.ransac_trials, int(np.ceil(np.log1p(-config.ransac_certainty) / missed)))
    )


def _distinct(n: int, count: int, size: int, rng: np.random.Generator) -> NDArray[np.intp]:
    """Samples (count, size) of as many different numbers below n each."""
    out = np.empty((count, size), dtype=np.intp)
    for k in range(size):
        drawn = rng.integers(0, n - k, count)
        for taken in np.sort(out[:, :k], axis=1).T:
            drawn += drawn >= taken
        out[:, k] = drawn
    return out


def _is_valid(curve: Curve, valid: Valid) -> bool:
    if isinstance(curve, Circle):
        return bool(valid(Circles(curve.centre_mm[None], np.array([curve.radius_mm])))[0])
    return bool(valid(Lines(curve.origin_mm[None], curve.direction[None]))[0])


def _settled(
    course: Course, free: Mask, curve: Curve, valid: Valid, tolerance: float, config: FeatureConfig
) -> Agreement | None:
    """Fitted and chosen anew until the choice stands: points within some σ of their own scatter about the curve."""
    inliers: Mask = free & (np.abs(curve.residuals(course.yz_mm)) <= tolerance)
    for _ in range(_ROUNDS):
        if np.count_nonzero(inliers) < config.min_points:
            return None
        sigma = course.sigma_across(curve)
        fitted = type(curve).fit(course.yz_mm[inliers], sigma[inliers] ** -2)
        if fitted is None or not _is_valid(fitted, valid):
            return None
        curve = fitted
        off = curve.residuals(course.yz_mm)
        scale = _MAD * float(np.median(np.abs(off[inliers]) / sigma[inliers]))
        limit = np.minimum(config.inlier_sigma * np.maximum(scale * sigma, course.scatter_mm / 2), _WIDEST * tolerance)
        limit = np.maximum(limit, config.min_tolerance_mm / 2)
        chosen = _without_strays(free & (np.abs(off) <= limit), config.min_run)
        if np.array_equal(chosen, inliers):
            break
        inliers = chosen
    if np.count_nonzero(inliers) < config.min_points:
        return None
    scatter = _MAD * float(np.median(np.abs(curve.residuals(course.yz_mm)[inliers])))
    return Agreement(curve, inliers, scale * sigma, scatter)


def _without_strays(chosen: Mask, min_run: int) -> Mask:
    """Runs of fewer neighbours than ``min_run`` cross the curve by chance; one point astray does not end a run."""
    bridged = chosen.copy()
    bridged[1:-1] |= chosen[:-2] & chosen[2:]
    edges = np.flatnonzero(np.diff(np.concatenate([[False], bridged, [False]]).astype(np.int8)))
    out = np.zeros_like(chosen)
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if last - first >= min_run:
            out[first:last] = chosen[first:last]
    return out
