"""Gap and flush as makers and their gauges define them: each as two points of either panel, by the fitted edges.

x is the direction of the reference face, n its normal towards the sensor. Every definition gives the two points between
which the gap runs, and the point of the other panel whose height over the reference face is the flush:

- extreme: the bends' points that reach furthest into the gap; the other panel's face at its bend's beginning.
- tangent: where each surface has turned by `tangent_deg` from its face, 0 where the bend begins.
- edge: where each face, extended, meets the line square to it at the bend's end: the edge if it were sharp.
- fixed_radius: as extreme, of circles whose radii are known (`fixed_radius_mm`) and not fitted.
- gauge: what a mechanical gauge finds: a parallel feeler that enters to `gauge_depth_mm` below the reference face, and
  a dial gauge that stands on that face, its pin `gauge_offset_mm` inside the other panel's edge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from extraction.config import GapDefinition, GapFlushConfig
from extraction.gapflush.edge import PanelEdge

Array = NDArray[np.float64]

_STEP = 1e-6  # of the numeric derivative, mm or rad


@dataclass(frozen=True, eq=False)
class Lengths:
    """Gap and flush by one definition, mm.

    covariance_mm2 (2, 2) of both. gap_points (2, 2): left, right; flush_points (2, 2): the other panel's point and its
    foot on the reference face.
    """

    gap_mm: float
    flush_mm: float
    covariance_mm2: Array
    gap_points: Array
    flush_points: Array

    @property
    def sigma_gap_mm(self) -> float:
        """Standard deviation of the gap."""
        return float(np.sqrt(self.covariance_mm2[0, 0]))

    @property
    def sigma_flush_mm(self) -> float:
        """Standard deviation of the flush."""
        return float(np.sqrt(self.covariance_mm2[1, 1]))


@dataclass(frozen=True, eq=False)
class _Face:
    """The reference face: its direction x, its normal n towards the sensor, and a point of it."""

    x: Array
    n: Array
    base: Array

    def depth(self, point: Array) -> float:
        """Of a point below the face."""
        return float(-(point - self.base) @ self.n)


def lengths(
    definition: GapDefinition, left: PanelEdge, right: PanelEdge, joint: Array, config: GapFlushConfig
) -> Lengths | None:
    """Gap and flush by a definition; None where the panels have no such points.

    joint: covariance (8, 8) of both edges' parameters.
    """
    both = np.concatenate([left.parameters, right.parameters])

    def measured(p: Array) -> Array:
        return _evaluate(definition, left, right, p, config)

    at = measured(both)
    if not np.isfinite(at).all():
        return None
    jacobian = np.column_stack([measured(both + h)[:2] - measured(both - h)[:2] for h in _STEP * np.eye(8)])
    jacobian /= 2 * _STEP
    if not np.isfinite(jacobian).all():
        return None
    return Lengths(
        float(at[0]), float(at[1]), jacobian @ joint @ jacobian.T, at[2:6].reshape(2, 2), at[6:].reshape(2, 2)
    )


def _evaluate(
    definition: GapDefinition, left: PanelEdge, right: PanelEdge, both: Array, config: GapFlushConfig
) -> Array:
    """Gap, flush, then the two gap points and the two flush points, flat (10,)."""
    p, q = both[:4], both[4:]
    here, other, a, b = (left, right, p, q) if config.reference == "left" else (right, left, q, p)
    x = here.face_direction(a)
    face = _Face(x, np.array([x[1], -x[0]]), here.tangent_point(a))
    of_gap, of_flush = _POINTS[definition]
    ends = np.array([of_gap(left, p, face, config), of_gap(right, q, face, config)])
    point = of_flush(other, b, face, config)
    flush = (point - face.base) @ face.n
    apart = ends[1] - ends[0]
    gap = apart @ face.x if config.axis == "face" else float(np.hypot(*apart))
    return np.concatenate([[gap, flush], ends.ravel(), point, point - flush * face.n])


def _extreme(edge: PanelEdge, p: Array, face: _Face, _: GapFlushConfig) -> Array:
    return edge.extreme_point(p, edge.side * face.x)


def _bend_begins(edge: PanelEdge, p: Array, _: _Face, __: GapFlushConfig) -> Array:
    return edge.tangent_point(p)


def _tangent(edge: PanelEdge, p: Array, _: _Face, config: GapFlushConfig) -> Array:
    return edge.bend_point(p, float(np.deg2rad(config.tangent_deg)))


def _edge(edge: PanelEdge, p: Array, _: _Face, __: GapFlushConfig) -> Array:
    return edge.sharp_point(p)


def _feeler(edge: PanelEdge, p: Array, face: _Face, config: GapFlushConfig) -> Array:
    """Where the side of a feeler whose tip is at the gauge's depth touches the bend; NaN where it does not reach it."""
    centre, radius = edge.centre(p), float(p[3])
    above = face.depth(centre) - float(config.gauge_depth_mm or 0.0)
    if above <= 0:
        return edge.extreme_point(p, edge.side * face.x)
    if above >= radius:
        return np.full(2, np.nan)
    return np.asarray(centre + edge.side * np.sqrt(radius**2 - above**2) * face.x + above * face.n)


def _pin(edge: PanelEdge, p: Array, _: _Face, config: GapFlushConfig) -> Array:
    """What a pin at the gauge's offset inside the edge touches: the face, or the bend where the offset is less."""
    radius, offset = float(p[3]), float(config.gauge_offset_mm or 0.0)
    if offset < radius:
        return edge.bend_point(p, float(np.arcsin((radius - offset) / radius)))
    return np.asarray(edge.sharp_point(p) - edge.side * offset * edge.face_direction(p))


_Point = Callable[[PanelEdge, Array, _Face, GapFlushConfig], Array]
_POINTS: dict[GapDefinition, tuple[_Point, _Point]] = {
    "extreme": (_extreme, _bend_begins),
    "tangent": (_tangent, _tangent),
    "edge": (_edge, _edge),
    "fixed_radius": (_extreme, _bend_begins),
    "gauge": (_feeler, _pin),
}


def asked_definitions(config: GapFlushConfig) -> tuple[GapDefinition, ...]:
    """All that the settings say enough for: circles of known radius and a gauge need theirs."""
    out: list[GapDefinition] = ["extreme", "tangent", "edge"]
    if config.fixed_radius_mm is not None:
        out.append("fixed_radius")
    if config.gauge_depth_mm is not None and config.gauge_offset_mm is not None:
        out.append("gauge")
    return tuple(out)


def mastered(found: Lengths, on_master: Lengths, true_mm: tuple[float, float], uncertainty_mm: float) -> Lengths:
    """Gap and flush corrected by what the same sensor measures on a master.

    true_mm: the master's gap and flush by its certificate. uncertainty_mm: expanded, k = 2, of both. The two
    measurements' errors are taken as independent; what they share cancels, so that σ is an upper bound.
    """
    return replace(
        found,
        gap_mm=found.gap_mm - on_master.gap_mm + true_mm[0],
        flush_mm=found.flush_mm - on_master.flush_mm + true_mm[1],
        covariance_mm2=found.covariance_mm2 + on_master.covariance_mm2 + np.eye(2) * (uncertainty_mm / 2) ** 2,
    )
