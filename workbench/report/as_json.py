"""The result of calibrate as a JSON object that names the files it was made from."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from calib import CalibrationResult, result_object
from workbench.files import Cell, sha256_of


def calibration_object(
    result: CalibrationResult, complaints: Mapping[int, str] | None = None, cell: Cell | None = None
) -> dict[str, Any]:
    """The object of ``calib.result_object`` with the dataset's files and their hashes."""
    return result_object(result, complaints, () if cell is None else inputs_of(cell))


def inputs_of(cell: Cell) -> list[dict[str, str]]:
    """The files of a dataset, by their names from its folder, with the SHA-256 of their bytes; images aside."""
    found = []
    for path in cell.files:
        name = path.relative_to(cell.folder) if path.is_relative_to(cell.folder) else path
        what = {cell.sensor_path: "sensor", cell.robot_path: "robot"}.get(path)
        row = {"file": name.as_posix(), "sha256": sha256_of(path)}
        found.append(row | ({"kind": what} if what else {}))
    return found
