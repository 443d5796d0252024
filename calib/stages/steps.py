"""Profiles and poses out of step: tried where data on surfaces contradict one another, each with a neighbour's row."""

from __future__ import annotations

from dataclasses import replace

from calib.stages.preparation import prepare
from calib.stages.setup import Prepared
from geometry import Frame, Surface, target_at

_FEWEST = 6  # frames that would not agree by chance


def out_of_step(prepared: Prepared) -> str:
    """A sentence where everything agrees once every profile goes with the row before or after its own, else nothing."""
    given = tuple(f for f in prepared.given if f.role == "calibrate")
    if not all(isinstance(target_at(prepared.setup.target, f.location), Surface) for f in given):
        return ""
    for by, row in ((1, "before"), (-1, "after")):
        moved = _moved(given, by)
        if len(moved) < _FEWEST:
            return ""
        if prepare(prepared.setup, moved).solved.verdict.code in ("ok", "model_misfit"):
            return (
                f"profiles and poses are out of step: with every profile taken with the row {row} its own all agree; "
                "check the profile column of frames.csv, and what the controller logs first, the pose or the profile"
            )
    return ""


def _moved(frames: tuple[Frame, ...], by: int) -> tuple[Frame, ...]:
    """The rows with the profile of the row that stands ``by`` rows after them (before them where negative)."""
    rows = frames[: len(frames) - by] if by > 0 else frames[-by:]
    seen = frames[by:] if by > 0 else frames[: len(frames) + by]
    return tuple(
        replace(row, axis=f.axis, points=f.points, n_points=f.n_points, reason=f.reason, labels_given=f.labels_given)
        for row, f in zip(rows, seen, strict=True)
    )
