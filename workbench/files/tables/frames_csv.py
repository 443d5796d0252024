"""frames.csv (docs/formats.md): which image was taken where, with the joint readings or the hand's pose."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Sequence
from itertools import islice
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import Frame, InputError, Pose, Remark, no_remark
from workbench.files.tables.poses_section import ALL_COLUMNS as CONTROLLERS_COLUMNS
from workbench.files.tables.poses_section import CONFIGURATION_COLUMNS, ControllerPoses, check_unit, configuration_of
from workbench.files.tables.table import Row, Table, Wrong, raised, read_table

Array = NDArray[np.float64]

POSE_COLUMNS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
ROLES = ("calibrate", "verify")
MAX_JOINTS = 16  # columns that are known; arms have six or seven
_JOINT = re.compile(r"(?:J|A|Joint|joint|Axis|axis)[ _]?([1-9][0-9]?)(?:[ _]?deg)?")  # j1 alone lacks its unit
MAX_FRAMES = 100_000  # of one dataset: more is a recording that was never cut into frames
LARGEST_READING_DEG = 36_000.0  # a hundred turns: no joint counts so far
LARGEST_COORDINATE_MM = 100_000.0  # of the hand in the base: beyond any arm, track or crane
_FIRST_LINES = 100  # of a file, among which its header is
LONGEST_NAME = 255  # bytes, of one part of a path
ATOL_QUATERNION = 1e-2  # length of a quaternion as written; digits cut in the file stay far below


def read_frames(
    path: Path,
    n_joints: int | None,
    *,
    may_be_empty: bool = False,
    remark: Remark = no_remark,
    poses: ControllerPoses | None = None,
    wrong: Wrong | None = None,
) -> tuple[Frame, ...]:
    """The rows of frames.csv, joint readings in radians.

    Parameters
    ----------
    path
        The file.
    n_joints
        How many columns j1_deg, j2_deg, … there must be, where no hand poses stand in their place; None: no robot is
        known, and hand poses must be there.
    may_be_empty
        Whether a header alone will do.
    remark
        Told of columns that are ignored.
    poses
        How a controller gives the hand, in columns of its own; None: joints or T_base_hand.
    wrong
        Told of each row that can not be used, which is left out then; None: the first one is raised.

    Returns
    -------
    tuple of Frame
        By their numbers, whatever the file's order.

    Raises
    ------
    InputError
        Naming line and column.

    """
    joints = tuple(f"j{i}_deg" for i in range(1, MAX_JOINTS + 1))
    common = ("frame", "image", "profile", "location", "role", *joints)
    own = (*POSE_COLUMNS, *CONFIGURATION_COLUMNS, *CONTROLLERS_COLUMNS) if poses is None else poses.known

    def spelling(column: str) -> str:
        return _spelling(column if poses is None else poses.spelling(column))

    table = read_table(path, (*common, *own), ("frame", "location", "role"), spelling, remark)
    if poses is None:
        _check_no_controllers_columns(table, remark)
    columns = _check_motion_columns(table, n_joints, POSE_COLUMNS if poses is None else poses.columns)
    told = raised if wrong is None else wrong
    rows = tuple(_rows(islice(table.rows_telling(told), MAX_FRAMES + 1), n_joints or 0, columns, poses, told))
    if len(rows) > MAX_FRAMES:
        raise InputError(f"{path}: holds more than {MAX_FRAMES:,} frames, which no dataset needs")
    if not rows and not may_be_empty:
        raise InputError(f"{path}: holds a header but no frames")
    rows = _of_one_mind(path, rows, told)
    if rows and not columns:
        _check_degrees(path, rows)
    if poses is not None and columns:
        check_unit(np.array([r.T_base_hand.t for r in rows if r.T_base_hand is not None]), poses.mm, str(path))
    return tuple(sorted(rows, key=lambda row: row.number))


def _spelling(column: str) -> str:
    """``J1``, ``A1 [deg]``, ``Joint 1`` as controllers head their columns."""
    found = _JOINT.fullmatch(column)
    return f"j{found[1]}_deg" if found else column


def _check_no_controllers_columns(table: Table, remark: Remark) -> None:
    """InputError where the hand is given in a controller's columns, and nothing says whose."""
    found = [c for c in table.columns if c in CONTROLLERS_COLUMNS and c not in POSE_COLUMNS]
    if {"X", "Y", "Z"} <= set(found) and len(found) >= 6:
        raise InputError(
            f"{table.path}, line {table.header_line}: the columns {' '.join(found)} are a controller's, and makers "
            'mean different rotations by them: name the maker by [poses] convention = "kuka", "fanuc", "yaskawa", '
            '"mitsubishi", "abb", "ros" or "ur" in cell.toml'
        )
    if found:
        remark(f"{table.path}, line {table.header_line}: the columns {', '.join(found)} are ignored")


def _check_motion_columns(table: Table, n_joints: int | None, pose_columns: Sequence[str]) -> tuple[str, ...]:
    """The columns of poses where they stand in place of joints, else none.

    InputError where the columns are neither or do not fit the robot.
    """
    where = f"{table.path}, line {table.header_line}"
    joints = [c for c in table.columns if re.fullmatch(r"j\d+_deg", c)]
    pose = [c for c in table.columns if c in pose_columns]
    if joints and pose:
        raise InputError(
            f"{where}: gives joints ({joints[0]} …) and poses ({pose[0]} …); only one of the two can be right"
        )
    if pose:
        missing = [c for c in pose_columns if c not in pose]
        if missing:
            ours = tuple(pose_columns) == POSE_COLUMNS
            hint = "; a controller's own columns need [poses] convention in cell.toml" if ours else ""
            raise InputError(f'{where}: the column "{missing[0]}" is missing beside {", ".join(pose)}{hint}')
        return tuple(pose_columns)
    if n_joints is None:
        what = f"joint columns ({joints[0]} …)" if joints else "no joint columns"
        raise InputError(
            f"{where}: {what}, and cell.toml names no robot: give its file as robot, or hand poses as "
            f"{', '.join(pose_columns)}"
        )
    if not joints:
        raise InputError(
            f"{where}: neither joint columns j1_deg … j{n_joints}_deg nor pose columns {', '.join(pose_columns)}"
        )
    wanted = {f"j{i}_deg" for i in range(1, n_joints + 1)}
    if set(joints) != wanted:
        raise InputError(f"{where}: {len(joints)} joint columns ({', '.join(joints)}) for a robot of {n_joints} joints")
    return ()


def _rows(
    rows: Iterable[Row], n_joints: int, columns: Sequence[str], poses: ControllerPoses | None, wrong: Wrong
) -> Iterator[Frame]:
    for row in rows:
        try:
            yield _row(row, n_joints, columns, poses)
        except InputError as error:
            wrong(error)


def _row(row: Row, n_joints: int, columns: Sequence[str], poses: ControllerPoses | None) -> Frame:
    common = {
        "number": row.whole("frame"),
        "image": _file(row, "image"),
        "profile": _file(row, "profile"),
        "configuration": configuration_of(row),
        "location": row.text("location"),
        "role": row.choice("role", ROLES),
        "line": row.line,
    }
    if not columns:
        degrees = [_within(row, f"j{i}_deg", LARGEST_READING_DEG) for i in range(1, n_joints + 1)]
        return Frame(**common, joints_rad=np.deg2rad(degrees))  # type: ignore[arg-type]
    if poses is not None:
        try:
            hand = poses.pose([row.number(c) for c in columns])
        except InputError as error:
            named = str(error).startswith(str(row.path))
            raise error if named else row.fail(f"{columns[0]} … {columns[-1]}", str(error)) from None
        return Frame(**common, T_base_hand=hand)  # type: ignore[arg-type]
    q = np.array([row.number(c) for c in POSE_COLUMNS[3:]])
    if abs(np.linalg.norm(q) - 1) > ATOL_QUATERNION:
        raise row.fail("qw … qz", f"the quaternion has length {np.linalg.norm(q):.4g}, a rotation's is 1")
    pose = Pose.from_quaternion_wxyz(q, [_within(row, c, LARGEST_COORDINATE_MM) for c in POSE_COLUMNS[:3]])
    return Frame(**common, T_base_hand=pose)  # type: ignore[arg-type]


def _file(row: Row, column: str) -> str:
    """A file's name, or nothing; no part of it is longer than what systems take."""
    name = row.cells.get(column, "")
    if any(len(part.encode()) > LONGEST_NAME for part in Path(name).parts):
        raise row.fail(column, f'"{name[:40]}…" is too long for the name of a file')
    return name


def _within(row: Row, column: str, limit: float) -> float:
    value = row.number(column)
    if abs(value) > limit:
        raise row.fail(column, f"{value:g} is beyond what an arm can read or reach (± {limit:g})")
    return value


def _of_one_mind(path: Path, rows: tuple[Frame, ...], wrong: Wrong) -> tuple[Frame, ...]:
    """Rows whose number no row before has, and whose location is spelt and used as there.

    A location that solves can not verify.
    """
    seen: dict[int, Frame] = {}
    first: dict[str, Frame] = {}
    for row in rows:
        before = first.get(row.location.casefold(), row)
        where = f'{path}, line {row.line}: location "{row.location}"'
        if row.number in seen:
            twice = f"frame {row.number} stands already on line {seen[row.number].line}"
            wrong(InputError(f"{path}, line {row.line}: {twice}"))
        elif before.location != row.location:
            wrong(InputError(f'{where} is "{before.location}" on line {before.line}; one spelling is right'))
        elif before.role != row.role:
            wrong(InputError(f"{where} has role {row.role}, on line {before.line} {before.role}; one role is right"))
        else:
            seen[row.number] = row
            first.setdefault(row.location.casefold(), row)
    return tuple(seen.values())


def names_profiles(path: Path) -> bool:
    """Whether a frames.csv, filled or not, has the column profile; one that is not there yet has none."""
    if not path.is_file():
        return False
    with path.open(encoding="utf-8-sig", errors="replace") as lines:
        header = next((line for line in islice(lines, _FIRST_LINES) if line.strip() and line[0] != "#"), "")
    return "profile" in (name.strip(' "').lower() for name in re.split(r"[,;\t]", header.strip()))


def _check_degrees(path: Path, rows: tuple[Frame, ...]) -> None:
    readings = np.abs([row.joints_rad for row in rows if row.joints_rad is not None])
    if len(rows) >= 3 and 0.01 < np.max(np.rad2deg(readings)) <= 2 * np.pi:
        raise InputError(
            f"{path}: no joint reads more than {np.max(np.rad2deg(readings)):.3g}°, as if in radians; "
            "the columns j1_deg … are in degrees"
        )


def frames_text(rows: tuple[Frame, ...], decimals: int = 6) -> str:
    """The rows as the text of a frames.csv; joints in degrees with ``decimals`` digits."""
    joints = rows[0].joints_rad
    columns = POSE_COLUMNS if joints is None else [f"j{i}_deg" for i in range(1, len(joints) + 1)]
    what = "profile" if any(row.profile for row in rows) else "image"
    lines = [",".join(["frame", what, "location", "role", *columns])]
    for row in rows:
        if row.joints_rad is not None:
            numbers = [f"{v:.{decimals}f}" for v in np.rad2deg(row.joints_rad)]
        else:
            numbers = [f"{float(v):.12g}" for v in _pose_numbers(row)]
        lines.append(",".join([str(row.number), getattr(row, what), row.location, row.role, *numbers]))
    return "\n".join(lines) + "\n"


def _pose_numbers(row: Frame) -> Array:
    from geometry import quaternion_wxyz

    pose = row.T_base_hand
    if pose is None:
        raise InputError(f"frame {row.number} has neither joints nor a pose")
    return np.concatenate([pose.t, quaternion_wxyz(pose.R)])
