"""The images of the opened folder: listed once, read when needed, never by a name that came from the browser."""

from __future__ import annotations

import threading
from collections import OrderedDict
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from geometry import InputError, Sensor
from workbench.files.images import SUFFIXES, Image, read_image

MAX_IMAGES = 20_000
CACHE_BYTES = 512 * 2**20


class PictureError(InputError):
    """One image that can not be shown; the others can."""


def list_images(folder: Path) -> tuple[Path, ...]:
    """The image files directly in ``folder`` or in its ``images``, sorted by name; InputError where there are none."""
    if not folder.is_dir():
        raise InputError(f"{folder}: no such folder")
    found = _images_in(folder) or _images_in(folder / "images")
    if not found:
        raise InputError(f"{folder}: holds no images ({', '.join(SUFFIXES)}), nor does its folder images")
    if len(found) > MAX_IMAGES:
        raise InputError(f"{folder}: holds {len(found)} images, at most {MAX_IMAGES} can be opened at once")
    return found


def _images_in(folder: Path) -> tuple[Path, ...]:
    if not folder.is_dir():
        return ()
    return tuple(sorted(p for p in folder.iterdir() if p.suffix.lower() in SUFFIXES and not p.name.startswith(".")))


@dataclass(frozen=True)
class Stamp:
    """What tells one state of a file from another."""

    mtime_ns: int
    size: int


class Pictures:
    """Decoded images by index, the most recently used ones kept in memory."""

    def __init__(self, root: Path, paths: Iterable[Path], sensor: Sensor) -> None:
        """``root``: the opened folder; a path that leads out of it, also by a link, is refused when it is read."""
        self.root = root.resolve()
        self.paths = tuple(paths)
        self._sensor = sensor
        self._lock = threading.Lock()
        self._kept: OrderedDict[int, tuple[Stamp, Image]] = OrderedDict()
        self._bytes = 0

    def __len__(self) -> int:
        """The number of images."""
        return len(self.paths)

    def name(self, index: int) -> str:
        """The file's name relative to the opened folder."""
        path = self.paths[index].absolute()
        return str(path.relative_to(self.root)) if path.is_relative_to(self.root) else path.name

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
        stamp = self.stamp(index)
        with self._lock:
            kept = self._kept.get(index)
            if kept is not None and kept[0] == stamp:
                self._kept.move_to_end(index)
                return kept[1]
        image = read_image(self.paths[index], self._sensor)
        self._keep(index, stamp, image)
        return image

    def _keep(self, index: int, stamp: Stamp, image: Image) -> None:
        with self._lock:
            old = self._kept.pop(index, None)
            self._bytes += image.nbytes - (old[1].nbytes if old else 0)
            self._kept[index] = (stamp, image)
            while self._bytes > CACHE_BYTES and len(self._kept) > 1:
                self._bytes -= self._kept.popitem(last=False)[1][1].nbytes
