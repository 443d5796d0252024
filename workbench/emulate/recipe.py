"""A name for everything that decides a recording's images, so that a resumed recording keeps what is still right."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

DIGITS = 12  # last bits, which hang on the processor, are not part of a recipe
_MOST_PLACES = 15  # of mm and radians: what is left of a zero counts as zero
_NOTHING = 1e-30
_OFF_ROUND = 1.37  # keeps the choice of the last digit away from the numbers that people write


def recipe_name(*things: object) -> str:
    """The name of the recipe that ``things`` are: nested records, models, meshes, arrays and plain values.

    Numbers count to 12 significant digits, those of an array to 12 digits of its largest.

    Raises
    ------
    TypeError
        For a thing whose content is not known, which must not go unnoticed.
    """
    digest = hashlib.sha256()
    for word in _words(things):
        digest.update(word)
        digest.update(b"\0")
    return f"recipe {digest.hexdigest()[:24]}"


def _words(thing: Any) -> Iterator[bytes]:
    """The content in words, in an order that does not hang on how it was put together."""
    import trimesh  # a quarter of a second, and most commands build no mesh

    if isinstance(thing, np.ndarray):
        yield from _array_words(thing)
    elif isinstance(thing, float | np.floating):
        yield f"{float(thing) + 0.0:.{DIGITS}g}".encode()
    elif thing is None or isinstance(thing, bool | int | str | Path | Enum | np.integer | np.bool_):
        yield str(thing).encode()
    elif isinstance(thing, Mapping):
        for key in sorted(thing, key=str):
            yield str(key).encode()
            yield from _words(thing[key])
    elif isinstance(thing, tuple | list):
        yield str(len(thing)).encode()
        for item in thing:
            yield from _words(item)
    elif isinstance(thing, trimesh.Trimesh):
        yield from _words((np.asarray(thing.vertices), np.asarray(thing.faces)))
    else:
        yield type(thing).__name__.encode()
        yield from _words(_content(thing))


def _content(thing: Any) -> Mapping[str, Any]:
    if isinstance(thing, BaseModel):
        return {name: getattr(thing, name) for name in type(thing).model_fields}
    if is_dataclass(thing):
        return {f.name: getattr(thing, f.name) for f in fields(thing)}
    raise TypeError(f"a recipe can not hold {type(thing).__name__}: its content is not known")


def _array_words(array: NDArray[Any]) -> Iterator[bytes]:
    yield str(array.shape).encode()
    if array.dtype.kind != "f":
        yield np.ascontiguousarray(array, dtype="<i8").tobytes()
        return
    largest = float(np.max(np.abs(array), where=np.isfinite(array), initial=0.0))
    places = min(DIGITS - math.ceil(math.log10(max(largest, _NOTHING) * _OFF_ROUND)), _MOST_PLACES)
    power = float(10 ** abs(places))
    whole = np.rint(array * power if places >= 0 else array / power) + 0.0  # no negative zero
    yield np.ascontiguousarray(whole, dtype="<f8").tobytes() + f" {places}".encode()
