"""How good one frame's points are [mm]: against truth where there is one, else by the jig's own consistency."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from geometry import SurfacePoints, distance_to_line
from jig_cad import Jig
from workbench.window.engine import Labels
from workbench.window.truth import VISIBLE, TrueString, compare

MISS_MM = (
    0.5  # what a missed or false point costs, and the most that a found one can: far beyond any good point's error
)


@dataclass(frozen=True)
class FrameScore:
    """One frame. ``cost_mm2``: squared errors with misses and false points at MISS_MM²; over ``wanted`` points.

    square_mm2, measured: squared errors of the points that were found, and their number. mislabelled are false too.
    """

    cost_mm2: float
    wanted: int
    square_mm2: float
    measured: int
    missed: int
    false: int


@dataclass(frozen=True)
class Score:
    """Figures over frames. ``loss_mm``: what the search minimises; ``rms_mm``: of the points that were found."""

    loss_mm: float
    rms_mm: float
    wanted: int
    missed: int
    false: int


def against_truth(strings: Iterable[TrueString], points: SurfacePoints, labels: Labels | None) -> FrameScore:
    """Errors of the string's axis (of the lit surface where nothing is labelled) against the true points."""
    compared = compare(strings, points, labels)
    visible = [m for m in compared.matches if m.string.visible >= VISIBLE]
    right = [m for m in visible if m.error_mm is not None and not m.mislabelled and (labels is None or m.of == "axis")]
    squares = np.array([m.error_mm for m in right], dtype=float).reshape(-1, 2)
    square = np.sum(squares**2, axis=1)
    wrong = len(compared.false_spots) + sum(m.mislabelled for m in compared.matches)
    missed = len(visible) - len(right)
    cost = float(np.minimum(square, MISS_MM**2).sum()) + (missed + wrong) * MISS_MM**2
    return FrameScore(cost, len(visible), float(square.sum()), len(right), missed, wrong)


def by_consistency(jig: Jig, labels: Labels) -> FrameScore:
    """Perpendicular distances of the axis points from the strings of the frame's own pose; absent strings are missed.

    Two coordinates a point are measured, six numbers of the pose fitted: the squares are scaled to all of them.
    """
    strings, n = len(jig.strings), len(labels.axis)
    pose = labels.T_sensor_jig
    if pose is None or n <= 3:
        return FrameScore(strings * MISS_MM**2, strings, 0.0, 0, strings, 0)
    index = [jig.strings.index(label) for label in labels.axis.label]
    distance = distance_to_line(labels.axis.xyz_mm, pose @ jig.starts[index], jig.directions[index] @ pose.R.T)
    square = np.asarray(distance) ** 2 * (2 * n / (2 * n - 6))
    missed = strings - n
    cost = float(np.minimum(square, MISS_MM**2).sum()) + missed * MISS_MM**2
    return FrameScore(cost, strings, float(square.sum()), n, missed, 0)


def total(scores: Iterable[FrameScore]) -> Score:
    """Figures over frames."""
    frames = list(scores)
    wanted, measured = sum(f.wanted for f in frames), sum(f.measured for f in frames)
    cost, square = sum(f.cost_mm2 for f in frames), sum(f.square_mm2 for f in frames)
    loss = float(np.sqrt(cost / wanted)) if wanted else float("nan")
    rms = float(np.sqrt(square / measured)) if measured else float("nan")
    return Score(loss, rms, wanted, sum(f.missed for f in frames), sum(f.false for f in frames))
