"""Profiles of an acceptance test: from images, profile files or a cell, and where the sensor stood if that is told."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from extraction import Profile, StripeConfig, extract_profile
from geometry import Frame, InputError, NoAnswerError, Pose, Remark, Sensor, no_remark
from geometry.sensor import ProfileOutput
from workbench.cell import find_sensor, is_profile_file, scp_of
from workbench.files import LOSSY_SUFFIXES, Cell, read_cell, read_image, read_result, read_table
from workbench.profiles import Told, checked_profile, frame_profiles, read_scan_lines

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

MOST_PROFILES = 20_000
_ALONG_SHEET_NORMAL = np.array([1.0, 0.0, 0.0])
_LEAST_STEP_MM = 1e-6


@dataclass(frozen=True, eq=False)
class PlacedProfile:
    """One profile in {P}, and T_scan_sensor where it is told where the sensor stood.

    order: which of the recording it is, those that can not be used counted too.
    """

    name: str
    profile: Profile
    place: Pose | None = None
    order: int = 0

    def in_scan(self, yz_mm: Array) -> Array:
        """Points (N, 2) of the profile in the scan's frame (N, 3); in {P} where no place is told."""
        points = np.column_stack([np.zeros(len(yz_mm)), yz_mm])
        return points if self.place is None else np.asarray(self.place @ points)


@dataclass(frozen=True, eq=False)
class Recorded:
    """Profiles in order, the files that they come from, and what moved the sensor, in words; "" where nobody told."""

    profiles: tuple[PlacedProfile, ...]
    files: tuple[Path, ...]
    moved_by: str = ""
    notes: tuple[str, ...] = ()

    @property
    def is_scan(self) -> bool:
        """Whether the profiles make a surface in space."""
        return bool(self.moved_by)


@dataclass(frozen=True)
class ProfileRecording:
    """What is told of the profiles: the sensor, where it stood, and which part of a cell is meant.

    step_mm: along the sheet's normal from profile to profile. positions: a table profile, x_mm (y_mm, z_mm). scp: a
    result of calibrate for a cell; location: of the cell, where it has several.
    """

    paths: tuple[Path, ...]
    sensor: Path | None = None
    step_mm: float | None = None
    positions: Path | None = None
    scp: Path | None = None
    location: str | None = None
    stripe: StripeConfig = field(default_factory=StripeConfig)


def read_recorded(what: ProfileRecording, remark: Remark = no_remark, progress: Progress | None = None) -> Recorded:
    """The profiles of an acceptance test.

    Parameters
    ----------
    what
        Files or folders of images or profiles; or one cell, whose poses then place the profiles.
    remark
        Told of images that can not be read and are left out, and of doubts.
    progress
        Told how many images are done.

    Returns
    -------
    Recorded

    Raises
    ------
    InputError
        Where files, positions or the sensor can not be used.
    NoAnswerError
        Where no profile has points.

    """
    if what.step_mm is not None and what.positions is not None:
        raise InputError("--step-mm and --positions both tell where the sensor stood: give one")
    if len(what.paths) == 1 and _is_cell(what.paths[0]):
        return _of_cell(what, remark, progress)
    if what.scp is not None or what.location is not None:
        raise InputError(f"--scp and --location belong to a cell dataset, and {what.paths[0]} is none")
    files = _files(what.paths)
    placed: list[PlacedProfile] = []
    sensor = None if what.sensor is None else find_sensor(str(what.sensor))
    image = next((p for p in files if not is_profile_file(p)), None)
    if image is not None:
        if sensor is None:
            raise InputError(f"{image} is an image, not a profile's file: it needs --sensor FILE")
        sensor.require_camera()
    count = 0
    for k, path in enumerate(files):
        try:
            found = list(_profiles_of(path, sensor, what, remark))
        except InputError as error:
            if len(files) == 1:
                raise
            remark(f"{error}; left out")
            found = [PlacedProfile(path.stem, Profile.of_points(np.zeros((0, 2)), np.zeros((0, 2, 2))))]
        placed += [replace(p, order=count + i) for i, p in enumerate(found)]
        count += len(found)
        if len(placed) > MOST_PROFILES:
            raise InputError(f"{path}: more than {MOST_PROFILES:,} profiles: test a part of them")
        if progress is not None:
            progress(k + 1, len(files))
    extra = [p for p in (what.sensor, what.positions) if p is not None]
    return _placed(_with_points(placed, files), (*files, *extra), what)


def _is_cell(path: Path) -> bool:
    return path.name == "cell.toml" or (path.is_dir() and (path / "cell.toml").is_file())


def _files(paths: Sequence[Path]) -> list[Path]:
    """The files that are named, and those of folders, by name."""
    out: list[Path] = []
    for path in paths:
        if not path.is_dir():
            out.append(path)
            continue
        inside = sorted(p for p in path.iterdir() if p.is_file() and not p.name.startswith("."))
        images = [p for p in inside if p.suffix.lower() in LOSSY_SUFFIXES]
        found = images or [p for p in inside if p.suffix.lower() != ".toml"]
        if not found:
            raise InputError(f"{path}: holds neither images nor profiles")
        out += found
    return out


def _profiles_of(path: Path, sensor: Sensor | None, what: ProfileRecording, remark: Remark) -> Iterator[PlacedProfile]:
    if sensor is not None and not is_profile_file(path):
        yield PlacedProfile(path.stem, extract_profile(read_image(path, sensor, remark), sensor, what.stripe))
        return
    output = ProfileOutput() if sensor is None or sensor.profile is None else sensor.profile
    told = Told(output.format, output.pitch_mm, output.start_mm, output.unit, output.width, remark)
    lines = read_scan_lines(path, told)
    for k, line in enumerate(lines):
        checked = checked_profile(line, output, path)
        for sentence in checked.remarks:
            remark(sentence)
        name = path.stem if len(lines) == 1 else f"{path.stem}:{k if line.number is None else line.number}"
        yield PlacedProfile(name, checked.profile)


def _with_points(placed: Sequence[PlacedProfile], files: Sequence[Path]) -> tuple[PlacedProfile, ...]:
    kept = tuple(p for p in placed if len(p.profile))
    if not kept:
        raise NoAnswerError(f"none of the {len(placed)} profiles of {files[0]}{' …' * (len(files) > 1)} has points")
    return kept


def _placed(profiles: tuple[PlacedProfile, ...], files: tuple[Path, ...], what: ProfileRecording) -> Recorded:
    """With the places that were told."""
    lost: tuple[str, ...] = ()
    if what.step_mm is not None:
        if not abs(what.step_mm) > _LEAST_STEP_MM:
            raise InputError(f"--step-mm {what.step_mm:g}: must not be zero")
        if len(profiles) < 2:
            raise InputError("--step-mm needs profiles that follow each other, and there is one only")
        moved = [replace(p, place=Pose(np.eye(3), p.order * what.step_mm * _ALONG_SHEET_NORMAL)) for p in profiles]
        return Recorded(tuple(moved), files, f"steps of {what.step_mm:g} mm along the sheet's normal")
    if what.positions is None:
        return Recorded(profiles, files)
    places = _read_positions(what.positions)
    names = {p.name for p in profiles}
    unknown = [name for name in places if name not in names]
    if len(unknown) == len(places):
        raise InputError(
            f'{what.positions}: no row names a profile that was read, such as "{profiles[0].name}"; the first is '
            f'"{unknown[0][:60]}"'
        )
    kept = tuple(replace(p, place=places[p.name]) for p in profiles if p.name in places)
    if len(kept) < len(profiles):
        lost = (f"{len(profiles) - len(kept)} profiles have no row in {what.positions.name} and are left out",)
    return Recorded(kept, files, f"positions of {what.positions.name}", lost)


def _read_positions(path: Path) -> dict[str, Pose]:
    """T_scan_sensor by profile: translations along the axes of {P}."""
    axes = ("x_mm", "y_mm", "z_mm")
    table = read_table(path, ("profile", *axes), ("profile", "x_mm"))
    out: dict[str, Pose] = {}
    for row in table.rows:
        name = row.text("profile")
        if name in out:
            raise row.fail("profile", f'"{name[:60]}" stands there twice')
        out[name] = Pose(np.eye(3), np.array([row.optional(a) or 0.0 for a in axes]))
    if not out:
        raise InputError(f"{path}: holds no positions, only a header")
    return out


def _of_cell(what: ProfileRecording, remark: Remark, progress: Progress | None) -> Recorded:
    """The frames of one location, placed by the robot and the SCP."""
    if what.step_mm is not None or what.positions is not None or what.sensor is not None:
        raise InputError(f"{what.paths[0]} is a cell: its own files tell the sensor and where it stood")
    cell = read_cell(what.paths[0])
    if what.scp is None and cell.T_hand_sensor_design is None:
        raise InputError(f"{what.paths[0]}: cell.toml has no [scp_initial]: give --scp, a result of calibrate --json")
    T_hand_sensor, words = (
        (cell.design, "the SCP is [scp_initial]") if what.scp is None else scp_of(cell, read_result(what.scp))
    )
    names = list(dict.fromkeys(f.location for f in cell.frames))
    location = what.location or names[0]
    if location not in names:
        raise InputError(f'{what.paths[0]}: has no location "{location}", but {", ".join(names)}')
    if what.location is None and len(names) > 1:
        raise InputError(f"{what.paths[0]}: has the locations {', '.join(names)}: choose one by --location")
    frames = [f for f in cell.frames if f.location == location]
    placed = []
    for k, (frame, profile) in enumerate(_frame_profiles(cell, frames, what.stripe, remark)):
        placed.append(PlacedProfile(f"frame {frame.number}", profile, _hand(cell, frame) @ T_hand_sensor))
        if progress is not None:
            progress(k + 1, len(frames))
    files = tuple(p for p in (*cell.files, what.scp) if p is not None)
    kept = _with_points(placed, [what.paths[0]])
    return Recorded(kept, files, "the robot: its own errors and the SCP's are in every figure", (words,))


def _hand(cell: Cell, frame: Frame) -> Pose:
    if frame.joints_rad is not None and cell.robot is not None:
        return cell.robot.pose(frame.joints_rad)
    if frame.T_base_hand is None:
        raise InputError(f"frame {frame.number}: neither joint readings with a robot nor a pose of the hand is known")
    return frame.T_base_hand


def _frame_profiles(
    cell: Cell, frames: Sequence[Frame], stripe: StripeConfig, remark: Remark
) -> Iterator[tuple[Frame, Profile]]:
    if cell.points is not None:
        raise InputError(f"{cell.folder}: has points.csv in place of profiles: a test needs all of a profile's points")
    if cell.sensor.profile is not None:
        read = frame_profiles(cell.folder, cell.frames, cell.sensor.profile)
        for frame in frames:
            if frame.number in read.profiles:
                yield frame, read.profiles[frame.number].profile
            else:
                remark(f"frame {frame.number} left out: {read.complaints.get(frame.number, 'no profile')}")
        return
    cell.sensor.require_camera()
    for frame in frames:
        try:
            image = read_image(cell.folder / frame.image, cell.sensor, remark)
        except InputError as error:
            remark(f"frame {frame.number} left out: {error}")
            continue
        yield frame, extract_profile(image, cell.sensor, stripe)
