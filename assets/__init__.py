"""What ships with the package as data: sensor, jig and robot presets (TOML), a small recorded sample."""

from importlib.resources import files
from pathlib import Path

from geometry import InputError, did_you_mean

KINDS = ("jigs", "robots", "samples", "sensors")


def path(kind: str, name: str = "") -> Path:
    """The folder of a kind, or the file or folder ``name`` in it ("paper" stands for "paper.toml")."""
    if kind not in KINDS:
        raise InputError(f'no assets of kind "{kind}"' + _instead(kind, KINDS))
    folder = Path(str(files(__name__))) / kind
    if not name:
        return folder
    found = folder / name if (folder / name).exists() else folder / f"{name}.toml"
    if not found.exists():
        raise InputError(f'no preset "{name}" in {kind}' + _instead(name, list_presets(kind)))
    return found


def list_presets(kind: str) -> tuple[str, ...]:
    """The names of a kind's presets, sorted."""
    return tuple(sorted(p.stem for p in path(kind).iterdir() if p.suffix == ".toml" or p.is_dir()))


def _instead(name: str, known: tuple[str, ...]) -> str:
    return did_you_mean(name, known) or f"; there are {', '.join(known)}"
