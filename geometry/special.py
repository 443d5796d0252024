"""Special functions and quantiles: scipy's, imported here for all, without what scipy would load beside them.

They stand in one compiled module. The package around it looks at every name of numpy once, and numpy loads its masked
arrays, polynomials, Fortran and test tools when their names are looked at: a tenth of a second, a hundred modules that
no command needs. scipy.stats has the same quantiles and takes half a second.
"""

from __future__ import annotations

import sys
from importlib import import_module
from pathlib import Path
from types import ModuleType

import scipy

__all__ = ["chdtrc", "chdtri", "erf", "fdtrc", "iti0k0", "j1", "ndtr", "ndtri", "stdtrit"]


def _compiled() -> ModuleType:
    """The compiled module, its package's place held meanwhile; the package where a release keeps them elsewhere."""
    package = "scipy.special"
    if package in sys.modules:
        return import_module(package)
    held = ModuleType(package)
    held.__path__ = [str(Path(scipy.__file__).with_name("special"))]
    sys.modules[package] = held
    try:
        found = import_module(f"{package}._ufuncs")
    except ImportError:
        found = held
    finally:
        del sys.modules[package]
    return found if all(hasattr(found, name) for name in __all__) else import_module(package)


_found = _compiled()
chdtrc, chdtri, erf, fdtrc, iti0k0, j1, ndtr, ndtri, stdtrit = (getattr(_found, name) for name in __all__)
