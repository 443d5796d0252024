"""How good one frame's points are [mm]: against truth where there is one, else by the jig's own consistency."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from calib.label import LabelledFrame
from geometry import distance_to_line
from jig_cad import Jig
from workbench.compare import Comparison, errors_mm

# what a missed or false point costs, and the most that a found one can: some ten times a good point's error
LOSS_DECIMALS = 13  # of mm: the search compares losses, and rounding must not be what differs
MISS_MM = 0.5


@dataclass(frozen=True)
class FrameCost:
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


def against_truth(compared: Comparison) -> FrameCost:
    """Errors of the string's axis (of the lit surface where no jig is known) against the true points."""
    square = np.sum(errors_mm([compared]) ** 2, axis=1)
    visible, found = len(compared.visible), len(compared.found)
    wrong = len(compared.false_points) + compared.mislabelled
    cost = float(np.minimum(square, MISS_MM**2).sum()) + (visible - found + wrong) * MISS_MM**2
    return FrameCost(cost, visible, float(square.sum()), found, visible - found, wrong)


def by_consistency(jig: Jig, labels: LabelledFrame) -> FrameCost:
    """Perpendicular distances of the axis points from the strings of the frame's own pose; absent strings are missed.

    Two coordinates a point are measured, six numbers of the pose fitted: the squares are scaled to all of them.
    """
    strings, n = len(jig.strings), len(labels.axis)
    pose = labels.T_sensor_jig
    if pose is None or n <= 3:
        return FrameCost(strings * MISS_MM**2, strings, 0.0, 0, strings, 0)
    index = [jig.strings.index(label) for label in labels.axis.label]
    distance = distance_to_line(labels.axis.xyz_mm, pose @ jig.starts[index], jig.directions[index] @ pose.R.T)
    square = np.asarray(distance) ** 2 * (2 * n / (2 * n - 6))
    missed = strings - n
    cost = float(np.minimum(square, MISS_MM**2).sum()) + missed * MISS_MM**2
    return FrameCost(cost, strings, float(square.sum()), n, missed, 0)


def total(scores: Iterable[FrameCost]) -> Score:
    """Figures over frames."""
    frames = list(scores)
    wanted, measured = sum(f.wanted for f in frames), sum(f.measured for f in frames)
    cost, square = sum(f.cost_mm2 for f in frames), sum(f.square_mm2 for f in frames)
    loss = round(float(np.sqrt(cost / wanted)), LOSS_DECIMALS) if wanted else float("nan")
    rms = float(np.sqrt(square / measured)) if measured else float("nan")
    return Score(loss, rms, wanted, sum(f.missed for f in frames), sum(f.false for f in frames))
