"""The points of a frame beside the strings that it truly shows: which point shows which string, and how far off.

The one matcher of validation, window, tuning and campaigns.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry import AxisPoints, SurfacePoints

Array = NDArray[np.float64]

VISIBLE = 0.9  # docs/formats.md: "visible" in every figure means at least this fraction of the lit patch
GATE_PX = 8.0  # a point farther than this from every string's image shows no string: two to three widths of a spot
GATE_MM = 1.0  # the same where a point has no pixel: 8 px of the nominal sensor


class KnownString(Protocol):
    """One string as the emulator or a truth.json knows it; None or NaN where nothing of it is seen."""

    @property
    def label(self) -> str:
        """The string's name."""

    @property
    def axis_mm(self) -> ArrayLike | None:
        """Axis point (y, z) [mm]."""

    @property
    def surface_mm(self) -> ArrayLike | None:
        """Centroid (y, z) of the lit surface [mm]."""

    @property
    def image_px(self) -> ArrayLike | None:
        """Centroid (u, v) of the ideal image."""

    @property
    def visible_fraction(self) -> float:
        """Part of the lit patch that is seen."""


Pair = tuple[float, float]


@dataclass(frozen=True)
class TrueString:
    """One string that a frame shows: its name, its three true points, and which part of its lit patch is seen."""

    label: str
    axis_mm: Pair
    surface_mm: Pair
    image_px: Pair
    visible_fraction: float

    @property
    def visible(self) -> bool:
        """Whether it must be found; a string seen in part may be found or missing."""
        return self.visible_fraction >= VISIBLE


def true_strings(truth: Iterable[KnownString]) -> tuple[TrueString, ...]:
    """The strings that have an image; the others, outside the image or the sheet, can not be found.

    Parameters
    ----------
    truth
        Strings of a rendered frame or of a truth.json, with None or NaN where nothing is seen.

    Returns
    -------
    tuple of TrueString
        In the given order.

    """
    found = []
    for s in truth:
        axis, surface, image = (_pair(v) for v in (s.axis_mm, s.surface_mm, s.image_px))
        if axis is not None and surface is not None and image is not None:
            found.append(TrueString(s.label, axis, surface, image, float(s.visible_fraction)))
    return tuple(found)


@dataclass(frozen=True, eq=False)
class NamedPoints:
    """The points of one frame (N).

    label: the string's name, "" where there is none. uv_px: (N, 2), NaN where unknown. yz_mm: (N, 2), of the string's
    axis where there is a name, else of the lit surface.
    """

    label: tuple[str, ...]
    uv_px: Array
    yz_mm: Array


def named_points(points: SurfacePoints, axis: AxisPoints | None) -> NamedPoints:
    """The spots in their order, with the names of ``axis``; behind them axis points that belong to no spot.

    Parameters
    ----------
    points
        Spots (N) with pixels and points of the lit surface.
    axis
        Labelled axis points (K), each with the number of its spot or -1; None where no jig is known.

    Returns
    -------
    NamedPoints
        N rows and one for every axis point without a spot, whose pixel is NaN.

    """
    axis = AxisPoints.empty() if axis is None else axis
    label, yz_mm = [""] * len(points), points.yz_mm.copy()
    alone = np.flatnonzero(axis.spot < 0)
    for k in np.flatnonzero(axis.spot >= 0):
        label[axis.spot[k]], yz_mm[axis.spot[k]] = axis.label[k], axis.yz_mm[k]
    names = (*label, *(axis.label[k] for k in alone))
    uv_px = np.concatenate([points.uv_px, np.full((len(alone), 2), np.nan)])
    return NamedPoints(names, uv_px, np.concatenate([yz_mm, axis.yz_mm[alone]]))


@dataclass(frozen=True)
class Match:
    """One true string and the point that shows it (``point`` -1: none). Errors are found minus true.

    error_mm: (y, z), of the string's axis where the point has a name, else of the lit surface.
    """

    string: TrueString
    point: int = -1
    error_px: Pair | None = None
    error_mm: Pair | None = None
    of: str = ""  # "axis", "surface" or ""
    mislabelled: bool = False


@dataclass(frozen=True)
class Comparison:
    """One frame against its truth: every string with an image, and the counted points that show none.

    labelled: whether the strings' names are known; then only points with a name count.
    """

    matches: tuple[Match, ...]
    false_points: tuple[int, ...]
    labelled: bool

    @property
    def visible(self) -> tuple[Match, ...]:
        """The strings that must be found."""
        return tuple(m for m in self.matches if m.string.visible)

    @property
    def found(self) -> tuple[Match, ...]:
        """Those of them that are, by a point of the right name: the ones whose errors count."""
        return tuple(m for m in self.visible if m.of == ("axis" if self.labelled else "surface") and not m.mislabelled)

    @property
    def mislabelled(self) -> int:
        """Points that show a string of another name."""
        return sum(m.mislabelled for m in self.matches)


def match(truth: Sequence[TrueString], points: NamedPoints, *, labelled: bool) -> Comparison:
    """Hold a frame's points against its strings: nearest pairs first, within the gate, each point and string used once.

    Parameters
    ----------
    truth
        The strings that the frame shows.
    points
        What was measured. Points with a name are matched first: they alone count where ``labelled``. The others are
        matched to the strings that are left, so that their errors can be shown.
    labelled
        Whether the names of the strings are known (a jig is). Without it every point counts, by its lit surface.

    Returns
    -------
    Comparison
        A counted point that no string is matched to is false. Of two points at one string the nearer one shows it.

    """
    distance = _distance(truth, points)
    named = np.array([bool(name) for name in points.label], dtype=bool)
    pairs: dict[int, int] = {}
    for group in (named, ~named):
        _pair_nearest(np.where(group, distance, np.inf), pairs)
    matches = tuple(_matched(s, pairs.get(i, -1), points) for i, s in enumerate(truth))
    shown = set(pairs.values())
    counted = np.flatnonzero(named) if labelled else range(len(points.label))
    return Comparison(matches, tuple(int(k) for k in counted if k not in shown), labelled)


def _distance(truth: Sequence[TrueString], points: NamedPoints) -> Array:
    """Distance (T, N) as a share of the gate, in the image where a point has a pixel, else in the laser plane."""
    images = np.array([s.image_px for s in truth]).reshape(-1, 1, 2)
    axes = np.array([s.axis_mm for s in truth]).reshape(-1, 1, 2)
    in_image = np.linalg.norm(images - points.uv_px[None], axis=2) / GATE_PX
    in_plane = np.linalg.norm(axes - points.yz_mm[None], axis=2) / GATE_MM
    share = np.where(np.isfinite(in_image), in_image, in_plane)
    return np.where(share <= 1, share, np.inf)


def _pair_nearest(distance: Array, pairs: dict[int, int]) -> None:
    """Add to ``pairs``, point by string, the nearest of what is left; equal distances by number."""
    used = set(pairs.values())
    for flat in np.argsort(distance, axis=None, kind="stable"):
        i, k = (int(n) for n in np.unravel_index(flat, distance.shape))
        if not np.isfinite(distance[i, k]):
            return
        if i not in pairs and k not in used:
            pairs[i] = k
            used.add(k)


def _matched(s: TrueString, point: int, points: NamedPoints) -> Match:
    if point < 0:
        return Match(s)
    name = points.label[point]
    true_mm = s.axis_mm if name else s.surface_mm
    error_px, error_mm = points.uv_px[point] - s.image_px, points.yz_mm[point] - true_mm
    of = "axis" if name else "surface"
    return Match(s, point, _floats(error_px), _floats(error_mm), of, bool(name) and name != s.label)


def _pair(values: ArrayLike | None) -> Pair | None:
    if values is None:
        return None
    array = np.asarray(values, dtype=float)
    return _floats(array) if np.all(np.isfinite(array)) else None


def _floats(values: Array) -> Pair:
    return float(values[0]), float(values[1])
