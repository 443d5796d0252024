"""numba, and where it keeps what it compiled: imported by the first call of a kernel (`geometry.compiled`).

What is compiled is kept beside the modules (or where `NUMBA_CACHE_DIR` says, or in the user's cache folder) and used
again for as long as it is fresh: numba itself looks at a kernel's own file alone, and would go on using what it once
compiled of a callee in another. Here a kernel is fresh while its file *and* all that the file takes from others
(kernels, with what they take in turn; named tuples; constants) are as they were.
Where nothing can be written, every process compiles for itself; it goes on and says so once, through `logging`.
"""

from __future__ import annotations

import hashlib
import logging
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from enum import Enum
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from geometry.compiled import imported_by


@contextmanager
def _without(name: str) -> Iterator[None]:
    """Within, a module that nobody has imported yet can not be imported."""
    absent = name not in sys.modules
    if absent:
        sys.modules[name] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        if absent:
            sys.modules.pop(name, None)


# numba would tell coverage of compiled lines, which is 40 modules in every process where it is installed, and has what
# reads a file of its settings, which hardly anybody keeps
with _without("coverage"), nullcontext() if Path(".numba_config.yaml").exists() else _without("yaml"):
    import numba
    from numba.core.caching import FunctionCache, InTreeCacheLocator, UserProvidedCacheLocator, UserWideCacheLocator
    from numba.core.registry import CPUDispatcher
    from numba.core.runtime.nrt import rtsys

# LLVM's leave to take values for finite; none to reorder sums, to divide by reciprocals or to fuse products with sums,
# which gives other last bits on a processor of another width or with other instructions
_FINITE = {"nnan", "ninf", "nsz"}
_PLACES: tuple[Any, ...] = (UserProvidedCacheLocator, InTreeCacheLocator, UserWideCacheLocator)
_settings: Any = numba.config
_NEWEST_TRIED = (0, 68)  # numba; from 0.62 on kernels work as `geometry.linked` compiles them, tests/geometry show it


def dispatcher(function: Callable[..., object], *, fastmath: bool, inline: bool, parallel: bool) -> Any:
    """Of one function, by numba: compiles it for the types it is called with, or loads what is kept."""
    options: dict[str, Any] = {"error_model": "numpy", "nogil": True, "parallel": parallel}
    options["fastmath"] = _FINITE if fastmath else False
    options["inline"] = "always" if inline else "never"
    options["no_cfunc_wrapper"] = True  # nobody calls them from C, and it compiles faster
    made: Any = _dispatching()(function, {}, options | {"nopython": True})
    with _own_cache(function) as can_keep:
        if can_keep:
            made._cache = _KernelCache(function)  # as numba's cache=True does
    return made


def _dispatching() -> Any:
    """The class of dispatchers: numba's own in a release newer than those tried, whose parts may be others."""
    if numba.version_info.short > _NEWEST_TRIED:
        return CPUDispatcher
    from geometry.linked import LinkingDispatcher

    return LinkingDispatcher


class _KernelCache(FunctionCache):
    """numba's cache, which loads what was kept without setting up the compiler: that costs every process 0.4 CPU-s."""

    def __init__(self, function: Callable[..., object]) -> None:
        if numba.version_info.short <= _NEWEST_TRIED:
            from geometry.linked import KeptKernel

            self._impl_class: Any = KeptKernel
        begin: Any = super().__init__
        begin(function)

    def load_overload(self, sig: object, target_context: Any) -> object:
        """The kept code for these types, or None. numba's own sets up the compiler first; compiling does so itself."""
        rtsys.initialize(target_context)  # what allocates arrays in compiled code
        with self._guard_against_spurious_io_errors():
            load: Any = self._load_overload
            return load(sig, target_context)


class KernelCacheLocator:
    """Where numba keeps one kernel, and of what source the kept one must be: the class that numba asks for both."""

    def __init__(self, function: Callable[..., object], file: str, folder: str) -> None:
        self._py_file = file  # numba's remarks name it
        self._folder = Path(folder)
        self._files = f"{Path(file).stem}.{function.__qualname__}-".replace("<", "").replace(">", "")
        self._stamp = _module_stamp(function.__module__)

    @classmethod
    def from_function(cls, function: Callable[..., object], file: str) -> KernelCacheLocator | None:
        """The first of numba's own folders that can be written, or None."""
        folder = _folder(function, file)
        return None if folder is None else cls(function, file, folder)

    def get_cache_path(self) -> str:
        """The folder."""
        return str(self._folder)

    def ensure_cache_path(self) -> None:
        """Called before a kernel is written: makes the folder, and removes what was compiled of other source."""
        self._folder.mkdir(parents=True, exist_ok=True)
        for file in self._folder.glob(f"{self._files}*.nb[ic]"):
            if not file.name.startswith(self._files + self.get_disambiguator()):
                with suppress(OSError):  # another process has it open, or was quicker
                    file.unlink()

    def get_source_stamp(self) -> str:
        """The hash of all that the kernel is made of: compared with the kept one's."""
        return self._stamp

    def get_disambiguator(self) -> str:
        """Part of the files' names, where numba has the line number.

        What was compiled of other source is not even opened: it may speak of classes that are no more.
        """
        return self._stamp[:16]


_folders: dict[tuple[str, str], str | None] = {}  # of a file's folder, and what the user says → where kernels are kept


def _folder(function: Callable[..., object], file: str) -> str | None:
    """The first of numba's own folders that can be written, looked for once for every folder of modules."""
    key = (str(Path(file).parent), str(_settings.CACHE_DIR))
    if key not in _folders:
        places = (place.from_function(function, file) for place in _PLACES)
        _folders[key] = next((place.get_cache_path() for place in places if place is not None), None)
    return _folders[key]


@contextmanager
def _own_cache(function: Callable[..., object]) -> Iterator[bool]:
    """Within, numba asks the locator above; whether that finds a folder. Functions of others are left alone."""
    with _lock:
        before = _settings.CACHE_LOCATOR_CLASSES
        _settings.CACHE_LOCATOR_CLASSES = f"{__name__}.{KernelCacheLocator.__name__}"
        try:
            yield _can_keep(function)
        finally:
            _settings.CACHE_LOCATOR_CLASSES = before


def _can_keep(function: Callable[..., object]) -> bool:
    global _said  # noqa: PLW0603 - once a process
    file = Path(function.__code__.co_filename)
    if not file.exists():  # typed at a prompt
        return False
    if KernelCacheLocator.from_function(function, str(file)) is not None:
        return True
    if not _said:
        _said = True
        logging.getLogger(__name__).warning(
            "compiled code can be kept neither in %s nor in the user's cache folder: every run compiles again, "
            "a minute or two. Set NUMBA_CACHE_DIR to a folder that can be written.",
            file.parent,
        )
    return False


_lock = threading.RLock()
_said = False
_stamps: dict[str, str] = {}  # module name → stamp


def _module_stamp(name: str) -> str:
    """Hash of a module's file and of what it had imported when its first kernel was met, or has in all if it has none.

    Empty for what has no file.
    """
    if name not in _stamps:
        _stamps[name] = ""  # its own names, met on the way, are in its file
        module = sys.modules.get(name)
        file = getattr(module, "__file__", None)
        if module is not None and file:
            digest = hashlib.sha256(_OWN)
            digest.update(Path(file).read_bytes())
            for key, value in sorted((imported_by(name) or vars(module)).items()):
                if not key.startswith("__"):
                    digest.update(f"{key}={_fingerprint(value)};".encode())
            _stamps[name] = digest.hexdigest()
    return _stamps[name]


def _fingerprint(value: object) -> str:
    """What of an imported name can change compiled code: plain data by value, kernels and named tuples by the stamp of
    the module they come from.
    """
    if isinstance(value, (bool, int, float, complex, str, np.generic, np.dtype, Enum)):
        return repr(value)
    if isinstance(value, tuple):
        return f"({','.join(map(_fingerprint, value))})"
    if isinstance(value, np.ndarray):
        return f"{value.dtype}{value.shape}{hashlib.sha256(value.tobytes()).hexdigest()}"
    if isinstance(value, type) and issubclass(value, Enum):
        return repr(list(value))
    if isinstance(value, type) and issubclass(value, tuple):
        return _module_stamp(value.__module__) or repr(value)
    name = str(value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None))
    return "" if imported_by(name) is None else _module_stamp(name)


_OWN = Path(__file__).read_bytes() + Path(__file__).with_name("linked.py").read_bytes()
