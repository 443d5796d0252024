"""Kernels: loops compiled to machine code by numba, kept on disk for later processes.

One decorator serves all packages. It only notes the function: numba, and the kept machine code, are loaded by the first
call, so that a process pays for the kernels it calls and for no others, and for numba only where it calls one.
`geometry.compiler` does that.
"""

from __future__ import annotations

import functools
import threading
from collections.abc import Callable
from typing import Any, TypeVar, cast, overload

F = TypeVar("F", bound=Callable[..., object])


@overload
def kernel(function: F, /) -> F: ...
@overload
def kernel(*, fastmath: bool = False, inline: bool = False, parallel: bool = False) -> Callable[[F], F]: ...
def kernel(
    function: F | None = None, /, *, fastmath: bool = False, inline: bool = False, parallel: bool = False
) -> F | Callable[[F], F]:
    """Compile a function on its first call; the checker goes on seeing the function itself.

    Division by zero gives infinity or NaN, as in numpy, and other threads run meanwhile.

    Parameters
    ----------
    function : callable
        Of numbers, arrays and named tuples of them; calls numpy, `math` and other kernels only. Classes of named tuples
        that it is given are imported by its module, so that their changes are noticed.
    fastmath : bool
        Values are taken for finite: only where NaN and infinity can not occur. Sums keep their order.
    inline : bool
        Written out in its callers, as numba's `inline="always"`; without, the compiler decides by itself.
    parallel : bool
        Loops over `numba.prange` are shared among threads; without, a kernel runs on one.

    Returns
    -------
    callable
        The compiled function, with the same signature; or the decorator where no function was given.

    Examples
    --------
    >>> @kernel(fastmath=True)
    ... def total(values: np.ndarray) -> float:
    ...     found = 0.0
    ...     for value in values:
    ...         found += value
    ...     return found
    >>> total(np.ones(4))
    4.0
    """

    def noted(function: F) -> F:
        met(function)
        return cast("F", _Kernel(function, fastmath=fastmath, inline=inline, parallel=parallel))

    return noted if function is None else noted(function)


class _Kernel:
    """A function that numba compiles, once somebody calls it, compiles a caller, or asks what numba knows of it."""

    def __init__(self, function: Callable[..., object], **options: bool) -> None:
        functools.update_wrapper(self, function)
        self._function = function
        self._options = options
        self._dispatcher: Any = None

    def __call__(self, *values: object, **named: object) -> object:
        return (self._dispatcher or self._loaded())(*values, **named)

    def __getattr__(self, name: str) -> object:
        """Of numba's own: its compiler asks a kernel that another calls for its type, its options, its source."""
        if name.startswith("__"):  # of copying, pickling and printing
            raise AttributeError(name)
        return getattr(self._loaded(), name)

    def _loaded(self) -> Any:
        from geometry import compiler

        with _lock:
            if self._dispatcher is None:
                self._dispatcher = compiler.dispatcher(self._function, **self._options)
        return self._dispatcher


_lock = threading.RLock()
# of modules with kernels, when their first one is met: what they had imported
_names: dict[str, dict[str, object]] = {}


def met(function: Callable[..., object]) -> None:
    """Note what the function's module has imported, when its first kernel is met."""
    if function.__module__ not in _names:
        _names[function.__module__] = dict(function.__globals__)


def imported_by(module: str) -> dict[str, object] | None:
    """What a module had imported above its first kernel; None: it has no kernel."""
    return _names.get(module)
