"""Which profile of which file belongs to which frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from geometry import Frame, InputError
from geometry.sensor import AUTO, ProfileOutput
from workbench.profiles.checked import CheckedProfile, checked_profile
from workbench.profiles.files import read_scan_lines, recognise
from workbench.profiles.scan_line import ScanLine, Told
from workbench.profiles.source import open_source


@dataclass(frozen=True, eq=False)
class FrameProfiles:
    """Profiles by frame number. complaints: a sentence for each frame without one. remarks: doubts about others."""

    profiles: dict[int, CheckedProfile] = field(default_factory=dict)
    complaints: dict[int, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()


def frame_profiles(folder: Path, frames: Sequence[Frame], output: ProfileOutput) -> FrameProfiles:
    """The profiles of a dataset's frames.

    A file that several frames name gives each its own: by the number that the file counts it with where it counts all
    of them, else in order.

    Parameters
    ----------
    folder
        That the files are named in.
    frames
        Of a dataset.
    output
        What sensor.toml says of the sensor.

    Returns
    -------
    FrameProfiles

    Raises
    ------
    InputError
        Where a file holds another number of profiles than frames name it, or where no frame's can be used.

    """
    told: list[str] = []
    said = Told(output.format, output.pitch_mm, output.start_mm, output.unit, output.width, told.append)
    found: dict[int, CheckedProfile] = {}
    complaints: dict[int, str] = {}
    by_file: dict[str, list[Frame]] = {}
    for frame in frames:
        by_file.setdefault(frame.profile, []).append(frame)
    formats: Counter[str] = Counter()
    for name, group in by_file.items():
        path = folder / name
        try:
            if not name:
                raise InputError(f"line {group[0].line} of the frames' file names no profile")
            lines = read_scan_lines(path, said)
            if output.format == AUTO:
                formats[recognise(open_source(path))] += 1
        except InputError as error:
            complaints |= {frame.number: str(error) for frame in group}
            continue
        for frame, scan in _paired(path, group, lines):
            try:
                found[frame.number] = checked_profile(scan, output, path)
            except InputError as error:
                complaints[frame.number] = str(error)
    if complaints and not found:
        raise InputError(next(iter(complaints.values())))
    remarks = (*told, *_mixed(formats), *(r for p in found.values() for r in p.remarks))
    return FrameProfiles(found, complaints, remarks)


def _paired(path: Path, frames: Sequence[Frame], lines: Sequence[ScanLine]) -> Iterator[tuple[Frame, ScanLine]]:
    numbers = [scan.number for scan in lines]
    counted = {n: scan for n, scan in zip(numbers, lines, strict=True) if n is not None}
    if len(frames) == len(lines) == 1:
        return iter([(frames[0], lines[0])])
    if len(counted) == len(lines) and {f.number for f in frames} <= set(counted):
        return iter([(f, counted[f.number]) for f in frames])
    if len(lines) != len(frames):
        raise InputError(
            f"{path}: holds {len(lines)} profile{'s' * (len(lines) != 1)}, and {len(frames)} row"
            f"{'s' * (len(frames) != 1)} of the frames' file name{'s' * (len(frames) == 1)} it: profiles and poses "
            "are out of step"
        )
    return zip(sorted(frames, key=lambda f: f.line), lines, strict=True)


def _mixed(formats: Counter[str]) -> tuple[str, ...]:
    if len(formats) < 2:
        return ()
    listed = ", ".join(f"{name} ({count})" for name, count in sorted(formats.items()))
    return (
        f"the profiles are in {len(formats)} formats: {listed}; [profile] format names one where that is a mistake",
    )
