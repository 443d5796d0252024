"""points.csv (docs/formats.md): extract's columns, written by `extract` and read in place of images."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import numpy as np

from geometry import AxisPoints, InputError, Remark, SurfacePoints, no_remark
from workbench.files.tables.table import Row, read_table

COLUMNS = (
    "frame",
    "label",
    "u_px",
    "v_px",
    "y_surface_mm",
    "z_surface_mm",
    "y_mm",
    "z_mm",
    "sigma_y_mm",
    "sigma_z_mm",
    "cov_yz_mm2",
    "score",
    "flag",
)
# behind them where the sensor's file states σ of its own calibration; `calibrate` takes that part from the file
SENSOR_COLUMNS = ("sigma_sensor_y_mm", "sigma_sensor_z_mm", "cov_sensor_yz_mm2")
DEFAULT_SIGMA_MM = 0.03  # where a file gives no σ: a string point's usual scatter with speckle
FARTHEST_POINT_MM = 1e4  # from the sensor: ten metres
_PRIMES = str.maketrans({"′": "'", "’": "'", "`": "'"})


@dataclass(frozen=True, eq=False)
class GivenPoints:
    """One frame of a points.csv: its surface points, and its labelled axis points (None where there are none)."""

    points: SurfacePoints
    axis: AxisPoints | None


@dataclass(frozen=True, slots=True)
class _CsvPoint:
    label: str
    uv: tuple[float, float]
    surface: tuple[float, float] | None
    axis: tuple[float, float] | None
    covariance: tuple[tuple[float, float], tuple[float, float]]
    score: float
    flag: str


def read_points(
    path: Path, strings: Sequence[str], remark: Remark = no_remark, surfaces: frozenset[int] = frozenset()
) -> dict[int, GivenPoints]:
    """Points by frame number of a points.csv.

    Parameters
    ----------
    path
        The file.
    strings
        The names that a label may be.
    remark
        Told of columns that are ignored and of rows that hold no point.
    surfaces
        Numbers of frames of a surface: their unlabelled y_mm, z_mm are the surface's own points, and many may have one
        label.

    Returns
    -------
    dict
        By frame number its surface points, and its axis points where they are labelled.

    Raises
    ------
    InputError
        Naming line and column.

    """
    table = read_table(path, (*COLUMNS, *SENSOR_COLUMNS), ("frame",), remark=remark)
    if not {"y_mm", "z_mm"} <= set(table.columns) and not {"y_surface_mm", "z_surface_mm"} <= set(table.columns):
        raise InputError(
            f"{path}, line {table.header_line}: needs the columns y_mm and z_mm of the axis "
            "or y_surface_mm and z_surface_mm"
        )
    frames: dict[int, list[_CsvPoint]] = {}
    without: list[int] = []
    for row in table.rows:
        points = frames.setdefault(row.whole("frame"), [])
        on_surface = row.whole("frame") in surfaces
        point = _point(row, strings, on_surface=on_surface)
        if point is None:
            without.append(row.line)
            continue
        if point.label and not on_surface and any(point.label == other.label for other in points):
            raise row.fail("label", f'frame {row.cells["frame"]} has a second point "{point.label}"')
        points.append(point)
    if not frames:
        raise InputError(f"{path}: holds a header but no points; without the file they are found in the images")
    if without and not any(frames.values()):
        raise InputError(f"{path}, line {without[0]}: holds no point, nor does any of its {len(without)} rows")
    if without:
        remark(f"{path}, line {without[0]}: no point there, nor in {len(without) - 1} further rows; they are left out")
    return {frame: _collect(sorted(points, key=lambda p: _place(p, strings))) for frame, points in frames.items()}


def _place(point: _CsvPoint, strings: Sequence[str]) -> tuple[int, float, tuple[float, ...]]:
    """Where a point stands among its frame's, whatever the file's order: by label, then the best score first."""
    known = point.surface or point.axis or (0.0, 0.0)
    return (strings.index(point.label) if point.label else len(strings), -point.score, known)


def _point(row: Row, strings: Sequence[str], *, on_surface: bool = False) -> _CsvPoint | None:
    """None where the row holds no point: empty cells, NaN, or what loggers write for no value."""
    given = row.cells.get("label", "")
    label = given if given in strings else given.translate(_PRIMES)
    if label and label not in strings:
        raise row.fail("label", f'"{label}" is no string; {", ".join(strings)} or empty is right')
    surface, axis = _pair(row, "y_surface_mm", "z_surface_mm"), _pair(row, "y_mm", "z_mm")
    if surface is None and axis is None:
        return None
    if on_surface and not label and surface is None:
        surface = axis
    if axis is not None and not label and surface is None:
        raise row.fail(
            "label", "is empty beside y_mm and z_mm; an unlabelled point goes into y_surface_mm and z_surface_mm"
        )
    return _CsvPoint(
        label=label,
        uv=_pair(row, "u_px", "v_px") or (float("nan"), float("nan")),
        surface=surface,
        axis=axis if label else None,
        covariance=_covariance(row),
        score=1.0 if (score := row.optional("score")) is None else score,
        flag=row.cells.get("flag", ""),
    )


def _pair(row: Row, first: str, second: str) -> tuple[float, float] | None:
    a, b = row.measured(first), row.measured(second)
    if (a is None) != (b is None):
        missing, other = (first, second) if a is None else (second, first)
        what = "holds no value" if row.cells.get(missing) else "is empty"
        raise row.fail(missing, f"{what} beside {other}")
    for name, value in ((first, a), (second, b)):
        if name.endswith("_mm") and value is not None and abs(value) > FARTHEST_POINT_MM:
            raise row.fail(name, f"{value:g} is farther than a laser sensor measures: millimetres are right")
    return None if a is None or b is None else (a, b)


def _covariance(row: Row) -> tuple[tuple[float, float], tuple[float, float]]:
    sigma = []
    for column in ("sigma_y_mm", "sigma_z_mm"):
        value = row.optional(column)
        if value is not None and value <= 0:
            raise row.fail(column, f"{value:g} must be above 0")
        sigma.append(DEFAULT_SIGMA_MM if value is None else value)
    cross = row.optional("cov_yz_mm2") or 0.0
    if abs(cross) >= sigma[0] * sigma[1]:
        raise row.fail(
            "cov_yz_mm2", f"{cross:g} must be smaller than sigma_y_mm · sigma_z_mm = {sigma[0] * sigma[1]:g}"
        )
    return _shared((sigma[0] ** 2, cross, sigma[1] ** 2))


@lru_cache(maxsize=4096)  # most rows of a long table have the same few: they are kept once
def _shared(upper: tuple[float, float, float]) -> tuple[tuple[float, float], tuple[float, float]]:
    return (upper[:2], upper[1:])


def _collect(points: list[_CsvPoint]) -> GivenPoints:
    surface = [p for p in points if p.surface is not None]
    index = {id(p): i for i, p in enumerate(surface)}
    labelled = [p for p in points if p.axis is not None]
    n = len(surface)
    nan22 = np.full((n, 2, 2), np.nan)
    spots = SurfacePoints(
        uv_px=np.array([p.uv for p in surface]).reshape(n, 2),
        cov_uv_px2=nan22,
        yz_mm=np.array([p.surface for p in surface], dtype=float).reshape(n, 2),
        cov_yz_mm2=np.array([p.covariance for p in surface]).reshape(n, 2, 2),
        score=np.array([p.score for p in surface]),
        flag=tuple(p.flag for p in surface),
        axis_rad=np.full(n, np.nan),
        sigma_px=np.full((n, 2), np.nan),
        amplitude_dn=np.full(n, np.nan),
    )
    if not labelled:
        return GivenPoints(spots, None)
    axis = AxisPoints(
        label=tuple(p.label for p in labelled),
        spot=np.array([index.get(id(p), -1) for p in labelled], dtype=np.intp),
        yz_mm=np.array([p.axis for p in labelled], dtype=float),
        cov_yz_mm2=np.array([p.covariance for p in labelled]),
        flag=tuple(p.flag for p in labelled),
    )
    return GivenPoints(spots, axis)


def points_text(rows: Iterable[dict[str, object]]) -> str:
    """Rows by column name as the text of a points.csv; numbers with 6 digits after the point, NaN and None as empty."""
    table = list(rows)
    known = any(SENSOR_COLUMNS[0] in row for row in table)
    columns = (*COLUMNS, *SENSOR_COLUMNS) if known else COLUMNS
    lines = [",".join(columns)]
    lines += [",".join(_cell(row.get(column)) for column in columns) for row in table]
    return "\n".join(lines) + "\n"


def _cell(value: object) -> str:
    if value is None or (isinstance(value, float) and not np.isfinite(value)):
        return ""
    if isinstance(value, float):
        return f"{value:.6f}" if abs(value) >= 1e-3 or value == 0 else f"{value:.6e}"
    return str(value)
