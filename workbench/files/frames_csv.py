"""frames.csv (docs/formats.md): which image was taken where, with the joint readings or the hand's pose."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import Frame, InputError, Pose, Role, quaternion_wxyz
from workbench.files.table import CsvTable, Row, read_table

Array = NDArray[np.float64]

POSE_COLUMNS = ("x_mm", "y_mm", "z_mm", "qw", "qx", "qy", "qz")
ROLES = ("calibrate", "verify")
MAX_JOINTS = 16  # columns that are known; arms have six or seven
ATOL_QUATERNION = 1e-2  # length of a quaternion as written; digits cut in the file stay far below


def read_frames(path: Path, n_joints: int, *, may_be_empty: bool = False) -> tuple[Frame, ...]:
    """The frames of a frames.csv, joint readings in radians.

    Parameters
    ----------
    path
        The file.
    n_joints
        How many columns j1_deg, j2_deg, … there must be, where no hand poses stand in their place.
    may_be_empty
        Whether a header alone will do.

    Returns
    -------
    tuple of Frame
        In the file's order.

    Raises
    ------
    InputError
        Naming line and column.

    """
    joints = tuple(f"j{i}_deg" for i in range(1, MAX_JOINTS + 1))
    known = ("frame", "image", "location", "role", *joints, *POSE_COLUMNS)
    table = read_table(path, known, ("frame", "location", "role"))
    poses = _check_motion_columns(table, n_joints)
    frames = tuple(_frame(row, n_joints, poses=poses) for row in table.rows)
    if not frames and not may_be_empty:
        raise InputError(f"{path}: holds a header but no frames")
    lines = {frame.number: row.line for frame, row in zip(reversed(frames), reversed(table.rows), strict=True)}
    _check_numbers(table, frames, lines)
    _check_locations(path, frames, lines)
    if frames and not poses:
        _check_degrees(path, frames)
    return frames


def _check_motion_columns(table: CsvTable, n_joints: int) -> bool:
    """Whether poses stand in place of joints; InputError where the columns are neither or do not fit the robot."""
    where = f"{table.path}, line {table.header_line}"
    joints = [c for c in table.columns if re.fullmatch(r"j\d+_deg", c)]
    pose = [c for c in table.columns if c in POSE_COLUMNS]
    if joints and pose:
        raise InputError(
            f"{where}: gives joints ({joints[0]} …) and poses ({pose[0]} …); only one of the two can be right"
        )
    if pose:
        missing = [c for c in POSE_COLUMNS if c not in pose]
        if missing:
            raise InputError(f'{where}: the column "{missing[0]}" is missing beside {", ".join(pose)}')
        return True
    if not joints:
        raise InputError(
            f"{where}: neither joint columns j1_deg … j{n_joints}_deg nor pose columns {', '.join(POSE_COLUMNS)}"
        )
    wanted = {f"j{i}_deg" for i in range(1, n_joints + 1)}
    if set(joints) != wanted:
        raise InputError(f"{where}: {len(joints)} joint columns ({', '.join(joints)}) for a robot of {n_joints} joints")
    return False


def _frame(row: Row, n_joints: int, *, poses: bool) -> Frame:
    number, image, location = row.whole("frame"), row.cells.get("image", ""), row.text("location")
    role: Role = "calibrate" if row.choice("role", ROLES) == "calibrate" else "verify"
    if not poses:
        degrees = [row.number(f"j{i}_deg") for i in range(1, n_joints + 1)]
        return Frame(number, location, role, joints_rad=np.deg2rad(degrees), image=image)
    q = np.array([row.number(c) for c in POSE_COLUMNS[3:]])
    if abs(np.linalg.norm(q) - 1) > ATOL_QUATERNION:
        raise row.fail("qw … qz", f"the quaternion has length {np.linalg.norm(q):.4g}, a rotation's is 1")
    pose = Pose.from_quaternion_wxyz(q, [row.number(c) for c in POSE_COLUMNS[:3]])
    return Frame(number, location, role, T_base_hand=pose, image=image)


def _check_numbers(table: CsvTable, frames: tuple[Frame, ...], lines: dict[int, int]) -> None:
    for frame, row in zip(frames, table.rows, strict=True):
        if lines[frame.number] != row.line:
            raise InputError(
                f"{table.path}, line {row.line}: frame {frame.number} stands already on line {lines[frame.number]}"
            )


def _check_locations(path: Path, frames: tuple[Frame, ...], lines: dict[int, int]) -> None:
    """One spelling and one role a location: a location that solves can not verify."""
    first: dict[str, Frame] = {}
    for frame in frames:
        before = first.setdefault(frame.location.casefold(), frame)
        line, old = lines[frame.number], lines[before.number]
        where = f'{path}, line {line}: location "{frame.location}"'
        if before.location != frame.location:
            raise InputError(f'{where} is "{before.location}" on line {old}; one spelling is right')
        if before.role != frame.role:
            raise InputError(f"{where} has role {frame.role}, on line {old} {before.role}; one role is right")


def _check_degrees(path: Path, frames: tuple[Frame, ...]) -> None:
    readings = np.abs([frame.joints_rad for frame in frames if frame.joints_rad is not None])
    if len(frames) >= 3 and 0.01 < np.max(np.rad2deg(readings)) <= 2 * np.pi:
        raise InputError(
            f"{path}: no joint reads more than {np.max(np.rad2deg(readings)):.3g}°, as if in radians; "
            "the columns j1_deg … are in degrees"
        )


def frames_text(frames: tuple[Frame, ...], decimals: int = 6) -> str:
    """The frames as the text of a frames.csv; joints in degrees with ``decimals`` digits."""
    joints = frames[0].joints_rad
    columns = POSE_COLUMNS if joints is None else [f"j{i}_deg" for i in range(1, len(joints) + 1)]
    lines = [",".join(["frame", "image", "location", "role", *columns])]
    for frame in frames:
        if frame.joints_rad is not None:
            numbers = [f"{v:.{decimals}f}" for v in np.rad2deg(frame.joints_rad)]
        else:
            numbers = [f"{float(v):.12g}" for v in _pose_numbers(frame)]
        lines.append(",".join([str(frame.number), frame.image, frame.location, frame.role, *numbers]))
    return "\n".join(lines) + "\n"


def _pose_numbers(frame: Frame) -> Array:
    pose = frame.T_base_hand
    if pose is None:
        raise InputError(f"frame {frame.number} has neither joints nor a pose")
    return np.concatenate([pose.t, quaternion_wxyz(pose.R)])
