"""Leave-one-location-out: how well the other places predict the points of each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib import CalibConfig, CalibrationResult, Observations, calibrate
from geometry import NoAnswerError
from workbench.cell import FrameTable, Observed
from workbench.files import Cell


@dataclass(frozen=True)
class LeftOut:
    """One place, solved from the others. shift_mm, shift_deg: how far the SCP moves without it."""

    location: str
    point_rms_mm: float | None
    max_deviation_mm: float | None
    shift_mm: float | None
    shift_deg: float | None


def leave_one_location_out(
    cell: Cell, observed: Observed, tables: Sequence[FrameTable], result: CalibrationResult, config: CalibConfig
) -> tuple[LeftOut, ...]:
    """Solve without each calibrate location in turn and judge the solution there; empty with fewer than two of them.

    The labels of ``tables`` are kept, so that nothing but the solution changes.
    """
    labelled = _with_labels(observed.observations, tables)
    names = [name for name, location in result.locations.items() if location.role == "calibrate"]
    if len(names) < 2 or result.T_hand_sensor is None:
        return ()
    return tuple(_without(name, cell, labelled, result, config) for name in names)


def _with_labels(observations: Observations, tables: Sequence[FrameTable]) -> Observations:
    axis = {t.frame: t.axis for t in tables}
    frames = [
        replace(f, axis=axis[f.frame]) if f.reason is None and len(axis.get(f.frame, ())) else f
        for f in observations.frames
    ]
    return replace(observations, frames=tuple(frames))


def _without(
    name: str, cell: Cell, observations: Observations, result: CalibrationResult, config: CalibConfig
) -> LeftOut:
    frames = tuple(replace(f, role="verify") if f.location == name else f for f in observations.frames)
    try:
        solved = calibrate(replace(observations, frames=frames), cell.jig, cell.robot, config)
    except NoAnswerError:
        return LeftOut(name, None, None, None, None)
    if solved.T_hand_sensor is None or result.T_hand_sensor is None:
        return LeftOut(name, None, None, None, None)
    xi = (result.T_hand_sensor.inverse() @ solved.T_hand_sensor).log()
    location = solved.locations[name]
    return LeftOut(
        name,
        location.point_rms_mm.solved,
        location.max_deviation_mm.solved,
        float(np.linalg.norm(xi[:3])),
        float(np.rad2deg(np.linalg.norm(xi[3:]))),
    )
