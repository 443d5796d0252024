"""Which off-screen OpenGL is taken, and what is said where there is none, whatever this machine has."""

from __future__ import annotations

import ctypes
import os
import sys
from types import ModuleType, SimpleNamespace

import pytest

from geometry import MissingDependencyError
from perceptron_emu.gl import context

RENDERER = context._renderer  # with its cache


@pytest.fixture(autouse=True)
def anew(monkeypatch: pytest.MonkeyPatch) -> None:
    """No platform chosen yet, and no renderer made; what tests make is forgotten."""
    monkeypatch.setenv("PYOPENGL_PLATFORM", "")
    monkeypatch.delenv("PYOPENGL_PLATFORM")
    monkeypatch.setattr(context, "_renderer", context._renderer.__wrapped__)


def _installed(monkeypatch: pytest.MonkeyPatch, *libraries: str) -> None:
    def cdll(name: str) -> SimpleNamespace:
        if name not in libraries:
            raise OSError(f"{name}: cannot open shared object file")
        return SimpleNamespace()

    monkeypatch.setattr(ctypes, "CDLL", cdll)


def _pyrender(monkeypatch: pytest.MonkeyPatch, error: Exception | None = None) -> None:
    def renderer(width: int, height: int) -> tuple[int, int]:
        if error:
            raise error
        return width, height

    monkeypatch.setitem(sys.modules, "pyrender", SimpleNamespace(OffscreenRenderer=renderer))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("libraries", "taken"),
    [
        (("libEGL.so.1", "libOSMesa.so.8"), "egl"),
        (("libEGL.so.1",), "egl"),
        (("libOSMesa.so.8",), "osmesa"),
    ],
)
def test_egl_first_then_osmesa(monkeypatch: pytest.MonkeyPatch, libraries: tuple[str, ...], taken: str) -> None:
    _installed(monkeypatch, *libraries)
    _pyrender(monkeypatch)
    assert context.gl_problem() is None
    assert os.environ["PYOPENGL_PLATFORM"] == taken


def test_without_either_library_the_remedy_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    _installed(monkeypatch)
    _pyrender(monkeypatch)
    problem = context.gl_problem()
    assert problem is not None
    assert problem.startswith("neither EGL nor OSMesa is installed")
    assert "apt-get install libegl1" in problem


def test_a_platform_that_draws_to_screens_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYOPENGL_PLATFORM", "glx")
    with pytest.raises(MissingDependencyError, match=r'PYOPENGL_PLATFORM = "glx": off-screen .* needs "egl" or "osm'):
        context.load_pyrender()


def test_a_process_has_one_renderer() -> None:
    assert RENDERER.cache_parameters()["maxsize"] == 1


def test_a_driver_that_fails_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYOPENGL_PLATFORM", "egl")
    _pyrender(monkeypatch, RuntimeError("eglInitialize failed"))
    assert "no off-screen OpenGL by egl (eglInitialize failed); on Debian" in str(context.gl_problem())


class _Broken(ModuleType):
    """A module whose import fails."""

    def __init__(self, error: Exception) -> None:
        super().__init__("pyrender")
        self.error = error

    def find_spec(self, name: str, _path: object = None, _target: object = None) -> None:
        """As a finder: raise for pyrender."""
        if name == "pyrender":
            raise self.error


@pytest.mark.parametrize(
    ("error", "words"),
    [
        (ImportError("no module"), "pyrender can not be loaded (no module): pip install pyrender2"),
        (AttributeError("eglGetDisplay"), "libOSMesa.so.8 of PYOPENGL_PLATFORM = osmesa is not installed"),
        (OSError("libOSMesa"), "libOSMesa.so.8 of PYOPENGL_PLATFORM = osmesa is not installed"),
    ],
)
def test_an_import_that_fails_is_said(monkeypatch: pytest.MonkeyPatch, error: Exception, words: str) -> None:
    monkeypatch.setenv("PYOPENGL_PLATFORM", "osmesa")
    monkeypatch.delitem(sys.modules, "pyrender", raising=False)
    monkeypatch.setattr(sys, "meta_path", [_Broken(error), *sys.meta_path])
    assert words in str(context.gl_problem())
