"""Files that appear whole or not at all, and values as TOML: what every room that writes files needs."""

from __future__ import annotations

import os
import secrets
from contextlib import suppress
from pathlib import Path

from geometry.errors import InputError


def write_bytes(path: str | os.PathLike[str], data: bytes) -> None:
    """Write a file whole or not at all: beside its place first, then moved into it; its folder must be there.

    Raises
    ------
    InputError
        Where it can not be written; what stood there before still does.

    """
    goal = Path(path)
    part = goal.parent / f".{goal.name}.{secrets.token_hex(8)}.part"  # named first: no interrupt leaves it
    try:
        with part.open("xb") as stream:
            stream.write(data)
            stream.flush()
            os.fsync(stream.fileno())  # the name must never stand before the bytes do
        part.chmod(0o644)
        part.replace(goal)
    except BaseException as error:
        with suppress(OSError):
            part.unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise InputError(f"{goal}: can not be written ({error.strerror or error})") from None
        raise


def write_text(path: str | os.PathLike[str], text: str) -> None:
    """Write ``text`` as UTF-8 with plain line feeds, whole or not at all."""
    write_bytes(path, text.encode("utf-8"))


def toml_value(value: object) -> str:
    """Text, truth, a number, a list or a table as a TOML value, to the last bit."""
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else _escape(ord(c)) for c in escaped) + '"'
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{toml_value(str(k))} = {toml_value(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(toml_value(v) for v in value) + "]"
    return repr(value)


def _escape(code: int) -> str:
    return f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"
