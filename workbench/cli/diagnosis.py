"""What works on this machine: libraries, the system's GL, the chain itself on one emulated frame."""

from __future__ import annotations

import importlib.metadata
import importlib.util
import os
import platform
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from workbench import defaults
from workbench.cli.extras import EXTRAS

State = Literal["ok", "absent", "broken"]

# module: distribution; all of them are installed with the package
CORE = {
    "numpy": "numpy",
    "scipy": "scipy",
    "cv2": "opencv-python-headless",
    "skimage": "scikit-image",
    "trimesh": "trimesh",
    "numba": "numba",
    "pydantic": "pydantic",
    "typer": "typer",
    "rich": "rich",
    "matplotlib": "matplotlib",
    "jinja2": "jinja2",
    "pyrender": "pyrender2",
}
GL_PURPOSE = "for --renderer pyrender and the picture of the cell; all else needs none"


@dataclass(frozen=True)
class Diagnosed:
    """One thing that was looked at. broken: the default path does not work without it."""

    state: State
    what: str
    detail: str


def diagnose() -> Iterator[Diagnosed]:
    """Look at everything, one finding after the other."""
    yield _python()
    yield from _libraries()
    yield from _extras()
    yield _gl()
    yield _cache()
    yield _chain()


def _python() -> Diagnosed:
    ok = sys.version_info >= (3, 11)
    detail = f"{platform.python_version()} on {platform.system()} {platform.machine()}, {os.cpu_count()} processors"
    return Diagnosed("ok" if ok else "broken", "Python", detail + ("" if ok else "; 3.11 or newer is needed"))


def _libraries() -> Iterator[Diagnosed]:
    for module, distribution in CORE.items():
        try:
            version = importlib.metadata.version(distribution)
        except importlib.metadata.PackageNotFoundError:
            version = "?"
        if importlib.util.find_spec(module) is None:
            yield Diagnosed("broken", distribution, f"not installed: pip install {distribution}")
        else:
            yield Diagnosed("ok", distribution, version)


def _extras() -> Iterator[Diagnosed]:
    for extra, (modules, purpose) in EXTRAS.items():
        missing = [m for m in modules if importlib.util.find_spec(m) is None]
        if missing:
            hint = f"{', '.join(missing)} missing, for {purpose}: pip install 'perceptron-emu[{extra}]'"
            yield Diagnosed("absent", f"extra {extra}", hint)
        else:
            yield Diagnosed("ok", f"extra {extra}", purpose)


def _gl() -> Diagnosed:
    """Whether a frame can truly be drawn: a library that is there may still find no device."""
    from perceptron_emu.gl import gl_problem

    problem = gl_problem()
    if problem is None:
        platform = os.environ.get("PYOPENGL_PLATFORM", "egl")
        return Diagnosed("ok", "off-screen GL", f"by {platform}, {GL_PURPOSE}")
    return Diagnosed("absent", "off-screen GL", f"{problem} ({GL_PURPOSE})")


def _cache() -> Diagnosed:
    """Compiled code is kept between runs where numba can write; else every run compiles again."""
    place = Path(os.environ.get("NUMBA_CACHE_DIR", Path(__file__).parent))
    if os.access(place, os.W_OK) or os.access(Path.home(), os.W_OK):
        return Diagnosed("ok", "compiled code's cache", "can be written")
    hint = "can not be written, every run compiles again: set NUMBA_CACHE_DIR to a folder of yours"
    return Diagnosed("absent", "compiled code's cache", hint)


def _chain() -> Diagnosed:
    """Render one frame of a jig, write and read it as PNG, extract and label it."""
    start = time.perf_counter()
    try:
        found, wanted = _one_frame()
    except Exception as error:  # noqa: BLE001 - whatever fails here is what the user must hear of
        return Diagnosed("broken", "chain", f"render, write, read, extract, label: {type(error).__name__}: {error}")
    detail = f"one emulated frame: {found} of {wanted} strings found and labelled, {time.perf_counter() - start:.1f} s"
    return Diagnosed("ok" if found == wanted else "broken", "chain", detail)


def _one_frame() -> tuple[int, int]:
    import numpy as np

    from extraction import extract
    from geometry import Frame, Pose
    from perceptron_emu import Scene, render
    from workbench.cell import find_emulator, find_jig, find_sensor, label_alone
    from workbench.files import read_image, write_png

    sensor, jig = find_sensor(defaults.SENSOR), find_jig(defaults.JIG)
    pose = Pose.from_fixed_xyz_deg((6.0, -14.0, 8.0), (-50.0, 3.0, 230.0))
    frame = render(Scene(sensor, jig, pose), find_emulator(defaults.SENSOR), np.random.default_rng(0))
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "frame.png"
        write_png(path, frame.image)
        image = read_image(path, sensor)
    found = label_alone(Frame(0, "", points=extract(image, sensor)), jig, sensor)
    return len(found.axis), len(jig.strings)
