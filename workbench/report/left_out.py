"""Leave-one-location-out: how well the other places predict the points of each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from calib import CalibConfig, CalibrationResult
from geometry import Frame, NoAnswerError
from workbench.cell import Observed, solve
from workbench.files import Cell


@dataclass(frozen=True)
class LeftOut:
    """One place, solved from the others. shift_mm, shift_deg: how far the SCP moves without it."""

    location: str
    point_rms_mm: float | None
    max_deviation_mm: float | None
    shift_mm: float | None
    shift_deg: float | None


def leave_one_location_out(cell: Cell, result: CalibrationResult, config: CalibConfig) -> tuple[LeftOut, ...]:
    """Solve without each calibrate location in turn and judge the solution there; empty with fewer than two of them.

    The labels of the result are kept, so that nothing but the solution changes.
    """
    frames = tuple(replace(f, labels_given=bool(len(f.axis))) for f in result.frames)
    names = [name for name, location in result.locations.items() if location.role == "calibrate"]
    if len(names) < 2 or result.T_hand_sensor is None:
        return ()
    return tuple(_without(name, cell, frames, result, config) for name in names)


def _without(
    name: str, cell: Cell, labelled: tuple[Frame, ...], result: CalibrationResult, config: CalibConfig
) -> LeftOut:
    frames = tuple(replace(f, role="verify") if f.location == name else f for f in labelled)
    try:
        solved = solve(cell, Observed(frames, {}), config)
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
