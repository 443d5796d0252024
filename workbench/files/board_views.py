"""The pictures of a sensor's calibration: pairs NAME_off / NAME_on, a views.csv, or single pictures."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from geometry import Camera, InputError, Pose, Remark, Sensor, Sheet, no_remark, read_bytes
from workbench.files.image_header import read_header
from workbench.files.images import LOSSY_SUFFIXES, MAX_FILE_BYTES
from workbench.files.tables import read_table

OFF, ON = "_off", "_on"
VIEWS_FILE = "views.csv"


@dataclass(frozen=True)
class ViewFiles:
    """One view: the picture of the board and, where there is one, that with the stripe; one file may be both."""

    name: str
    board: Path
    stripe: Path | None


def find_views(folder: Path, remark: Remark = no_remark) -> tuple[ViewFiles, ...]:
    """The views of a folder.

    Parameters
    ----------
    folder
        Holds views.csv, or pictures (else its sub-folder images does): NAME_off and NAME_on of the same unmoved board;
        where no name ends so, single pictures that show board and stripe. Names that begin with _ or . are left out.
    remark
        Told what has no partner.

    Returns
    -------
    tuple of ViewFiles
        By name.

    Raises
    ------
    InputError
        Where there is no picture, or views.csv names none.

    """
    if not folder.is_dir():
        raise InputError(f"{folder}: is no folder; calibrate-sensor takes a folder of pictures")
    if (folder / VIEWS_FILE).is_file():
        return _listed(folder / VIEWS_FILE, remark)
    pictures = _pictures(folder) or _pictures(folder / "images")
    if not pictures:
        raise InputError(
            f"{folder}: holds no picture; pairs NAME_off.png and NAME_on.png (board lit; stripe on) are needed"
        )
    stems: dict[str, dict[str, Path]] = {}
    for path in pictures:
        for end in (OFF, ON):
            if path.stem.lower().endswith(end):
                stems.setdefault(path.stem[: -len(end)], {})[end] = path
    if not stems:
        return tuple(ViewFiles(p.stem, p, p) for p in pictures)
    for name, found in stems.items():
        if OFF not in found:
            remark(f"{found[ON]}: has no partner {name}{OFF}, left out")
        elif ON not in found:
            remark(f"{found[OFF]}: has no partner {name}{ON}; its board helps the camera alone")
    return tuple(ViewFiles(n, f[OFF], f.get(ON)) for n, f in sorted(stems.items()) if OFF in f)


def _pictures(folder: Path) -> list[Path]:
    if not folder.is_dir():
        return []
    return sorted(p for p in folder.iterdir() if p.suffix.lower() in LOSSY_SUFFIXES and p.name[0] not in "._")


def _listed(path: Path, remark: Remark) -> tuple[ViewFiles, ...]:
    table = read_table(path, ("view", "board", "stripe"), ("view", "board"), remark=remark)
    views = []
    for row in table.rows:
        stripe = row.cells.get("stripe", "")
        views.append(
            ViewFiles(row.text("view"), path.parent / row.text("board"), path.parent / stripe if stripe else None)
        )
    if not views:
        raise InputError(f"{path}: lists no view")
    double = [name for name, count in Counter(v.name for v in views).items() if count > 1]
    if double:
        raise InputError(f'{path}: the view "{double[0]}" stands there twice')
    return tuple(views)


def picture_sensor(paths: tuple[Path, ...], channel: str | None = None) -> Sensor:
    """What the pictures say of their camera, as a sensor that reads them; its geometry is none yet.

    InputError where they differ in size or depth, naming one of the fewer.
    """
    sizes = {}
    for path in paths:
        header = read_header(path, read_bytes(path, MAX_FILE_BYTES, "image file"), lossy=True)
        sizes[path] = (header.width, header.height, header.significant_bits or header.bits)
    usual, _ = Counter(sizes.values()).most_common(1)[0]
    for path, size in sizes.items():
        if size[:2] != usual[:2]:
            raise InputError(
                f"{path}: is {size[0]} × {size[1]} px, most others are {usual[0]} × {usual[1]} px; one camera with one "
                "setting is calibrated at a time"
            )
        if size[2] != usual[2]:
            raise InputError(f"{path}: has {size[2]} bits a pixel, most others {usual[2]}")
    width, height, bits = usual
    depth = next((d for d in (8, 10, 12, 14, 16) if d >= bits), 16)
    facing = Pose(np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]]), np.array([100.0, 0.0, 0.0]))
    camera = Camera(width, height, float(width), float(width), (width - 1) / 2, (height - 1) / 2, facing)
    return Sensor(Sheet(), camera).with_camera(bit_depth=depth, channel=channel)
