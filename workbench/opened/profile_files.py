"""Profiles of an opened folder: listed once, read when needed, kept like pictures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from extraction import Profile
from geometry import InputError, Sensor
from geometry.sensor import ProfileOutput
from workbench.cell import ProfileSource, read_profile
from workbench.files import Cell, Image
from workbench.opened.pictures import Pictures, Stamp

Content = Image | Profile  # what an opened folder holds one of for each frame


@dataclass(frozen=True, eq=False)
class ProfileRecords:
    """Profiles by index, with the face of `Pictures`. read: gives the profile of an index."""

    files: Pictures
    get: Callable[[int], Profile]

    @property
    def root(self) -> Path:
        """The opened folder."""
        return self.files.root

    @property
    def paths(self) -> list[Path]:
        """The files, one for each profile."""
        return self.files.paths

    def __len__(self) -> int:
        """The number of profiles."""
        return len(self.files)

    def name(self, index: int) -> str:
        """The file's name relative to the opened folder, and which of its profiles it is."""
        first, several = self._first_of[self.files.paths[index]]
        return f"{self.files.name(index)} #{index - first}" if several else self.files.name(index)

    @cached_property
    def _first_of(self) -> dict[Path, tuple[int, bool]]:
        """The first profile of each file, and whether there are more."""
        found: dict[Path, tuple[int, bool]] = {}
        for i, path in enumerate(self.files.paths):
            found[path] = (found[path][0], True) if path in found else (i, False)
        return found

    def state(self, index: int) -> str:
        """A word for the state of the file now."""
        return self.files.state(index)

    def stamp(self, index: int) -> Stamp:
        """The state of the file now."""
        return self.files.stamp(index)

    def stamped(self, index: int) -> tuple[Stamp, Profile]:
        """The profile and the state of its file; InputError that says why not."""
        return self.stamp(index), self.get(index)

    def read(self, index: int) -> Image:
        """There is no image."""
        raise InputError(f"{self.name(index)}: is a profile, there is no image of it")

    def add(self, paths: Sequence[Path]) -> None:
        """Further profile files are not taken in."""
        if paths:
            raise InputError("profiles are not watched")


def cell_profiles(cell: Cell) -> ProfileRecords:
    """The profiles of a dataset's frames, in their order."""
    output = cell.sensor.profile or ProfileOutput()
    from workbench.profiles import frame_profiles

    found = frame_profiles(cell.folder, cell.frames, output)

    def get(index: int) -> Profile:
        number = cell.frames[index].number
        if number not in found.profiles:
            raise InputError(found.complaints.get(number, f"frame {number} has no profile"))
        return found.profiles[number].profile

    paths = [cell.folder / row.profile for row in cell.frames]
    return ProfileRecords(Pictures(cell.folder, paths, cell.sensor), get)


def bare_profiles(folder: Path, paths: Sequence[Path], sensor_file: Path | None, sensor: Sensor) -> ProfileRecords:
    """The profiles of files: one a file, or all those of a single one."""
    if len(paths) == 1:
        from workbench.profiles import Told, checked_profile, read_scan_lines

        output = sensor.profile or ProfileOutput()
        told = Told(output.format, output.pitch_mm, output.start_mm, output.unit, output.width)
        try:
            lines = read_scan_lines(paths[0], told)
        except InputError:
            lines = ()
        if len(lines) > 1:
            files = Pictures(folder, [paths[0]] * len(lines), sensor)
            return ProfileRecords(files, lambda i: checked_profile(lines[i], output, paths[0]).profile)
    return ProfileRecords(Pictures(folder, paths, sensor), lambda i: read_profile(ProfileSource(paths[i], sensor_file)))
