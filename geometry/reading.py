"""Files of unknown making, read in bounded time and memory: what every room that reads files needs."""

from __future__ import annotations

import os
import re
import stat
import tomllib
from collections.abc import Callable
from typing import Any

from geometry.errors import InputError

Remark = Callable[[str], None]  # told in one sentence what a reader noticed and did not refuse

MAX_TEXT_BYTES = 64 * 2**20  # a text file beyond this is not one of ours
MAX_TOML_BYTES = 4 * 2**20  # settings and geometry are written by hand or by us: tens of kilobytes
MAX_KEY_PARTS = 32  # of a dotted key: tomllib takes quadratic time over them, hours from some 10⁵ on
LARGEST_NUMBER = 1e30  # in any unit; beyond it squares and cubes of a value soon overflow
_OUTSIDE_KEYS = re.compile(r"[\n=,{}]")
_KEY_CHARACTERS = re.compile(r"[\w\-.\"' \t\[\]]+")


def no_remark(sentence: str) -> None:
    """Where nobody listens."""


def read_bytes(path: str | os.PathLike[str], limit: int = MAX_TEXT_BYTES, what: str = "file") -> bytes:
    """The bytes of a regular file.

    Parameters
    ----------
    path
        The file.
    limit
        Bytes that it may hold at most.
    what
        Its kind, for the sentences.

    Returns
    -------
    bytes
        All of it, at least one.

    Raises
    ------
    InputError
        Where it is missing, empty, too large, a folder, a device or a pipe, or can not be read.

    """
    try:
        mode = os.stat(path).st_mode
        if stat.S_ISDIR(mode):
            raise InputError(f"{path}: is a folder, {_a(what)} is needed here")
        if not stat.S_ISREG(mode):
            raise InputError(f"{path}: is a device or a pipe, {_a(what)} on disk is needed here")
        with open(path, "rb") as stream:
            data = stream.read(limit + 1)
    except FileNotFoundError:
        raise InputError(f"{path}: no such {what}") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: can not be read ({getattr(error, 'strerror', None) or error})") from None
    if len(data) > limit:
        raise InputError(f"{path}: is larger than {limit / 2**20:.3g} MB, which no {what} of this kind is")
    if not data:
        raise InputError(f"{path}: the {what} is empty (0 bytes)")
    return data


def _a(what: str) -> str:
    return f"{'an' if what[0] in 'aeiou' else 'a'} {what}"


def read_text(path: str | os.PathLike[str], limit: int = MAX_TEXT_BYTES) -> str:
    """The text of a UTF-8 file without its byte-order mark; InputError as `read_bytes`, and where it is not text."""
    raw = read_bytes(path, limit)
    if not raw.strip():
        raise InputError(f"{path}: the file is empty")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise InputError(f"{path}, line {line}: the file is not UTF-8 text (byte {error.start})") from None


def parse_toml(text: str, where: str) -> dict[str, Any]:
    """The data of a TOML text in time and memory that grow with its length, its numbers within LARGEST_NUMBER.

    Parameters
    ----------
    text
        The text.
    where
        Its file's name, for the sentences.

    Returns
    -------
    dict
        As `tomllib` gives it.

    Raises
    ------
    InputError
        Naming the line where it is no TOML, or beyond what a file of this kind can be.

    """
    _check_keys(text, where)
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        found = re.search(r"line (\d+)", str(error))
        reason = re.sub(r"\s*\(at .*\)$", "", str(error))[:200]
        line = found[1] if found else text.count("\n") + 1
        raise InputError(f"{where}, line {line}: not valid TOML, {reason[:1].lower()}{reason[1:]}") from None
    except RecursionError:
        raise InputError(f"{where}: not a file of this kind: lists or tables are nested hundreds deep") from None
    except ValueError as error:  # a whole number of thousands of digits, a date that is none
        raise InputError(f"{where}: not valid TOML, {str(error).split(';')[0][:200]}") from None
    _check_numbers(data, where)
    return data


def _check_keys(text: str, where: str) -> None:
    """No dotted key is longer than any of ours by far."""
    if len(text) > MAX_TOML_BYTES:
        raise InputError(f"{where}: is larger than {MAX_TOML_BYTES // 2**20} MB, which no TOML file of this kind is")
    start = 0
    for end in (*(m.start() for m in _OUTSIDE_KEYS.finditer(text)), len(text)):
        value = text[start - 1 : start] == "="
        if not value and text.count(".", start, end) >= MAX_KEY_PARTS and _KEY_CHARACTERS.fullmatch(text, start, end):
            line = text.count("\n", 0, start) + 1
            raise InputError(f"{where}, line {line}: a key has more than {MAX_KEY_PARTS} parts with dots between them")
        start = end + 1


def _check_numbers(data: dict[str, Any], where: str) -> None:
    """Walks without recursion: nesting is as deep as the parser allows."""
    waiting: list[tuple[str, Any]] = list(data.items())
    while waiting:
        key, value = waiting.pop()
        if isinstance(value, dict):
            waiting.extend(value.items())
        elif isinstance(value, list):
            waiting.extend((key, v) for v in value)
        elif isinstance(value, int | float) and LARGEST_NUMBER < abs(value) < float("inf"):
            shown = f"{value:g}" if isinstance(value, float) else f"a whole number of {_digits(value)} digits"
            raise InputError(f"{where}: {key[:60]} = {shown}: no quantity is larger than {LARGEST_NUMBER:g}")


def _digits(value: int) -> int:
    """Decimal digits, by the length in bits: Python does not print integers of thousands of digits."""
    return int(abs(value).bit_length() * 0.30103) + 1
