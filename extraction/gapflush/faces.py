"""The straight faces of a profile, and the two of them that face each other across a gap."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.config import GapFlushConfig
from geometry import NoAnswerError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MOST_FACES = 12  # looked for in a profile, longest first: two panels, and what stands around them
_FEWEST_POINTS = 10  # of a straight run: its direction to a third of the points' scatter over its length


@dataclass(frozen=True, eq=False)
class PanelFace:
    """A straight stretch of a profile.

    origin, direction: a point and the unit direction (+y) of its line (2,) in (y, z). first, last: indices of its ends.
    """

    origin: Array
    direction: Array
    first: int
    last: int

    @property
    def normal(self) -> Array:
        """Unit normal (2,) away from the sensor, into the part."""
        return np.array([-self.direction[1], self.direction[0]])

    def depth(self, yz: Array) -> Array:
        """Signed distance (N,) of points (N, 2) from the line, positive away from the sensor [mm]."""
        return np.asarray((yz - self.origin) @ self.normal)


def find_faces(yz: Array, tolerance: float, config: GapFlushConfig) -> list[PanelFace]:
    """Straight runs of at least ``min_face_mm`` in a profile ordered by y, longest first, none overlapping.

    Lines are tried through every window of that length; a run ends at a point off the line and does not return.
    """
    free = np.ones(len(yz), dtype=bool)
    faces: list[PanelFace] = []
    windows = _windows(yz[:, 0], config.min_face_mm)
    while len(faces) < _MOST_FACES:
        runs = [_run(yz, free, a, b, tolerance, config) for a, b in windows if free[a:b].all()]
        best = max((r for r in runs if r is not None), key=lambda f: yz[f.last, 0] - yz[f.first, 0], default=None)
        if best is None:
            return faces
        faces.append(best)
        free[best.first : best.last + 1] = False
    return faces


def facing_pair(
    yz: Array, faces: list[PanelFace], tolerance: float, config: GapFlushConfig
) -> tuple[PanelFace, PanelFace]:
    """The left and right face of the gap: the longest neighbours with nothing, or only deeper points, between them.

    NoAnswerError says what is missing.
    """
    if len(faces) == 0:
        raise NoAnswerError(
            f"no panel in the profile: no straight stretch of {config.min_face_mm:g} mm within {tolerance:.3g} mm"
        )
    ordered = sorted(faces, key=lambda face: face.first)
    pairs = [
        (a, b) for i, a in enumerate(ordered) for b in ordered[i + 1 :] if _face_each_other(yz, a, b, tolerance, config)
    ]
    if not pairs:
        what = "only one panel in the profile" if len(faces) == 1 else "no edges in the profile"
        raise NoAnswerError(
            f"{what}: two straight stretches of {config.min_face_mm:g} mm with a gap of {config.min_gap_mm:g} … "
            f"{config.max_gap_mm:g} mm between them are needed"
        )
    return max(pairs, key=lambda pair: min(_length(yz, pair[0]), _length(yz, pair[1])))


def fit_line(yz: Array) -> tuple[Array, Array]:
    """Centroid and unit direction (+y) of the total-least-squares line through points (N, 2)."""
    centre = yz.mean(axis=0)
    direction = np.linalg.svd(yz - centre, full_matrices=False)[2][0]
    return centre, direction if direction[0] >= 0 else -direction


def _windows(y: Array, length: float) -> list[tuple[int, int]]:
    """Index ranges [a, b) of that length in mm, each overlapping the next by half."""
    starts = np.searchsorted(y, np.arange(y[0], y[-1] - length, length / 2))
    ends = np.searchsorted(y, y[starts] + length)
    return [(int(a), int(b)) for a, b in zip(starts, ends, strict=True) if b - a >= _FEWEST_POINTS]


def _run(yz: Array, free: Mask, a: int, b: int, tolerance: float, config: GapFlushConfig) -> PanelFace | None:
    """The straight run around the window [a, b); None where the window is not straight or the run too short."""
    part = yz[a:b]
    for _ in range(3):  # trim what is off the line
        origin, direction = fit_line(part)
        off = np.abs((part - origin) @ [-direction[1], direction[0]])
        if np.median(off) > 0.5 * tolerance:
            return None
        part = part[off <= max(3 * float(np.median(off)), 0.2 * tolerance)]
    first, last = a, b - 1
    for _ in range(3):  # grow, refit
        face = PanelFace(origin, direction, first, last)
        straight = (np.abs(face.depth(yz)) <= tolerance) & free
        first, last = _contiguous(yz, straight, (a + b) // 2, config.max_step_mm)
        if last - first < _FEWEST_POINTS or yz[last, 0] - yz[first, 0] < config.min_face_mm:
            return None
        inside = np.flatnonzero(straight[first : last + 1]) + first
        origin, direction = fit_line(yz[inside])
    return PanelFace(origin, direction, first, last)


def _contiguous(yz: Array, good: Mask, middle: int, max_step: float) -> tuple[int, int]:
    """Ends of the run of good points around ``middle`` that has no hole longer than ``max_step`` mm."""
    index = np.flatnonzero(good)
    if len(index) == 0:
        return middle, middle
    at = int(np.argmin(np.abs(index - middle)))
    breaks = np.diff(yz[index, 0]) > max_step
    left = np.flatnonzero(breaks[:at])
    right = np.flatnonzero(breaks[at:])
    return int(index[left[-1] + 1 if len(left) else 0]), int(index[at + right[0]] if len(right) else index[-1])


def _length(yz: Array, face: PanelFace) -> float:
    return float(yz[face.last, 0] - yz[face.first, 0])


def _face_each_other(yz: Array, a: PanelFace, b: PanelFace, tolerance: float, config: GapFlushConfig) -> bool:
    """Whether a gap lies between two faces: wide enough, faces nearly parallel, all points between deeper than both."""
    width = yz[b.first, 0] - yz[a.last, 0]
    if not config.min_gap_mm <= width <= config.max_gap_mm + 2 * config.max_radius_mm:
        return False
    if a.direction @ b.direction < np.cos(np.deg2rad(config.max_angle_deg)):
        return False
    between = yz[a.last + 1 : b.first]
    depth = np.column_stack([a.depth(between), b.depth(between)])
    # at a step in height one panel's edge lies above the other's face, but always below its own
    if len(between) and np.mean(depth.max(axis=1) > -tolerance) < 0.95:
        return False
    hole = np.max(np.diff(yz[a.last : b.first + 1, 0]))
    return bool(hole >= config.min_gap_mm or np.any(depth.min(axis=1) > 2 * tolerance))
