"""Off-screen OpenGL through pyrender: the one renderer of this process, and what to do where there is none."""

from __future__ import annotations

import contextlib
import ctypes
import os
import warnings
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import MissingDependencyError

LIBRARIES = {"egl": "libEGL.so.1", "osmesa": "libOSMesa.so.8"}
HOW_TO_GET = (
    "on Debian and Ubuntu: apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri (EGL), or libosmesa6 (OSMesa, "
    "taken where EGL is missing or by PYOPENGL_PLATFORM=osmesa)"
)


def gl_problem() -> str | None:
    """Why pyrender can not draw here.

    Returns
    -------
    str or None
        One sentence with the remedy; None where it can.
    """
    try:
        _renderer()
    except MissingDependencyError as error:
        return str(error)
    return None


def draw_gl(
    scene: Any, width: int, height: int, flags: int = 0, seg_node_map: Any = None
) -> tuple[Any, NDArray[np.float32]]:
    """Colour (H, W, 3) uint8 and depth (H, W) [mm], 0 where there is nothing, of a pyrender scene in millimetres.

    Raises MissingDependencyError where OpenGL is not to be had.
    """
    renderer = _renderer()
    renderer.viewport_width, renderer.viewport_height = width, height
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # pyrender's own, about numpy and OpenGL's deprecated calls
        colour, depth = renderer.render(scene, flags, seg_node_map)
    return colour, depth


def load_pyrender() -> Any:
    """The module pyrender, with the platform chosen before PyOpenGL can choose another."""
    platform = os.environ.setdefault("PYOPENGL_PLATFORM", _platform())
    if platform not in LIBRARIES:
        raise MissingDependencyError(f'PYOPENGL_PLATFORM = "{platform}": off-screen rendering needs "egl" or "osmesa"')
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            import pyrender
    except ImportError as error:
        text = f"pyrender can not be loaded ({error}): pip install pyrender2; {HOW_TO_GET}"
        raise MissingDependencyError(text) from error
    except (AttributeError, OSError) as error:  # how PyOpenGL says that the platform's library is not there
        text = f"{LIBRARIES[platform]} of PYOPENGL_PLATFORM = {platform} is not installed; {HOW_TO_GET}"
        raise MissingDependencyError(text) from error
    return pyrender


@lru_cache(maxsize=1)
def _renderer() -> Any:
    """The one off-screen renderer: deleting a second would break the first (a trait of EGL contexts in one process)."""
    pyrender = load_pyrender()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return pyrender.OffscreenRenderer(64, 64)
    except Exception as error:
        platform = os.environ["PYOPENGL_PLATFORM"]
        raise MissingDependencyError(f"no off-screen OpenGL by {platform} ({error}); {HOW_TO_GET}") from error


def _platform() -> str:
    """EGL, or OSMesa where EGL's library is absent."""
    for name, library in LIBRARIES.items():
        with contextlib.suppress(OSError):
            ctypes.CDLL(library)
            return name
    raise MissingDependencyError(f"neither EGL nor OSMesa is installed, the pyrender renderer needs one; {HOW_TO_GET}")
