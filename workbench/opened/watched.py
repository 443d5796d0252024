"""A folder that a running cell writes its images into."""

from __future__ import annotations

import os
from dataclasses import dataclass, field
from pathlib import Path

from workbench.opened.pictures import Stamp

ENDS = {".png": b"IEND\xaeB`\x82", ".jpg": b"\xff\xd9", ".jpeg": b"\xff\xd9"}  # what a whole file ends with


@dataclass(eq=False)
class WatchedFolder:
    """Tells which images came: one whose end is not there waits; where the format has none, until it has not grown."""

    folder: Path
    suffixes: tuple[str, ...]
    known: set[str]
    _growing: dict[str, Stamp] = field(default_factory=dict)

    def look(self) -> list[Path]:
        """The images that are new and whole, by name; nothing where the folder can not be read now."""
        stamps: dict[str, Stamp] = {}
        try:
            with os.scandir(self.folder) as found:
                new = [e for e in found if e.name not in self.known and e.name.lower().endswith(self.suffixes)]
            for entry in new:
                status = entry.stat()
                if status.st_size and entry.is_file():
                    stamps[entry.name] = Stamp(status.st_mtime_ns, status.st_size)
        except OSError:
            return []
        whole = sorted(
            n for n, stamp in stamps.items() if self._growing.get(n) == stamp or _has_its_end(self.folder / n)
        )
        self._growing = stamps
        self.known.update(whole)
        return [self.folder / name for name in whole]


def _has_its_end(path: Path) -> bool:
    end = ENDS.get(path.suffix.lower())
    if end is None:
        return False
    try:
        with path.open("rb") as file:
            file.seek(-len(end), os.SEEK_END)
            return file.read() == end
    except OSError:
        return False
