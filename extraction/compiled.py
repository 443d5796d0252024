"""Compilation of the hot loops: numba's `njit` with its cache, typed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., object])

# division by zero gives infinity, as in numpy: no code for raising it
_OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
# values are finite; sums keep their order and nothing is fused, so that every processor gives the same last bits
_FINITE = {"nnan", "ninf", "nsz"}
_NO_WRAPPER: dict[str, Any] = {"no_cpython_wrapper": True}


def compiled(function: F) -> F:
    """The function compiled on its first call, single-threaded, and kept on disk for later processes."""
    return cast("F", _dated(njit(**_OPTIONS)(function)))


def compiled_fast(function: F) -> F:
    """As `compiled`, only where NaN and infinity can not occur: minima and maxima are then the vector unit's."""
    return cast("F", _dated(njit(**_OPTIONS, fastmath=_FINITE)(function)))


def inner(function: F) -> F:
    """As `compiled`, for a function that only compiled code calls: Python can not, and it compiles faster."""
    return cast("F", _dated(njit(**_OPTIONS, **_NO_WRAPPER)(function)))


def inner_fast(function: F) -> F:
    """As `inner`, only where NaN and infinity can not occur, as in `compiled_fast`."""
    return cast("F", _dated(njit(**_OPTIONS, **_NO_WRAPPER, fastmath=_FINITE)(function)))


def _package_stamp() -> tuple[float, int]:
    """Time of the newest source file with compiled code in the package, and the size of all."""
    files = [path for path in Path(__file__).parent.rglob("*.py") if b"extraction.compiled" in path.read_bytes()]
    return max(path.stat().st_mtime for path in files), sum(path.stat().st_size for path in files)


def _dated(dispatcher: Any) -> Any:
    """The dispatcher, its cache made invalid by a change in any compiled code of the package.

    numba looks at the function's own file alone and would go on using what it once compiled from another.
    """
    cache_file: Any = getattr(getattr(dispatcher, "_cache", None), "_cache_file", None)
    if cache_file is not None and hasattr(cache_file, "_source_stamp"):
        cache_file._source_stamp = _STAMP
    return dispatcher


_STAMP = _package_stamp()
