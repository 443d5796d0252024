"""[evidence] of cell.toml: a tracker's positions, sockets, distances; the CSV files that it names."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.bundle import (
    DISTANCE_SIGMA_MM,
    SEAT_SIGMA_MM,
    TRACKER_SIGMA_MM,
    DistanceBetween,
    Evidence,
    SeatedTool,
    TrackedPoint,
)
from geometry import InputError, Remark
from workbench.files.strict import FileSection, Positive, Text
from workbench.files.tables.table import Row, Table, read_table

Array = NDArray[np.float64]

XYZ = ("x_mm", "y_mm", "z_mm")


class DistanceSection(FileSection):
    """[[evidence.distance]]: how far the targets at two locations are apart, origin from origin."""

    between: tuple[Text, Text]
    distance_mm: Positive
    sigma_mm: Positive = DISTANCE_SIGMA_MM


class EvidenceSection(FileSection):
    """[evidence]: what is known beside the frames.

    tracker: a CSV of positions of points on the hand, in the tracker's own frame. sockets: a CSV of readings with a
    ball on the hand seated in sockets.
    """

    tracker: Text | None = None
    tracker_sigma_mm: Positive = TRACKER_SIGMA_MM
    sockets: Text | None = None
    seat_sigma_mm: Positive = SEAT_SIGMA_MM
    distance: tuple[DistanceSection, ...] = ()


def read_evidence(
    section: EvidenceSection, folder: Path, n_joints: int | None, where: str, remark: Remark
) -> tuple[Evidence, ...]:
    """The evidence that cell.toml names.

    Parameters
    ----------
    section, folder
        What [evidence] says, and where its files stand.
    n_joints
        Of the robot; None where the cell has none.
    where
        Of [evidence], for errors.
    remark
        Told of what is doubtful in the files.

    Raises
    ------
    InputError
        Naming file, line and key.
    """
    out: list[Evidence] = []
    for key, read in (("tracker", _tracker), ("sockets", _sockets)):
        name = getattr(section, key)
        if name is None:
            continue
        if n_joints is None:
            raise InputError(f"{where}: [evidence] {key} holds joint readings, and cell.toml names no robot")
        path = folder / name
        if not path.is_file():
            raise InputError(f'{where}: [evidence] {key} = "{name}", but {path} is no file')
        out += read(path, n_joints, section, remark)
    for d in section.distance:
        try:
            out.append(DistanceBetween(*d.between, d.distance_mm, d.sigma_mm))
        except InputError as error:
            raise InputError(f"{where}: [[evidence.distance]]: {error}") from None
    return tuple(out)


def _tracker(path: Path, n_joints: int, section: EvidenceSection, remark: Remark) -> list[Evidence]:
    """Rows: point (may be absent: one point), x_mm, y_mm, z_mm, j1_deg …"""
    joints = _columns(n_joints)
    table = read_table(path, ("point", "name", *XYZ, *joints), (*XYZ, *joints), remark=remark)
    rows = _by_name(table, "point", joints)
    out: list[Evidence] = []
    for name, mine in rows.items():
        xyz = np.array([[row.number(c) for c in XYZ] for row, _ in mine])
        try:
            out.append(TrackedPoint(name or "point", np.array([q for _, q in mine]), xyz, section.tracker_sigma_mm))
        except InputError as error:
            raise InputError(f"{path}: {error}") from None
    return out


def _sockets(path: Path, n_joints: int, section: EvidenceSection, remark: Remark) -> list[Evidence]:
    """Rows: socket, j1_deg …"""
    joints = _columns(n_joints)
    table = read_table(path, ("socket", *joints), ("socket", *joints), remark=remark)
    rows = _by_name(table, "socket", joints)
    names = tuple(rows)
    index = np.concatenate([np.full(len(mine), k) for k, mine in enumerate(rows.values())])
    read = np.array([q for mine in rows.values() for _, q in mine])
    try:
        return [SeatedTool(read, index.astype(np.intp), names, section.seat_sigma_mm)]
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _columns(n_joints: int) -> tuple[str, ...]:
    return tuple(f"j{k + 1}_deg" for k in range(n_joints))


def _by_name(table: Table, column: str, joints: tuple[str, ...]) -> dict[str, list[tuple[Row, Array]]]:
    """Rows with their readings [rad], by a column's name, in the file's order."""
    out: dict[str, list[tuple[Row, Array]]] = {}
    for row in table.rows:
        name = row.text(column) if column in table.columns else ""
        out.setdefault(name, []).append((row, np.deg2rad([row.number(c) for c in joints])))
    if not out:
        raise InputError(f"{table.path}: holds no rows")
    return out
