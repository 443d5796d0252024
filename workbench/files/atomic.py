"""Files that appear whole or not at all: written beside their place and moved into it."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from geometry import InputError


def write_bytes(path: Path, data: bytes) -> None:
    """Write ``data`` to ``path`` atomically, making folders on the way; InputError where that can not be."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.", suffix=".part")
    except OSError as error:
        raise InputError(f"{path}: can not be written ({error.strerror or error})") from None
    try:
        with os.fdopen(handle, "wb") as stream:
            stream.write(data)
        Path(name).chmod(0o644)
        Path(name).replace(path)
    except BaseException as error:
        Path(name).unlink(missing_ok=True)
        if isinstance(error, OSError):
            raise InputError(f"{path}: can not be written ({error.strerror or error})") from None
        raise


def write_text(path: Path, text: str) -> None:
    """Write ``text`` as UTF-8 with plain line feeds, atomically."""
    write_bytes(path, text.encode("utf-8"))
