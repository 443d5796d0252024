"""Faces of packages whose names are imported when they are first asked for: a command pays for what it uses alone."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from importlib import import_module


def lazy_names(face: str, modules: Mapping[str, tuple[str, ...]]) -> Callable[[str], object]:
    """The ``__getattr__`` of a package's face.

    Parameters
    ----------
    face : str
        The package's ``__name__``.
    modules : mapping of str to tuple of str
        By the module that they are imported from, when first asked for: names of the face. What checks types reads
        the same imports where ``TYPE_CHECKING`` is true.

    Returns
    -------
    callable
        Of a name; AttributeError where the face has none such.
    """
    places = {name: module for module, names in modules.items() for name in names}

    def found(name: str) -> object:
        if name not in places:
            raise AttributeError(f"module {face!r} has no attribute {name!r}")
        return getattr(import_module(places[name]), name)

    return found
