"""Anchors or balls as a measuring machine found them, in its own axes, laid onto the target as drawn."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from jig_cad.jig import Jig
from jig_cad.sphere import Balls, rigid_motion

Array = NDArray[np.float64]
T = TypeVar("T", Jig, Balls)

FARTHEST_MM = {"anchor": 2.0, "ball": 5.0}  # from its place as drawn: beyond it something is misnamed, or another part
CLEARLY = 0.2  # of the rms deviation that another naming or a mirrored frame leaves, to be what happened


@dataclass(frozen=True, eq=False)
class MeasuredTarget(Generic[T]):
    """The target with its anchors or centres as measured, and how far they lie from the drawing.

    deviation_mm: (N, 3) by ``names``, measured less drawn, in the target's axes after the best rigid motion.
    """

    target: T
    names: tuple[str, ...]
    deviation_mm: Array

    @property
    def rms_mm(self) -> float:
        """Of the deviations' lengths."""
        return float(np.sqrt(np.mean(np.sum(self.deviation_mm**2, axis=1))))


def measured_jig(jig: Jig, points_mm: Mapping[str, Array]) -> MeasuredTarget[Jig]:
    """The jig with its anchors as measured, in any right-handed axes.

    Parameters
    ----------
    jig
        As drawn.
    points_mm
        Every anchor at which a string ends, by its name.

    Returns
    -------
    MeasuredTarget
        The jig, its tolerance no longer in force, and the deviations from the drawing.

    Raises
    ------
    InputError
        Where an anchor lacks, is unknown, or lies so far off that names are swapped or the axes are left-handed.
    """
    used = tuple(jig.anchors[k] for k in jig.used_anchors)
    drawn = jig.nominal_anchors_mm[jig.used_anchors]
    there, deviation = _laid_onto("anchor", used, drawn, points_mm)
    anchors = jig.nominal_anchors_mm.copy()
    anchors[jig.used_anchors] = there
    return MeasuredTarget(replace(jig, anchors_mm=anchors, measured=True), used, deviation)


def measured_balls(
    balls: Balls, points_mm: Mapping[str, Array], diameters_mm: Mapping[str, float]
) -> MeasuredTarget[Balls]:
    """As `measured_jig`, of balls and their diameters where they were measured too."""
    there, deviation = _laid_onto("ball", balls.names, balls.centres_mm, points_mm)
    size = np.array([diameters_mm.get(n, d) for n, d in zip(balls.names, balls.diameters_mm, strict=True)])
    table = {n: (float(d), c) for n, d, c in zip(balls.names, size, there, strict=True)}
    return MeasuredTarget(Balls.of(table, balls.name), balls.names, deviation)


def _laid_onto(what: str, names: tuple[str, ...], drawn: Array, points_mm: Mapping[str, Array]) -> tuple[Array, Array]:
    """The points in the target's axes, and their deviations (N, 3)."""
    lacking = [n for n in names if n not in points_mm]
    if lacking:
        raise InputError(f"{what} {lacking[0]} was not measured: {', '.join(names)} are needed")
    points = np.array([points_mm[n] for n in names], dtype=float)
    there = rigid_motion(points, drawn) @ points
    deviation = there - drawn
    far = np.linalg.norm(deviation, axis=1)
    worst = int(np.argmax(far))
    if far[worst] > FARTHEST_MM[what]:
        hint = _what_happened(names, drawn, points, float(np.sqrt(np.mean(far**2))))
        raise InputError(
            f"{what} {names[worst]} was measured {far[worst]:.2f} mm from its place as drawn, "
            f"after the best rigid motion; {hint}"
        )
    return np.asarray(there), np.asarray(deviation)


def _what_happened(names: tuple[str, ...], drawn: Array, points: Array, rms: float) -> str:
    def left(p: Array) -> float:
        return float(np.sqrt(np.mean(np.sum((rigid_motion(p, drawn) @ p - drawn) ** 2, axis=1))))

    if left(points * [1, 1, -1]) < CLEARLY * rms:
        return "mirrored it fits: the measuring machine's axes are left-handed, or two names are swapped"
    for i, j in combinations(range(len(names)), 2):
        order = list(range(len(names)))
        order[i], order[j] = j, i
        if left(points[order]) < CLEARLY * rms:
            return f"with {names[i]} and {names[j]} the other way round it fits: their names are swapped"
    scale = float(np.linalg.norm(drawn - drawn.mean(axis=0)) / np.linalg.norm(points - points.mean(axis=0)))
    for unit, factor in (("metres", 1000.0), ("inches", 25.4), ("centimetres", 10.0)):
        if abs(scale / factor - 1) < 0.01:
            return f"its numbers are {unit}: millimetres are right"
    return "another target, or another drawing?"
