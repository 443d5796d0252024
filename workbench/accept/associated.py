"""Associated features by least squares: sphere, plane, line; the range about them, and the shell of 95 % of the points.

These are Gaussian features, as VDI/VDE 2634 and ISO 10360-8 associate them: by distance, every point with weight one.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from extraction import Circle
from geometry import NoAnswerError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

REJECTED = 0.003  # share of points that VDI/VDE 2634 allows to be rejected
_SHELL = 0.95  # share of points whose shell ISO 10360-8 calls D95 %
_STEPS = 50
_SETTLED_MM = 1e-9
_MOST_RADIUS_SIGMA = 0.02  # of the radius: a sphere that is known worse was seen from too narrow a band
FEWEST_POINTS = 25  # the standard's probing points


class Feature(Protocol):
    """What points have a signed distance from."""

    def residuals(self, points: Array, /) -> Array:
        """Distances (N,) of points (N, 2 or 3)."""


F = TypeVar("F", bound=Feature)


@dataclass(frozen=True, eq=False)
class Sphere3:
    """Centre (3,), radius, and the radius' own σ by the points' scatter [mm]."""

    centre_mm: Array
    radius_mm: float
    sigma_radius_mm: float

    def residuals(self, points: Array) -> Array:
        """Distances (N,) of points (N, 3), positive outside."""
        return np.asarray(np.linalg.norm(points - self.centre_mm, axis=1) - self.radius_mm)


@dataclass(frozen=True, eq=False)
class Flat:
    """A point and the unit normal of a plane (3,), or of a line (2,)."""

    origin_mm: Array
    normal: Array

    def residuals(self, points: Array) -> Array:
        """Signed distances (N,) of points (N, 2 or 3)."""
        return np.asarray((points - self.origin_mm) @ self.normal)


@dataclass(frozen=True, eq=False)
class Form(Generic[F]):
    """How points lie about their feature.

    used: all but the rejected ones (N,). residuals: of all points (N,). range_mm: of the used; shell_mm: the narrowest
    that holds 95 % of all; rms_mm: of the used.
    """

    feature: F
    used: Mask
    residuals: Array
    range_mm: float
    shell_mm: float
    rms_mm: float

    @property
    def rejected(self) -> int:
        """How many points were rejected."""
        return int(np.count_nonzero(~self.used))


def form_of(points: Array, fit: Callable[[Array], F], rejected: float = REJECTED) -> Form[F]:
    """The form of points (N, 2 or 3) about their associated feature, the worst few rejected as the guideline allows.

    Rejected one after another, the farthest from a feature that is fitted anew after each tenth of them.
    """
    if len(points) < FEWEST_POINTS:
        raise NoAnswerError(f"{len(points)} points lie on the standard: a test needs at least {FEWEST_POINTS}")
    used = np.ones(len(points), dtype=bool)
    left = int(np.floor(rejected * len(points)))
    feature = fit(points)
    while left > 0:
        n = max(1, left // 10)
        off = np.where(used, np.abs(feature.residuals(points)), -1.0)
        used[np.argsort(-off, kind="stable")[:n]] = False
        left -= n
        feature = fit(points[used])
    residuals = feature.residuals(points)
    mine = residuals[used]
    return Form(feature, used, residuals, float(np.ptp(mine)), shell_width(residuals), float(np.sqrt(np.mean(mine**2))))


def shell_width(residuals: Array) -> float:
    """The narrowest shell that holds 95 % of the points."""
    ordered = np.sort(residuals)
    n = int(np.ceil(_SHELL * len(ordered)))
    return float(np.min(ordered[n - 1 :] - ordered[: len(ordered) - n + 1]))


def fit_sphere(points: Array) -> Sphere3:
    """The Gaussian sphere of points (N, 3), its radius free; NoAnswerError where they do not determine it."""
    middle = points.mean(axis=0)
    p = points - middle
    rows = np.column_stack([2 * p, np.ones(len(p))])
    solution, _, rank, _ = np.linalg.lstsq(rows, np.sum(p**2, axis=1), rcond=1e-10)
    square = float(solution[3] + solution[:3] @ solution[:3])
    if rank < 4 or square <= 0:
        raise NoAnswerError("the points lie in one plane: a sphere needs sections at several places across it")
    centre, radius = solution[:3], float(np.sqrt(square))
    for _ in range(_STEPS):
        away = p - centre
        length = np.maximum(np.linalg.norm(away, axis=1), 1e-12)
        rows = np.column_stack([away / length[:, None], np.ones(len(p))])
        step = np.linalg.lstsq(rows, length - radius, rcond=1e-12)[0]
        centre, radius = centre + step[:3], radius + float(step[3])
        if np.max(np.abs(step)) < _SETTLED_MM:
            break
    away = p - centre
    length = np.linalg.norm(away, axis=1)
    scatter = float(np.sum((length - radius) ** 2)) / max(len(p) - 4, 1)
    rows = np.column_stack([away / length[:, None], np.ones(len(p))])
    sigma = float(np.sqrt(scatter * np.linalg.pinv(rows.T @ rows)[3, 3]))
    if not radius > 0 or sigma > _MOST_RADIUS_SIGMA * radius:
        raise NoAnswerError(
            f"the points determine the sphere's radius to {sigma:.3g} mm only: more of the ball must be seen, in "
            "sections across all of it"
        )
    return Sphere3(middle + centre, radius, sigma)


def fit_flat(points: Array) -> Flat:
    """The Gaussian plane of points (N, 3), or line of points (N, 2); NoAnswerError where they do not determine it."""
    middle = points.mean(axis=0)
    _, size, axes = np.linalg.svd(points - middle, full_matrices=False)
    if points.shape[1] == 3 and size[1] < 1e-3 * size[0]:
        raise NoAnswerError("the points lie on one line: a plane needs profiles at several places across it")
    normal = axes[-1]
    return Flat(middle, normal if normal[-1] >= 0 else -normal)


def fit_circle(points: Array) -> Circle:
    """The Gaussian circle of points (N, 2); NoAnswerError where they do not determine it."""
    fitted = Circle.fit(points, np.ones(len(points)))
    if fitted is None:
        raise NoAnswerError("the points of a section make no circle")
    return fitted
