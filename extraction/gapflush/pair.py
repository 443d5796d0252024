"""Both edges of a gap fitted in one to what the stripe's sections see: their places, their widths and their light."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from extraction.config import GapFlushConfig
from extraction.gapflush.edge import KNOWN_MM, PanelEdge
from extraction.gapflush.light import Sections
from extraction.gapflush.model import BEYOND, LIGHT, MEAN, SPREAD, TURN, edge_light
from geometry.ties import first_least

if TYPE_CHECKING:
    from scipy.optimize import OptimizeResult

Array = NDArray[np.float64]
Indices = NDArray[np.intp]
Mask = NDArray[np.bool_]

MAX_ARC_RAD = np.deg2rad(78.0)  # steeper, a section is no longer like the Gaussian that is fitted to it
_BLUR, _BLUR_ERROR = 0.75, 0.2  # of the stripe's width on the faces: what is expected of the blur, before the widths
_MODEL = 0.05  # of the displacement that the blur causes: error of the model
_LIGHT_ERROR, _WIDTH_ERROR = 0.03, 0.01  # relative, of the model of light and of squared widths
_GLOSS_ERROR, _GLOSS_RAD = 0.5, 0.35  # how much brighter or darker than matte a bend may be, from what angle on
_NEAR = 4.0  # of the blur before the bend, from where on the bend is seen
_FAINTEST = 0.02  # of the face's light: fainter sections are left out
_MOST_BEYOND = 0.03  # of a section's light from a flank that nobody knows of
_START_RADIUS_MM, _LEAST_RADIUS_MM = 0.3, 0.02  # of an edge that points alone call sharp; 0.02 is a seventh of a pixel
_ROUNDS = 3  # of weights by the fit before
_SCALE = (0.01, 0.05, 0.5, 0.5)  # of angle [rad], offset, tangent, radius [mm]: the size of their steps
_STEPS = (1e-5, 1e-4, 1e-4, 1e-4, 1e-3)  # of the derivatives
_RADII = (3, 7)
# mm, tried of an edge whose radius or light is in doubt: points alone make small radii large, and from too small a
# start the sections that would tell the radius are taken for those of a flank
_TRIED_RADII_MM = (0.3, 0.7, 1.5)
_GLOSS_DOUBT = 1.0  # two of its σ
_LIT, _LOST = 0.1, 5.0  # of the face's light, that a bend has at least; cost of a section with it that is left out
_SAME_COST = 1e-3  # of fits as good as each other the first is taken
BLUR, GLOSS = 8, 9  # places in the parameters: left edge (4), right edge (4), blur, gloss of each (2)


@dataclass(frozen=True, eq=False)
class _Side:
    """One edge's points in the frame of its face; the first ``on_face`` of them are the face's."""

    edge: PanelEdge
    index: Indices
    on_face: int
    at: Array
    sections: Sections
    scatter: tuple[float, float]  # of log light and of squared width, from section to section on the face
    lit: Mask  # as a bend may be
    use: Mask
    bent: Mask  # where width and light tell of the bend
    sigma: Array  # (3, N): of place [px], squared width [px²], log light

    def light(self, p: Array, blur: float) -> Array:
        s = self.sections
        return edge_light(p, self.at, s.along, s.across, s.view, blur)


@dataclass(frozen=True)
class _Expected:
    """What is known beforehand: the blur with its σ, radii where they are told."""

    blur_px: float
    sigma_blur_px: float
    radii_mm: tuple[float, float] | None

    @property
    def rows(self) -> int:
        """How many residuals it makes."""
        return 3 if self.radii_mm is None else 5


@dataclass(frozen=True, eq=False)
class _PairFit:
    """Parameters, the sides as they were weighed, covariance; cost, with that of sections that are lit and unused."""

    x: Array
    sides: list[_Side]
    covariance: Array
    cost: float


@dataclass(frozen=True, eq=False)
class EdgePair:
    """The fitted edges, their joint covariance (8, 8), the blur [px] with its σ."""

    left: PanelEdge
    right: PanelEdge
    covariance: Array
    blur_px: float
    sigma_blur_px: float


def fit_pair(
    yz: Array,
    sections: Sections,
    left: PanelEdge,
    right: PanelEdge,
    bends: tuple[Indices, Indices],
    c: GapFlushConfig,
    fixed: tuple[float, float] | None = None,
) -> EdgePair:
    """Both edges by robust weighted least squares, from edges fitted to the points alone.

    Unknown beside the edges are the blur along the stripe, which widens the stripe where it is steep, and by how much
    the bends are brighter or darker than matte ones. bends: the points after each face, in order. fixed: radii that are
    known.
    """
    sides = [_side(yz, sections, edge, bend) for edge, bend in zip((left, right), bends, strict=True)]
    width = float(np.mean([np.median(s.sections.width_px[: s.on_face]) for s in sides]))
    expected = _Expected(_BLUR * width, _BLUR_ERROR * width, fixed)
    fit = _fit_from(np.concatenate([_start(left), _start(right), [expected.blur_px, 0.0, 0.0]]), sides, expected, c)
    for k in range(2):
        if fixed is None and _doubtful(fit, k):
            trials = [_fit_from(_with_radius(fit, k, radius), sides, expected, c) for radius in _TRIED_RADII_MM]
            fit = [fit, *trials][first_least([f.cost for f in (fit, *trials)], _SAME_COST)]
    x, covariance = fit.x, fit.covariance
    edges = [_edge(side, x, covariance, k) for k, side in enumerate(fit.sides)]
    return EdgePair(edges[0], edges[1], covariance[:8, :8], float(x[BLUR]), float(np.sqrt(covariance[BLUR, BLUR])))


def _fit_from(x: Array, sides: list[_Side], expected: _Expected, c: GapFlushConfig) -> _PairFit:
    """Both edges from a start, weighed anew by each round's fit."""
    for _ in range(_ROUNDS):
        sides = [_weighed(side, x[4 * k : 4 * k + 4], x[BLUR]) for k, side in enumerate(sides)]
        best = _solve(x, sides, expected, c)
        x = best.x
    residuals = _residuals(x, sides, expected)
    freedom = max(int(np.sum(residuals != 0)) - len(x), 1)
    chi2 = float(np.sum(np.minimum(residuals**2, 9.0))) / freedom
    covariance = np.linalg.pinv(best.jac.T @ best.jac) * max(chi2, 1.0)
    lost = sum(int(np.count_nonzero(side.lit & ~side.use)) for side in sides)
    return _PairFit(x, sides, covariance, float(best.cost) + _LOST * lost)


def _doubtful(fit: _PairFit, k: int) -> bool:
    """Whether an edge may stand in another minimum than the best: its radius is none, or its light not expected."""
    i = _RADII[k]
    sharp = fit.x[i] <= 2 * np.sqrt(fit.covariance[i, i])
    return bool(sharp or abs(fit.x[GLOSS + k]) > _GLOSS_DOUBT)


def _with_radius(fit: _PairFit, k: int, radius: float) -> Array:
    """A start with another radius for an edge, which ends where its light does."""
    side, out = fit.sides[k], fit.x.copy()
    out[4 * k + 2] = float(side.at[side.lit, 0].max()) - radius
    out[4 * k + 3] = radius
    out[GLOSS + k] = 0.0
    return out


def _side(yz: Array, sections: Sections, edge: PanelEdge, bend: Indices) -> _Side:
    turn = np.array([edge.side * edge.direction, [-edge.direction[1], edge.direction[0]]])
    index = np.concatenate([edge.face, bend]).astype(np.intp)
    mine = sections.take(index, turn)
    n = len(edge.face)
    scatter = _scatter(mine.log_light[:n]), _scatter(mine.width_px[:n] ** 2)
    none = np.zeros(len(index), dtype=bool)
    at = (yz[index] - edge.origin) @ turn.T
    lit = mine.log_light > np.median(mine.log_light[:n]) + np.log(_LIT)
    return _Side(edge, index, n, at, mine, scatter, lit, none, none, np.ones((3, len(index))))


def _scatter(values: Array) -> float:
    """Robust σ from second differences, blind to slow changes."""
    return float(1.4826 * np.median(np.abs(np.diff(values, 2)))) / np.sqrt(6.0) if len(values) > 2 else 1.0


def _start(edge: PanelEdge) -> Array:
    angle, offset, tangent, radius = edge.parameters
    if radius > 0:
        return edge.parameters
    return np.array([angle, offset, tangent - _START_RADIUS_MM, _START_RADIUS_MM])


def _weighed(side: _Side, p: Array, blur: float) -> _Side:
    """The side with its usable points and their weights by an estimate."""
    seen, sharp = side.light(p, blur), side.light(p, 1e-3)
    moved = np.clip(np.abs(seen[:, MEAN] - sharp[:, MEAN]), 0, 3)
    s, (light, width) = side.sections, side.scatter
    use = (seen[:, BEYOND] < _MOST_BEYOND) & (seen[:, LIGHT] > _FAINTEST) & (seen[:, TURN] < MAX_ARC_RAD)
    bent = use & (side.at[:, 0] > p[2] - _NEAR * blur * np.linalg.norm(s.across, axis=1))
    noisier = np.minimum(s.sigma_px / np.median(s.sigma_px[: side.on_face]), 10.0)
    sigma = np.array(
        [
            np.hypot(s.sigma_px, _MODEL * moved),
            np.hypot(width * noisier, _WIDTH_ERROR * s.width_px**2),
            np.hypot(light * noisier, _LIGHT_ERROR),
        ]
    )
    return replace(side, use=use, bent=bent, sigma=sigma)


def _solve(x: Array, sides: list[_Side], expected: _Expected, config: GapFlushConfig) -> OptimizeResult:
    from scipy.optimize import least_squares  # a third of a second, and most commands need none of it

    top = config.max_radius_mm
    low, high = [], []
    for s in sides:
        face = s.at[: s.on_face, 0]
        end = float(face.max())
        low += [-0.5, -1.0, float(np.median(face)), _LEAST_RADIUS_MM]  # half of a face at least is straight
        high += [0.5, 1.0, end + top, top]
    low, high = [*low, 0.3, -3.0, -3.0], [*high, max(expected.blur_px / _BLUR * 1.3, 0.5), 3.0, 3.0]
    x = np.clip(x, np.add(low, 1e-6), np.subtract(high, 1e-6))
    scale = (*_SCALE, *_SCALE, 0.3, 0.5, 0.5)
    return least_squares(
        _residuals, x, _jacobian, bounds=(low, high), args=(sides, expected), loss="soft_l1", f_scale=2.0,
        x_scale=scale, xtol=1e-9, ftol=1e-10,
    )  # fmt: skip


def _residuals(x: Array, sides: list[_Side], expected: _Expected) -> Array:
    """Places, widths and light of both sides over σ, then what is expected of blur and gloss, and known radii."""
    parts = [_of_side(s, x[4 * k : 4 * k + 4], x[BLUR], x[GLOSS + k]) for k, s in enumerate(sides)]
    blur = [(x[BLUR] - expected.blur_px) / expected.sigma_blur_px]
    known: Array | list[float] = [] if expected.radii_mm is None else (x[list(_RADII)] - expected.radii_mm) / KNOWN_MM
    return np.concatenate([*parts, blur, x[GLOSS:] / _GLOSS_ERROR, known])


def _jacobian(x: Array, sides: list[_Side], expected: _Expected) -> Array:
    """Central differences of `_residuals`, each side by its own parameters."""
    rows = [3 * len(s.index) for s in sides]
    out = np.zeros((sum(rows) + expected.rows, len(x)))
    for k, side in enumerate(sides):
        mine = slice(0, rows[0]) if k == 0 else slice(rows[0], rows[0] + rows[1])
        for column, step in zip((*range(4 * k, 4 * k + 4), BLUR), _STEPS, strict=True):
            h = np.zeros(len(x))
            h[column] = step
            high, low = (_of_side(side, y[4 * k : 4 * k + 4], y[BLUR], y[GLOSS + k]) for y in (x + h, x - h))
            out[mine, column] = (high - low) / (2 * step)
        high, low = (_of_side(side, x[4 * k : 4 * k + 4], x[BLUR], x[GLOSS + k] + h) for h in (0.5, -0.5))
        out[mine, GLOSS + k] = high - low  # linear
    first = sum(rows)
    out[first, BLUR] = 1 / expected.sigma_blur_px
    out[[first + 1, first + 2], [GLOSS, GLOSS + 1]] = 1 / _GLOSS_ERROR
    if expected.radii_mm is not None:
        out[[first + 3, first + 4], _RADII] = 1 / KNOWN_MM
    return out


def _of_side(side: _Side, p: Array, blur: float, gloss: float) -> Array:
    seen, s, n = side.light(p, blur), side.sections, side.on_face
    width = s.width_px**2 - seen[:, SPREAD]
    light = s.log_light - np.log(np.maximum(seen[:, LIGHT], 1e-6))
    light -= gloss * (1 - np.exp(-((seen[:, TURN] / _GLOSS_RAD) ** 2)))
    width, light = width - np.median(width[:n]), light - np.median(light[:n])
    off = [side.use * seen[:, MEAN], side.bent * width, side.bent * light]
    return np.concatenate(np.array(off) / side.sigma)


def _edge(side: _Side, x: Array, covariance: Array, k: int) -> PanelEdge:
    p = x[4 * k : 4 * k + 4]
    own = slice(4 * k, 4 * k + 4)
    off = _of_side(side, p, x[BLUR], x[GLOSS + k])
    chi2 = float(np.sum(off**2)) / max(int(np.sum(off != 0)) - 5, 1)
    arc = side.light(p, x[BLUR])[side.use, TURN].max(initial=0.0)
    return replace(
        side.edge, parameters=p, covariance=covariance[own, own], used=np.sort(side.index[side.use]),
        arc_rad=float(arc), chi2_per_dof=chi2,
    )  # fmt: skip
