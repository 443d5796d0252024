"""Presets that ship with the package: sensors, jigs and robots as files, by name."""

from __future__ import annotations

from importlib.resources import files
from pathlib import Path

from geometry import InputError
from workbench.formats.strict import suggestion


def preset_names(kind: str) -> tuple[str, ...]:
    """Names of the presets of a kind: "sensors", "jigs" or "robots"."""
    return tuple(sorted(p.stem for p in _folder(kind).glob("*.toml")))


def preset(kind: str, name: str) -> Path:
    """The file of a preset; InputError with a suggestion where there is none of that name."""
    names = preset_names(kind)
    if name not in names:
        raise InputError(f"no {kind.removesuffix('s')} preset is called {name}{suggestion(name, names)}")
    return _folder(kind) / f"{name}.toml"


def _folder(kind: str) -> Path:
    return Path(str(files("assets"))) / kind
