"""The images of a folder that a twin is asked of."""

from __future__ import annotations

from pathlib import Path

from geometry import InputError

KINDS = (".png", ".tif", ".tiff", ".bmp")
AT_MOST = 12  # images, evenly spaced among all


def find_images(folder: Path) -> list[Path]:
    """Image files of a folder, or of its images/ where it is a dataset; evenly spaced where they are many.

    Raises
    ------
    InputError
        Where there is none.
    """
    place = folder / "images" if (folder / "images").is_dir() else folder
    if not place.is_dir():
        raise InputError(f"{folder}: there is no such folder; a twin wants a dataset or a folder of stripe images")
    files = sorted(p for p in place.iterdir() if p.suffix.lower() in KINDS and not p.stem.endswith("_off"))
    if not files:
        raise InputError(f"{place}: no images in it ({', '.join(KINDS)}); a twin wants stripe images of the sensor")
    count = min(AT_MOST, len(files))
    return [files[k * len(files) // count] for k in range(count)]
