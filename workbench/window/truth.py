"""Found points against the truth of an emulated dataset: error vectors, bias, scatter, misses, false points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import SurfacePoints
from workbench.window.engine import Labels, finite

Array = NDArray[np.float64]

VISIBLE = 0.9  # docs/formats.md: "visible" in every figure means at least this fraction of the lit patch
GATE_PX = 8.0  # a spot further than this from every true spot is a false one


@dataclass(frozen=True)
class TrueString:
    """One string of one frame as it was rendered."""

    label: str
    axis_mm: tuple[float, float]
    surface_mm: tuple[float, float]
    image_px: tuple[float, float]
    visible: float


@dataclass(frozen=True)
class Match:
    """One true string and the spot that shows it (``spot`` -1: missed). Errors are found minus true.

    error_mm: (y, z), of the string's axis where the spot is labelled, else of its lit surface.
    """

    string: TrueString
    spot: int
    error_px: tuple[float, float] | None
    error_mm: tuple[float, float] | None
    of: str  # "axis", "surface" or ""
    mislabelled: bool


@dataclass(frozen=True)
class Comparison:
    """One frame against its truth. ``false_spots``: spots that show no string; with a jig, labelled ones alone."""

    matches: tuple[Match, ...]
    false_spots: tuple[int, ...]


def compare(strings: Iterable[TrueString], points: SurfacePoints, labels: Labels | None) -> Comparison:
    """Assign every spot to the nearest true string within GATE_PX, nearest pairs first, each used once."""
    truth = tuple(s for s in strings if np.all(np.isfinite(s.image_px)))
    pairs = _pairs(np.array([s.image_px for s in truth]).reshape(-1, 2), points.uv_px)
    label_of = {int(s): k for k, s in enumerate(labels.axis.spot)} if labels else {}
    matches = tuple(_match(s, pairs.get(i, -1), points, labels, label_of) for i, s in enumerate(truth))
    counted = range(len(points)) if labels is None else sorted(k for k in label_of if k >= 0)
    taken = set(pairs.values())
    return Comparison(matches, tuple(k for k in counted if k not in taken))


def _pairs(truth_px: Array, found_px: Array) -> dict[int, int]:
    """Index of the spot for every true string that has one."""
    if not len(truth_px) or not len(found_px):
        return {}
    distance = np.linalg.norm(truth_px[:, None] - found_px[None], axis=2)
    pairs: dict[int, int] = {}
    for flat in np.argsort(distance, axis=None):
        i, k = np.unravel_index(flat, distance.shape)
        if distance[i, k] > GATE_PX:
            break
        if int(i) not in pairs and int(k) not in pairs.values():
            pairs[int(i)] = int(k)
    return pairs


def _match(
    s: TrueString, spot: int, points: SurfacePoints, labels: Labels | None, label_of: Mapping[int, int]
) -> Match:
    if spot < 0:
        return Match(s, -1, None, None, "", False)
    du, dv = points.uv_px[spot] - s.image_px
    k = label_of.get(spot)
    if labels is None or k is None:
        dy, dz = points.yz_mm[spot] - s.surface_mm
        return Match(s, spot, (float(du), float(dv)), (float(dy), float(dz)), "surface", False)
    dy, dz = labels.axis.yz_mm[k] - s.axis_mm
    wrong = labels.axis.label[k] != s.label
    return Match(s, spot, (float(du), float(dv)), (float(dy), float(dz)), "axis", wrong)


@dataclass(frozen=True)
class Statistics:
    """Figures over frames: RMS, bias and scatter of the error [mm], and counts over the visible strings."""

    visible: int
    found: int
    missed: int
    false: int
    mislabelled: int
    rms_mm: float
    bias_mm: tuple[float, float]
    scatter_mm: tuple[float, float]


def summarise(comparisons: Iterable[Comparison], labelled: bool) -> Statistics:
    """Statistics over the visible strings. ``labelled``: only labelled spots count as found (a jig is known)."""
    everything = list(comparisons)
    visible = [m for c in everything for m in c.matches if m.string.visible >= VISIBLE]
    hit = [m for m in visible if m.error_mm is not None and (m.of == "axis" or not labelled)]
    errors = np.array([m.error_mm for m in hit if not m.mislabelled], dtype=float).reshape(-1, 2)
    nothing = np.full(2, np.nan)
    bias = errors.mean(axis=0) if len(errors) else nothing
    scatter = errors.std(axis=0) if len(errors) else nothing
    rms = float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))) if len(errors) else float("nan")
    wrong = sum(m.mislabelled for m in hit)
    false = sum(len(c.false_spots) for c in everything)
    return Statistics(len(visible), len(hit), len(visible) - len(hit), false, wrong, rms, _pair(bias), _pair(scatter))


def _pair(a: Array) -> tuple[float, float]:
    return float(a[0]), float(a[1])


def comparison_json(c: Comparison, labelled: bool) -> dict[str, Any]:
    """One frame's comparison for the page."""
    return {
        "strings": [
            {
                "label": m.string.label,
                "u": m.string.image_px[0],
                "v": m.string.image_px[1],
                "axis": list(m.string.axis_mm),
                "surface": list(m.string.surface_mm),
                "visible": m.string.visible,
                "spot": m.spot,
                "px": m.error_px,
                "mm": m.error_mm,
                "of": m.of,
                "mislabelled": m.mislabelled,
            }
            for m in c.matches
        ],
        "false": list(c.false_spots),
        "statistics": statistics_json(summarise([c], labelled)),
    }


def statistics_json(s: Statistics) -> dict[str, Any]:
    """Statistics for the page; null where there is no number."""
    return {
        "visible": s.visible,
        "found": s.found,
        "missed": s.missed,
        "false": s.false,
        "mislabelled": s.mislabelled,
        "rms": finite(s.rms_mm),
        "bias": [finite(x) for x in s.bias_mm],
        "scatter": [finite(x) for x in s.scatter_mm],
    }
