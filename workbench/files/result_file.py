"""What `calibrate --json` printed, read again: the SCP, its covariance, the files that it belongs to."""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Pose, read_bytes

Array = NDArray[np.float64]

MAX_BYTES = 200_000_000  # of a result with all its points: more is another file
ATOL_ROTATION = 1e-6  # of a rotation as the JSON holds it, nine decimals
ATOL_SYMMETRY = 1e-9


@dataclass(frozen=True, eq=False)
class SavedScp:
    """An SCP and its covariance (6, 6) of ξ in T = T̂·Exp(ξ), sensor axes [mm, rad]; None where it was withheld."""

    T_hand_sensor: Pose | None
    covariance: Array | None


@dataclass(frozen=True, eq=False)
class SavedResult:
    """A calibration's answer as its file has it.

    solved: the SCP that goes with the table that was estimated; nominal: the one with the table as given, where the
    file holds one. hashes: SHA-256 of the files, by kind ("sensor", "robot").
    """

    path: Path
    model: str
    verdict: str
    solved: SavedScp
    nominal: SavedScp | None
    hashes: dict[str, str] = field(default_factory=dict)


def read_result(path: Path) -> SavedResult:
    """The answer in a file of `calibrate --json` or a folder of `--out`.

    Parameters
    ----------
    path
        The JSON, or the folder that holds result.json.

    Returns
    -------
    SavedResult

    Raises
    ------
    InputError
        Saying what the file lacks.

    """
    path = path / "result.json" if path.is_dir() else path
    if not path.exists():
        raise InputError(f"{path}: no such file; a result of `perceptron-emu calibrate --json` is right")
    try:
        data = json.loads(read_bytes(path, MAX_BYTES))
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is no JSON of `perceptron-emu calibrate --json` ({_short(error)})") from None
    return saved_result(path, data)


def saved_result(path: Path, data: Any) -> SavedResult:
    """The answer in the object that `calibrate --json` prints; ``path`` names it in errors."""
    if not isinstance(data, dict) or "T_hand_sensor" not in data:
        raise InputError(
            f"{path}: holds no T_hand_sensor; an object as `perceptron-emu calibrate --json` prints it is right"
        )
    verdict = data.get("verdict")
    inputs = data.get("inputs")
    rows = [row for row in inputs if isinstance(row, dict)] if isinstance(inputs, list) else []
    hashes = {str(row["kind"]): str(row.get("sha256")) for row in rows if "kind" in row}
    nominal = None
    if data.get("T_hand_sensor_nominal") is not None:
        nominal = _scp(path, data, "T_hand_sensor_nominal", "covariance_nominal")
    return SavedResult(
        path,
        str(data.get("model", "")),
        str(verdict.get("code", "")) if isinstance(verdict, dict) else "",
        _scp(path, data, "T_hand_sensor", "covariance"),
        nominal,
        hashes,
    )


def _scp(path: Path, data: dict[str, Any], pose: str, covariance: str) -> SavedScp:
    matrix = _matrix(path, data.get(pose), pose, 4)
    if matrix is None:
        return SavedScp(None, None)
    try:
        if not np.allclose(matrix[3], (0, 0, 0, 1), rtol=0, atol=1e-9):
            raise InputError("the last row of a 4 × 4 transform is 0, 0, 0, 1")
        T = Pose.from_matrix(matrix, ATOL_ROTATION)
    except InputError as error:
        raise InputError(f"{path}: {pose}: {error}") from None
    found = _matrix(path, data.get(covariance), covariance, 6)
    if found is not None:
        scale = np.sqrt(np.outer(np.abs(np.diag(found)), np.abs(np.diag(found)))) + np.finfo(float).tiny
        if np.any(np.diag(found) < 0) or np.any(np.abs(found - found.T) > ATOL_SYMMETRY + 1e-5 * scale):
            raise InputError(f"{path}: {covariance} is no covariance: it must be symmetric with a diagonal above 0")
    return SavedScp(T, found)


def _matrix(path: Path, value: Any, key: str, size: int) -> Array | None:
    if value is None:
        return None
    try:
        out = np.array(value, dtype=float)
    except (TypeError, ValueError, OverflowError):
        out = np.zeros(0)
    if out.shape != (size, size) or not np.all(np.isfinite(out)):
        raise InputError(f"{path}: {key} must be {size} × {size} finite numbers, or null")
    return out


def _short(error: Exception) -> str:
    return getattr(error, "strerror", None) or str(error).split(":", maxsplit=1)[0] or type(error).__name__
