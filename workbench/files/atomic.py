"""Files that appear whole or not at all, with the folders on the way."""

from __future__ import annotations

import hashlib
from pathlib import Path

import geometry
from geometry import InputError


def write_bytes(path: Path, data: bytes) -> None:
    """Write ``data`` to ``path`` atomically, making folders on the way; InputError where that can not be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{path}: can not be written ({error.strerror or error})") from None
    geometry.write_bytes(path, data)


def write_text(path: Path, text: str) -> None:
    """Write ``text`` as UTF-8 with plain line feeds, atomically."""
    write_bytes(path, text.encode("utf-8"))


def sha256_of(path: Path) -> str:
    """SHA-256 of a file's bytes, as hexadecimal digits; InputError where it can not be read."""
    try:
        if not path.is_file():
            raise InputError(f"{path}: is no file on disk")
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise InputError(f"{path}: can not be read ({error.strerror or error})") from None
