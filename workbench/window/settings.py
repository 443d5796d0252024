"""Saving and loading parameters as TOML, inside one folder and under plain names only."""

from __future__ import annotations

import re
from pathlib import Path

from geometry import InputError

NAME = re.compile(r"^[A-Za-z0-9][A-Za-z0-9 ._\-]{0,79}\.toml$")
MAX_TOML_BYTES = 64 * 1024


def inside(folder: Path, name: str) -> Path:
    """The path of a settings file called ``name``; InputError where the name is anything but a plain TOML file name."""
    if not NAME.fullmatch(name) or ".." in name:
        raise InputError(
            'a settings file needs a plain name such as "extraction.toml": letters, digits, ., -, _ and spaces'
        )
    root = folder.resolve()
    path = root / name
    if path.is_symlink() or path.resolve().parent != root:
        raise InputError(f"{name}: leads out of the opened folder")
    return path


def read(folder: Path, name: str) -> str:
    """The text of a settings file."""
    path = inside(folder, name)
    try:
        if path.stat().st_size > MAX_TOML_BYTES:
            raise InputError(f"{name}: is larger than {MAX_TOML_BYTES // 1024} kB, which no settings file is")
        if not path.is_file():
            raise InputError(f"{name}: is no file")
        return path.read_text("utf-8-sig")
    except FileNotFoundError:
        raise InputError(f"{name}: no such file in the opened folder") from None
    except UnicodeDecodeError:
        raise InputError(f"{name}: is not UTF-8 text") from None
    except OSError as error:
        raise InputError(f"{name}: can not be read ({error.strerror})") from None


def names(folder: Path) -> list[str]:
    """TOML files of the folder that may be asked for."""
    try:
        found = sorted(p.name for p in folder.iterdir() if NAME.fullmatch(p.name) and p.is_file())
    except OSError:
        return []
    return found[:500]
