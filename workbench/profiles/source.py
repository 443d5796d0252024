"""The bytes of a profile file, with the text and the arrays that they may be, in bounded memory."""

from __future__ import annotations

import ast
import re
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, read_bytes
from workbench.files import read_table_text

MAX_PROFILE_BYTES = 128 * 2**20  # four thousand profiles of 3,200 points as text
MAX_POINTS = 20_000_000  # of all profiles of a file, missing ones too
_NPY_KINDS = "biufV"
_HEAD = 4096  # bytes that a format is recognised by


@dataclass(frozen=True)
class Source:
    """A profile file on disk."""

    path: Path
    data: bytes

    @cached_property
    def head(self) -> str:
        """The file's beginning as text; empty where it is none."""
        try:
            return self.data[:_HEAD].decode("utf-8-sig", errors="replace") if not self.is_utf16 else self.text[:_HEAD]
        except InputError:
            return ""

    @property
    def is_utf16(self) -> bool:
        """Whether a byte-order mark says so."""
        return self.data[:2] in (b"\xff\xfe", b"\xfe\xff")

    @property
    def is_binary(self) -> bool:
        """Whether the beginning can not be text."""
        return b"\0" in self.data[:_HEAD] and not self.is_utf16

    @cached_property
    def text(self) -> str:
        """All of it as text; InputError where it is none."""
        return read_table_text(self.path)

    def beside(self, suffix: str) -> Path:
        """The file of the same name with another suffix."""
        return self.path.with_suffix(suffix)

    @cached_property
    def array(self) -> NDArray[Any]:
        """The array of a .npy; nothing in it is executed."""
        return read_npy(self.data, self.path)


def open_source(path: Path) -> Source:
    """A profile file's bytes; InputError where there are none or too many."""
    return Source(path, read_bytes(path, MAX_PROFILE_BYTES, "profile"))


def read_npy(data: bytes, path: Path) -> NDArray[Any]:
    """The array of a .npy file of numbers or records of numbers, its header read as literals alone.

    Done by hand, because numpy's own reader asks for memory before it knows that the file holds as much.
    """
    broken = InputError(f"{path}: is no NumPy file of numbers, or it is cut short")
    if not data.startswith(b"\x93NUMPY") or len(data) < 12:
        raise broken
    size = 2 if data[6] == 1 else 4
    start = 8 + size + int.from_bytes(data[8 : 8 + size], "little")
    if data[6] not in (1, 2, 3) or start > min(len(data), 65536):
        raise broken
    try:
        header = ast.literal_eval(data[8 + size : start].decode("utf-8"))
        dtype = np.dtype(header["descr"])
        shape = tuple(int(n) for n in header["shape"])
        header["fortran_order"] = bool(header["fortran_order"])
    except (ValueError, SyntaxError, TypeError, KeyError, MemoryError, RecursionError, UnicodeDecodeError, IndexError):
        raise broken from None
    except Exception as error:  # noqa: BLE001 - dtype strings fail in many ways, all of them the file's fault
        raise InputError(f"{path}: is no NumPy file of numbers ({type(error).__name__} in its header)") from None
    if dtype.hasobject or dtype.kind not in _NPY_KINDS or dtype.itemsize == 0 or any(n < 0 for n in shape):
        raise InputError(f"{path}: holds no numbers, so it is no profile")
    count = 1
    for n in shape:
        count *= n
    if count > MAX_POINTS or count * dtype.itemsize > len(data) - start:
        raise InputError(f"{path}: is cut short: {count} values were announced")
    array: NDArray[Any] = np.frombuffer(data, dtype, count, start)
    return array.reshape(shape, order="F" if header["fortran_order"] else "C")


_NUMBER = re.compile(r"[-+−]?(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][-+]?\d+)?")
_MISSING = ("", "nan", ".nan", "-", "--", "null", "n/a", "#n/a", "inf", "-inf", ".inf", "-.inf")
MAX_DIGITS = 60  # of a number as text


def cell_value(text: str, where: str) -> float:
    """A cell as a number, NaN where it is missing; InputError where it is neither."""
    if text.casefold() in _MISSING:
        return float("nan")
    if len(text) > MAX_DIGITS or not _NUMBER.fullmatch(text):
        raise InputError(f'{where}: "{" ".join(text[:40].split())}" is not a number')
    value = float(text.replace("−", "-"))
    return value if abs(value) < 1e30 else float("nan")
