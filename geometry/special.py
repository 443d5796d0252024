"""Special functions and quantiles: scipy's, imported here for all, without what scipy would load beside them.

scipy looks at every name of numpy once, and numpy loads its Fortran tool and its test tools when their names are looked
at: a hundred modules, which no command needs. scipy.stats has the same quantiles and takes half a second.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np


@contextmanager
def _unloaded(*names: str) -> Iterator[None]:
    """Within, tools of numpy that nobody has loaded are None."""
    absent = [name for name in names if name not in vars(np)]
    for name in absent:
        setattr(np, name, None)
    try:
        yield
    finally:
        for name in absent:
            if getattr(np, name) is None:
                delattr(np, name)


with _unloaded("f2py", "testing"):
    from scipy.special import chdtrc, chdtri, erf, fdtrc, iti0k0, j1, ndtr, ndtri, stdtrit

__all__ = ["chdtrc", "chdtri", "erf", "fdtrc", "iti0k0", "j1", "ndtr", "ndtri", "stdtrit"]
