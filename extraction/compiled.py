"""Compilation of the hot loops: numba's `njit` with its cache, typed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., object])


def compiled(function: F) -> F:
    """The function compiled on its first call, single-threaded, and kept on disk for later processes."""
    return cast("F", njit(cache=True, nogil=True)(function))


def compiled_fast(function: F) -> F:
    """As `compiled`, with sums reordered for the vector unit: only where NaN and infinity can not occur."""
    return cast("F", njit(cache=True, nogil=True, fastmath=True)(function))
