"""environment.json: by what processors, libraries and kernels a run's rows were computed; the same rows by any."""

from __future__ import annotations

import ctypes
import hashlib
import json
import os
import platform
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

import numpy as np

from workbench.files import write_text

NAME = "environment.json"
ROOMS = ("geometry", "jig_cad", "perceptron_emu", "extraction", "calib", "workbench", "assets")
PACKAGES = ("numpy", "scipy", "numba", "opencv-python-headless", "pyarrow")


@cache
def code_version() -> str:
    """Short hash of this package's sources: the same code gives the same tables."""
    from importlib.util import find_spec

    digest = hashlib.sha256()
    for room in ROOMS:
        spec = find_spec(room)
        for folder in (spec.submodule_search_locations or ()) if spec else ():
            for path in sorted(p for p in Path(folder).rglob("*") if p.suffix in (".py", ".toml")):
                digest.update(path.relative_to(folder).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()[:12]


@cache
def numeric_environment() -> dict[str, str]:
    """What of this process could show in last bits: versions, processor features, BLAS with the kernels it chose."""
    features = np.show_config(mode="dicts")["SIMD Extensions"]
    return {
        "code": code_version(),
        "python": platform.python_version(),
        **{name: _version(name) for name in PACKAGES},
        "machine": f"{platform.system()} {platform.machine()}",
        "simd": " ".join([*features.get("baseline", ()), *features.get("found", ())]),
        "blas": _blas("numpy"),
        "blas_of_scipy": _blas("scipy"),
        "numba_cpu": os.environ.get("NUMBA_CPU_NAME") or "native",
    }


def note_environment(folder: Path, environment: dict[str, str]) -> None:
    """Add an environment to those that the run's folder names, where it is not among them."""
    path = folder / NAME
    try:
        known = json.loads(path.read_text(encoding="utf-8")) if path.exists() else []
    except ValueError:
        known = []
    known = known if isinstance(known, list) else []
    if environment and environment not in known:
        write_text(path, json.dumps([*known, environment], indent=1) + "\n")


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return ""


def _blas(package: str) -> str:
    """Version and core type of the OpenBLAS that a wheel brings; "" where it is another library."""
    root = Path(__import__(package).__file__ or "").parent.parent
    for path in sorted((root / f"{package}.libs").glob("*openblas*")):
        library = ctypes.CDLL(str(path))  # loaded already: the same handle
        for suffix in ("64_", ""):
            try:
                config, core = (getattr(library, f"scipy_openblas_get_{w}{suffix}") for w in ("config", "corename"))
            except AttributeError:
                continue
            config.restype = core.restype = ctypes.c_char_p
            return f"{config().decode()} core {core().decode()}"
    return ""
