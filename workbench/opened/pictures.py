"""The images of an opened folder: listed once, read when needed, never by a name that came from outside."""

from __future__ import annotations

import os
import threading
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from geometry import InputError, Sensor
from workbench.files import Image, read_image, sensor_of_picture

CACHE_BYTES = 96 * 2**20  # some seventy images of 1280 × 1024: those looked at lately; ten thousand never fit


class PictureError(InputError):
    """One image that can not be shown; the others can."""


@dataclass(frozen=True)
class Stamp:
    """What tells one state of a file from another."""

    mtime_ns: int
    size: int

    def __str__(self) -> str:
        """A word for it, to be compared and no more."""
        return f"{self.mtime_ns:x}.{self.size:x}"


class Pictures:
    """Decoded images by index, the most recently used ones kept in memory."""

    def __init__(self, root: Path, paths: Iterable[Path], sensor: Sensor | None) -> None:
        """``root``: the opened folder; a path that leads out of it, also by a link, is refused when it is read.

        sensor: None where each picture's own size and levels are all that is known.
        """
        self.root = root.resolve()
        self.paths = list(paths)
        self._sensor = sensor
        self._lock = threading.Lock()
        self._kept: OrderedDict[int, tuple[Stamp, Image]] = OrderedDict()
        self._bytes = 0
        self._remarks: dict[int, list[str]] = {}

    def add(self, paths: Iterable[Path]) -> None:
        """More images, behind those that are there."""
        self.paths.extend(paths)

    def __len__(self) -> int:
        """The number of images."""
        return len(self.paths)

    def name(self, index: int) -> str:
        """The file's name relative to the opened folder."""
        path, root = os.path.abspath(self.paths[index]), f"{self.root}{os.sep}"
        return path.removeprefix(root) if path.startswith(root) else os.path.basename(path)

    def state(self, index: int) -> str:
        """A word for the state of the file now, "" where it is gone; its place is looked at when it is read."""
        try:
            status = os.stat(self.paths[index])
        except OSError:
            return ""
        return str(Stamp(status.st_mtime_ns, status.st_size))

    def stamp(self, index: int) -> Stamp:
        """The state of the file now; PictureError where it is gone or leads out of the folder."""
        path = self.paths[index]
        try:
            inside = path.resolve(strict=True).is_relative_to(self.root)
            status = path.stat()
        except OSError:
            raise PictureError(f"{path.name}: the file is gone or can not be reached any more") from None
        if not inside:
            raise PictureError(f"{path.name}: is a link that leads out of the opened folder")
        return Stamp(status.st_mtime_ns, status.st_size)

    def read(self, index: int) -> Image:
        """The image (H, W), grey, 8 or 16 bits; InputError that says why not."""
        return self.stamped(index)[1]

    def stamped(self, index: int) -> tuple[Stamp, Image]:
        """The image and the state of the file that it was read from; InputError that says why not."""
        stamp = self.stamp(index)
        with self._lock:
            kept = self._kept.get(index)
            if kept is not None and kept[0] == stamp:
                self._kept.move_to_end(index)
                return kept
        path, said = self.paths[index], list[str]()
        image = read_image(path, self._sensor or sensor_of_picture(path), said.append, lossy=True)
        self._keep(index, stamp, image)
        self._remarks.pop(index, None)
        if said:
            self._remarks[index] = said
        return stamp, image

    def remarks(self, index: int) -> list[str]:
        """What was remarked when the image was read last: a lossy format, colours."""
        return self._remarks.get(index, [])

    def _keep(self, index: int, stamp: Stamp, image: Image) -> None:
        with self._lock:
            old = self._kept.pop(index, None)
            self._bytes += image.nbytes - (old[1].nbytes if old else 0)
            self._kept[index] = (stamp, image)
            while self._bytes > CACHE_BYTES and len(self._kept) > 1:
                self._bytes -= self._kept.popitem(last=False)[1][1].nbytes
