"""Profiles and poses out of step: tried where data on surfaces contradict one another, each with a neighbour's row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.stages.preparation import prepare
from calib.stages.setup import Prepared
from geometry import Frame, Surface, target_at

_FEWEST = 6  # frames that would not agree by chance
_NEIGHBOURS = ((1, "before"), (-1, "after"))
_AGREE = ("ok", "model_misfit", "weak")
_CONTRADICTING = ("not_converged", "outliers")


def out_of_step(prepared: Prepared) -> str:
    """A sentence where everything agrees once every profile goes with the row before or after its own, else nothing."""
    given = tuple(f for f in prepared.given if f.role == "calibrate")
    if not all(isinstance(target_at(prepared.setup.target, f.location), Surface) for f in given):
        return ""
    found = _whole_out_of_step(prepared, given) or _out_of_step_from_somewhere(prepared, given)
    check = "check the profile column of frames.csv, and what the controller logs first, the pose or the profile"
    return f"{found} all agree; {check}" if found else ""


def _whole_out_of_step(prepared: Prepared, given: tuple[Frame, ...]) -> str:
    """A sentence's beginning where all rows are."""
    for by, row in _NEIGHBOURS:
        moved = _moved(given, by)
        if len(moved) >= _FEWEST and prepare(prepared.setup, moved).solved.verdict.code in _AGREE:
            return f"profiles and poses are out of step: with every profile taken with the row {row} its own"
    return ""


def _out_of_step_from_somewhere(prepared: Prepared, given: tuple[Frame, ...]) -> str:
    """A sentence's beginning where rows are from one frame on: the longest run from the first that agrees ends there.

    The first row of the others may agree with it by chance, or the last of its own with none.
    """
    first = _agreeing_run(prepared, given)
    for start in (first, first - 1, first + 1):
        for by, row in _NEIGHBOURS:
            moved = _moved(given[start:], by)
            if start < _FEWEST or len(moved) < 2:
                continue
            if prepare(prepared.setup, (*given[:start], *moved)).solved.verdict.code in _AGREE:
                return (
                    f"from frame {given[start].number} on profiles and poses are out of step: with every profile from "
                    f"there on taken with the row {row} its own"
                )
    return ""


def _agreeing_run(prepared: Prepared, given: tuple[Frame, ...]) -> int:
    """How many frames, from the first on, contradict one another in nothing."""
    low, high = min(_FEWEST, len(given)), len(given)  # the run is at least ``low`` long, shorter than ``high``
    while high - low > 1:
        middle = (low + high) // 2
        solved = prepare(prepared.setup, given[:middle]).solved
        lost = solved.solution is not None and np.any(solved.solution.outlier | solved.solution.frame_outlier[:, None])
        low, high = (low, middle) if lost or solved.verdict.code in _CONTRADICTING else (middle, high)
    return low


def _moved(frames: tuple[Frame, ...], by: int) -> tuple[Frame, ...]:
    """The rows with the profile of the row that stands ``by`` rows after them (before them where negative).

    Less those whose profile was of another location: whether the place is the row's or the profile's is not known.
    """
    rows = frames[: len(frames) - by] if by > 0 else frames[-by:]
    seen = frames[by:] if by > 0 else frames[: len(frames) + by]
    return tuple(
        replace(row, axis=f.axis, points=f.points, n_points=f.n_points, reason=f.reason, labels_given=f.labels_given)
        for row, f in zip(rows, seen, strict=True)
        if row.location == f.location
    )
