"""A folder that a running cell writes its images into."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from workbench.opened.pictures import Stamp


@dataclass(eq=False)
class WatchedFolder:
    """Tells which images came: one that grows between two looks is still being written, and waits."""

    folder: Path
    suffixes: tuple[str, ...]
    known: set[Path]
    _growing: dict[Path, Stamp] = field(default_factory=dict)

    def look(self) -> list[Path]:
        """The images that are new and whole, by name; nothing where the folder can not be read now."""
        try:
            found = [p for p in self.folder.iterdir() if p not in self.known and p.suffix.lower() in self.suffixes]
            stamps = {p: Stamp(s.st_mtime_ns, s.st_size) for p in found if (s := p.stat()).st_size}
        except OSError:
            return []
        whole = sorted(p for p, stamp in stamps.items() if self._growing.get(p) == stamp)
        self._growing = stamps
        self.known.update(whole)
        return whole
