"""Which points of a profile lie on the standard: found by search, then *all* between the first and the last of them.

The search leaves out what scatters; a test must not. So all that lies between the ends of an arc or a stretch counts,
but for long runs that are another thing, which is said.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction import Circle, Line, find_target_points
from workbench.accept.recorded import PlacedProfile, Progress

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


OBJECT_RUN = 20  # neighbours in a row off the curve: something else stands there, which is no scatter


@dataclass(frozen=True, eq=False)
class Stretch:
    """Points (N, 2) of a profile on a standard, the curve that they were found on, and what was left out between."""

    of: PlacedProfile
    yz_mm: Array
    curve: Circle | Line
    other: int = 0

    @property
    def points_mm(self) -> Array:
        """In the scan's frame (N, 3)."""
        return self.of.in_scan(self.yz_mm)


def other_notes(stretches: Sequence[Stretch]) -> list[str]:
    """What of the profiles between a standard's ends was taken for something else."""
    n = sum(s.other for s in stretches)
    text = (
        f"{n} points between the standard's ends, in runs of {OBJECT_RUN} and more off it, are taken for another object"
    )
    return [text] if n else []


def told(profiles: Sequence[PlacedProfile], progress: Progress | None) -> Iterator[PlacedProfile]:
    """The profiles, each told when it is done."""
    for k, placed in enumerate(profiles):
        yield placed
        if progress is not None:
            progress(k + 1, len(profiles))


def arcs(
    profiles: Sequence[PlacedProfile],
    diameters_mm: tuple[float, ...],
    zone_deg: float | None,
    progress: Progress | None = None,
) -> tuple[list[Stretch], list[str]]:
    """Arcs of balls, with a sentence for each profile without one.

    zone_deg: points up to so far from the section's apex, towards the sensor, in place of all between the arc's ends.
    """
    kind = "sphere" if len(diameters_mm) == 1 else "balls"
    out: list[Stretch] = []
    lost: list[str] = []
    for placed in told(profiles, progress):
        found = find_target_points(placed.profile, kind, diameters_mm)
        if found.reason is not None:
            lost.append(f"{placed.name}: {found.text}")
            continue
        for k, curve in enumerate(found.curves):
            mine = found.yz_mm[found.feature == k]
            if isinstance(curve, Circle) and len(mine):
                bulge = -1.0 if float(np.mean(mine[:, 1])) < curve.centre_mm[1] else 1.0
                out.append(_all_of(placed, found.index[found.feature == k], curve, _zone(curve, bulge, zone_deg)))
    return out, lost


def _zone(curve: Circle, bulge: float, zone_deg: float | None) -> Callable[[Array], Mask] | None:
    if zone_deg is None:
        return None

    def within(yz: Array) -> Mask:
        off = yz - curve.centre_mm
        slope = np.rad2deg(np.arctan2(np.abs(off[:, 0]), bulge * off[:, 1]))
        return np.asarray((slope <= zone_deg) & (np.hypot(*off.T) < 2 * curve.radius_mm))

    return within


def _all_of(
    placed: PlacedProfile, index: Index, curve: Circle | Line, zone: Callable[[Array], Mask] | None = None
) -> Stretch:
    """All points between the first and the last one found, or in the zone, but for what stands there as an object."""
    yz = placed.profile.yz_mm
    found = np.zeros(len(yz), dtype=bool)
    found[index] = True
    order = np.argsort(yz[:, 0], kind="stable")
    yz, found = yz[order], found[order]
    if zone is None:
        low, high = yz[found, 0].min(), yz[found, 0].max()
        inside = (yz[:, 0] >= low) & (yz[:, 0] <= high)
    else:
        inside = zone(yz)
    yz, found = yz[inside], found[inside]
    edges = np.flatnonzero(np.diff(np.concatenate([[True], found, [True]]).astype(np.int8)))
    other = np.zeros(len(yz), dtype=bool)
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        other[first:last] = last - first >= OBJECT_RUN
    return Stretch(placed, yz[~other], curve, int(np.count_nonzero(other)))


def straights(profiles: Sequence[PlacedProfile], progress: Progress | None = None) -> tuple[list[Stretch], list[str]]:
    """Straight stretches, the longest of each profile, with a sentence for each profile without one."""
    out: list[Stretch] = []
    lost: list[str] = []
    for placed in told(profiles, progress):
        found = find_target_points(placed.profile, "plane")
        if found.reason is not None:
            lost.append(f"{placed.name}: {found.text}")
            continue
        out.append(_all_of(placed, found.index, found.curves[0]))
    return out, lost
