"""Anchors or balls as a measuring machine found them: a CSV with a name and a point a row."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Remark, no_remark
from jig_cad import Balls, Jig, MeasuredTarget, measured_balls, measured_jig
from workbench.files.tables.table import read_table

COLUMNS = ("name", "x_mm", "y_mm", "z_mm")
ALSO_NAMED = ("anchor", "ball", "hole", "point")  # the first column's name, as reports of measuring machines have it


@dataclass(frozen=True, eq=False)
class GivenAnchors:
    """points_mm: by name, in the measuring machine's axes. diameters_mm: of balls, where they were measured."""

    points_mm: dict[str, NDArray[np.float64]]
    diameters_mm: dict[str, float]


def read_anchors(path: Path, remark: Remark = no_remark) -> GivenAnchors:
    """Points by name.

    Parameters
    ----------
    path
        A CSV with the columns name, x_mm, y_mm, z_mm and, of balls, diameter_mm.
    remark
        Told of what is doubtful and was read nevertheless.

    Raises
    ------
    InputError
        Naming file, line and column.
    """
    points: dict[str, NDArray[np.float64]] = {}
    diameters: dict[str, float] = {}
    spelling = dict.fromkeys(ALSO_NAMED, "name")
    known = (*COLUMNS, "diameter_mm")
    table = read_table(path, known, COLUMNS, lambda c: spelling.get(c.casefold(), c), remark)
    for row in table.rows:
        name = row.text("name").replace("′", "'")
        if name in points:
            raise row.fail("name", f'"{name}" stands in two rows')
        points[name] = np.array([row.number(c) for c in COLUMNS[1:]])
        if row.cells.get("diameter_mm"):
            diameters[name] = row.number("diameter_mm")
    if not points:
        raise InputError(f"{path}: holds no measured points")
    return GivenAnchors(points, diameters)


def lay_onto(
    target: Jig | Balls, path: Path, remark: Remark = no_remark
) -> MeasuredTarget[Jig] | MeasuredTarget[Balls]:
    """The target of a drawing with what a file says was measured; InputError names the file."""
    given = read_anchors(path, remark)
    try:
        if isinstance(target, Jig):
            return measured_jig(target, given.points_mm)
        return measured_balls(target, given.points_mm, given.diameters_mm)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
