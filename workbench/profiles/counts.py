"""Arrays of counts: a row a profile, from .npy or raw bytes, with what a file beside them tells."""

from __future__ import annotations

import io
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.files import FileSection, Positive, Real, Whole, read_toml, validate
from workbench.profiles.scan_line import Told
from workbench.profiles.source import Source


class BesideFile(FileSection):
    """A .toml of the same name beside an array: what the maker's library told with it."""

    pitch_mm: Positive | None = None
    start_mm: Real | None = None
    unit: Whole | None = None
    width: Whole | None = None


def beside(source: Source, told: Told) -> Told:
    """What is told, with what a .toml beside the file tells where nothing is."""
    path = source.beside(".toml")
    if not path.is_file() or path.name in ("sensor.toml", "cell.toml"):
        return told
    found = validate(BesideFile, read_toml(path))
    gaps = {k: getattr(found, k) for k in ("pitch_mm", "start_mm", "unit", "width") if getattr(told, k) is None}
    return replace(told, **gaps)


def as_rows(source: Source, told: Told, dtype: np.dtype[Any]) -> NDArray[Any]:
    """The counts (P, N) of a .npy, or of raw bytes with the width told."""
    if source.data.startswith(b"\x93NUMPY"):
        array = source.array
        if array.dtype.kind != dtype.kind or array.dtype.itemsize != dtype.itemsize:
            raise InputError(f"{source.path}: holds {array.dtype.name} numbers, this format has {dtype.name}")
        if array.ndim not in (1, 2) or array.size == 0:
            raise InputError(f"{source.path}: has shape {array.shape}: a profile, or a row a profile, is right")
        return np.atleast_2d(array)
    if told.width is None:
        raise InputError(f"{source.path}: raw counts need the points of a profile: give --width, or [profile] width")
    if told.width < 1 or len(source.data) % (dtype.itemsize * told.width):
        raise InputError(
            f"{source.path}: {len(source.data)} bytes are no whole number of profiles of {told.width} points of "
            f"{dtype.itemsize} bytes"
        )
    return np.frombuffer(source.data, dtype).reshape(-1, told.width)


def npy_bytes(array: NDArray[Any]) -> bytes:
    """An array as the bytes of a .npy."""
    buffer = io.BytesIO()
    np.save(buffer, array, allow_pickle=False)
    return buffer.getvalue()
