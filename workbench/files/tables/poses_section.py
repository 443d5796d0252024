"""Poses in a controller's own numbers: columns, angles, units, its active tool and base (docs/formats.md, [poses])."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from geometry import CONVENTIONS, ArmConfiguration, InputError, Pose, parse_bits, parse_letters
from workbench.files.strict import FileSection, Real
from workbench.files.tables.table import Row

Array = NDArray[np.float64]
Convention = Literal["kuka", "fanuc", "yaskawa", "mitsubishi", "abb", "ros", "ur"]

_POSITION = ("X", "Y", "Z")
ROTATION_COLUMNS = {k: tuple(label.split(" /")[0] for label in c.labels[3:]) for k, c in CONVENTIONS.items()}
CONFIGURATION_COLUMNS = ("status", "turn", "cf1", "cf4", "cf6", "cfx", "config")
_KUKA_SHORT = {"S": "status", "T": "turn"}
ALL_COLUMNS = tuple(dict.fromkeys((*_POSITION, *(c for names in ROTATION_COLUMNS.values() for c in names))))
_LARGEST_MM = 100_000.0  # beyond any arm, track or crane
_METRES = 10.0  # a hand that is never farther from its base than this in millimetres is given in metres
_UNIT = re.compile(r"[_ ](mm|m|deg|rad)$", re.IGNORECASE)


class PosesSection(FileSection):
    """[poses]: how frames.csv gives the hand; tool and base are the controller's active frames, in the same numbers."""

    convention: Convention
    unit: Literal["mm", "m"] = "mm"
    tool: tuple[Real, ...] | None = None
    base: tuple[Real, ...] | None = None


@dataclass(frozen=True, eq=False)
class ControllerPoses:
    """A controller's way to give poses. tool: T_hand_tool, base: T_base_user, as it had them active."""

    convention: Convention
    mm: float = 1.0
    tool: Pose | None = None
    base: Pose | None = None

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of its columns: position, then rotation."""
        return (*_POSITION, *ROTATION_COLUMNS[self.convention])

    @property
    def known(self) -> tuple[str, ...]:
        """All columns that are read with these poses."""
        return (*self.columns, *CONFIGURATION_COLUMNS)

    def spelling(self, column: str) -> str:
        """A column by its own name: a unit behind it left out where it is the one that is read."""
        unit = "m" if self.mm == 1000.0 else "mm"
        found = _UNIT.search(column)
        plain = column[: found.start()] if found else column
        angle = "rad" if self.convention == "ur" else "deg"
        if found and found[1].casefold() != (unit if plain.upper() in _POSITION else angle):
            return column
        if self.convention == "kuka" and plain in _KUKA_SHORT:
            return _KUKA_SHORT[plain]
        return next((c for c in self.columns if c.casefold() == plain.casefold()), column)

    def pose(self, values: Sequence[float]) -> Pose:
        """T_base_hand of one row's numbers, in the order of ``columns``; InputError where they are no pose."""
        given = self.given(values)
        given = given if self.base is None else self.base @ given
        return given if self.tool is None else given @ self.tool.inverse()

    def given(self, values: Sequence[float]) -> Pose:
        """The pose as the controller means it: of its tool in its base."""
        position, rotation = np.array(values[:3]) * self.mm, np.array(values[3:], dtype=float)
        if np.max(np.abs(position)) > _LARGEST_MM:
            raise InputError(
                f"{np.max(np.abs(position)):.6g} mm from the base is beyond what an arm can reach: is the unit right?"
            )
        if self.convention == "ur" and np.linalg.norm(rotation) > 2 * np.pi + 1e-3:
            raise InputError(
                f"the rotation vector's length {np.linalg.norm(rotation):.4g} is more than a turn: it is in radians"
            )
        return Pose(CONVENTIONS[self.convention].rotation_from(rotation), position)


def controller_poses(section: PosesSection) -> ControllerPoses:
    """What [poses] says; InputError where tool or base are not of the convention."""
    plain = ControllerPoses(section.convention, 1000.0 if section.unit == "m" else 1.0)
    frames = {}
    for name in ("tool", "base"):
        values = getattr(section, name)
        if values is not None and len(values) != len(plain.columns):
            raise InputError(
                f"[poses] {name} has {len(values)} numbers; {section.convention} gives {len(plain.columns)}: "
                f"{', '.join(plain.columns)}"
            )
        try:
            frames[name] = None if values is None else plain.given(values)
        except InputError as error:
            raise InputError(f"[poses] {name}: {error}") from None
    return ControllerPoses(plain.convention, plain.mm, frames["tool"], frames["base"])


def configuration_of(row: Row) -> ArmConfiguration | None:
    """The arm's configuration of a row; None where it says none."""
    cells = {name: row.cells.get(name, "") for name in CONFIGURATION_COLUMNS}
    if not any(cells.values()):
        return None
    column = ""
    try:
        bits = {}
        for column in ("status", "turn"):
            bits[column] = parse_bits(cells[column]) if cells[column] else None
        column = "config"
        letters, turns = parse_letters(cells["config"]) if cells["config"] else ("", ())
    except InputError as error:
        raise row.fail(column, str(error)) from None
    names = ("cf1", "cf4", "cf6", "cfx")
    given = [name for name in names if cells[name]]
    if given and len(given) < len(names):
        raise row.fail(next(n for n in names if n not in given), f"is empty beside {given[0]}")
    quadrants = tuple(_quadrant(row, name) for name in given)
    return ArmConfiguration(bits["status"], bits["turn"], quadrants or None, letters, turns)  # type: ignore[arg-type]


def _quadrant(row: Row, column: str) -> int:
    value = row.number(column)
    if value != round(value) or abs(value) > 1000:
        raise row.fail(column, f"{value:g} is no whole number of quarter turns")
    return int(value)


def check_unit(positions_mm: Array, mm: float, where: str) -> None:
    """InputError where hands (F, 3) stand so near the base, or so far, that the unit must be the other one."""
    farthest = float(np.max(np.abs(positions_mm), initial=0.0))
    if mm == 1.0 and len(positions_mm) >= 3 and 0 < farthest <= _METRES:
        raise InputError(
            f"{where}: no coordinate of the hand is above {farthest:.3g} mm, as if in metres: give [poses] "
            'unit = "m" in cell.toml'
        )
