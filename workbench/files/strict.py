"""Strict file models: unknown keys, wrong kinds and numbers that are not finite become one sentence with the line."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from typing import Annotated, Any, TypeVar, get_args

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from geometry import LONGEST_WORD, InputError
from workbench.files.toml_text import Location, TomlSource

LARGEST = 1e9  # of any quantity in any unit of a file
LEAST = 1e-12  # of a size or a standard deviation that is not nothing: its inverse square must stay a number
FARTHEST_MM = 1e5  # of anything in a cell


def _not_next_to_nothing(value: float) -> float:
    if 0 < value < LEAST:
        raise ValueError(f"is {value:g}, too small to be meant: 0 is nothing, the least size {LEAST:g}")
    return value


Real = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-LARGEST, le=LARGEST)]
Coordinate = Annotated[float, Field(strict=True, allow_inf_nan=False, ge=-FARTHEST_MM, le=FARTHEST_MM)]
Positive = Annotated[
    float, Field(strict=True, allow_inf_nan=False, gt=0, le=LARGEST), AfterValidator(_not_next_to_nothing)
]
NotNegative = Annotated[
    float, Field(strict=True, allow_inf_nan=False, ge=0, le=LARGEST), AfterValidator(_not_next_to_nothing)
]
Whole = Annotated[int, Field(strict=True)]
Text = Annotated[str, Field(strict=True)]
YesNo = Annotated[bool, Field(strict=True)]
Vector3 = tuple[Coordinate, Coordinate, Coordinate]
Matrix3 = tuple[Vector3, Vector3, Vector3]
Row4 = tuple[Coordinate, Coordinate, Coordinate, Coordinate]
Matrix4 = tuple[Row4, Row4, Row4, Row4]

Names = Mapping[Location, Iterable[str]]


class FileSection(BaseModel):
    """One table of a file; ``name`` is welcome in every one, other keys that are not declared are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)

    name: Text = ""


M = TypeVar("M", bound=BaseModel)


def validate(
    model: type[M], source: TomlSource, data: Mapping[str, object] | None = None, also: Names | None = None
) -> M:
    """``data`` (default: the whole file) as ``model``; InputError names file, line and key and says what is right.

    also: further key names that are right at a location, for suggestions where the file has a second reader.
    """
    try:
        return model.model_validate(source.data if data is None else data)
    except ValidationError as error:
        raise InputError(sentence(error, model, source, also or {})) from None


# what pydantic adds to a place where several kinds of value are right
_BRANCH = re.compile(r"constrained-\w+|literal\[.*\]|function-\w+\[.*\]")


def sentence(error: ValidationError, model: type[BaseModel], source: TomlSource, also: Names) -> str:
    """The first problem of ``error`` as one sentence; unknown keys come first, they cause the others."""
    problems = error.errors(include_url=False, include_context=True)
    first = min(problems, key=lambda p: p["type"] != "extra_forbidden")
    location: Location = tuple(p for p in first["loc"] if not (isinstance(p, str) and _BRANCH.fullmatch(p)))
    where = source.where(location)
    if first["type"] == "extra_forbidden":
        known = [*_known_keys(model, location[:-1]), *also.get(location[:-1], ())]
        return f"{where}: unknown key {_spell(location)}{suggestion(str(location[-1]), known)}"
    if first["type"] == "missing" and not isinstance(location[-1], int):
        return f"{where}: the key {_spell(location)} is missing"
    return f"{where}: {_spell(location)} {_wish(first)}"


def suggestion(word: str, known: Iterable[str]) -> str:
    """``, did you mean …`` where a known word is near, else the known words."""
    names = list(dict.fromkeys(known))
    if len(word) > LONGEST_WORD:
        return ""
    longer = [n for n in names if n.startswith(f"{word}_")]  # the unit left out is the commonest slip
    near = longer if len(longer) == 1 else difflib.get_close_matches(word, names, n=1, cutoff=0.55)
    near = near or difflib.get_close_matches(word.casefold(), [n for n in names if n.islower()], n=1, cutoff=0.55)
    if near:
        return f', did you mean "{near[0]}"?'
    shown = ", ".join(names[:24])
    return f" (known here: {shown})" if names else ""


def _number_wanted(problem: Any) -> str:
    """How many values are right, where one of a list of fixed length is missing."""
    given = problem["input"]
    return f": {len(given)}" if isinstance(given, list | tuple) else ""


def _wish(problem: Any) -> str:
    kind, value = problem["type"], problem["input"]
    if kind in ("too_long", "too_short"):
        context = problem["ctx"]
        right = f"at most {context['max_length']}" if kind == "too_long" else f"at least {context['min_length']}"
        return f"has {context['actual_length']} values, {right} are right"
    if kind == "missing":
        return f"has the wrong number of values{_number_wanted(problem)}"
    if kind == "finite_number":
        return f"must be a finite number, not {value}"
    if kind == "value_error":
        return str(problem["ctx"]["error"])
    message = re.sub(r"^Input should be", "must be", problem["msg"])
    message = message.replace("a valid number", "a number").replace("a valid integer", "a whole number")
    message = message.replace("a valid string", "text in quotes").replace("a valid tuple", "a list")
    message = re.sub(r"a valid dictionary.*|an object.*|a valid dict.*", "a table", message)
    return f"{message}, not {_shown(value)}"


def _shown(value: object) -> str:
    """Short, whatever it is: Python does not print whole numbers of thousands of digits."""
    if isinstance(value, dict | list):
        return "a table" if isinstance(value, dict) else "a list"
    if isinstance(value, int) and abs(value) > 10**30:
        return "a whole number of more than 30 digits"
    return repr(value)[:60]


def _spell(location: Location) -> str:
    """``[camera.pose] rotation`` for ("camera", "pose", "rotation"); list positions count from 1."""
    names = [p if len(p) <= LONGEST_WORD else f"{p[:40]}…" for p in location if isinstance(p, str)]
    text = f"[{'.'.join(names[:-1])}] {names[-1]}" if len(names) > 1 else names[0] if names else "the file"
    numbers = [p for p in location if isinstance(p, int)]
    return text + (f" (number {numbers[0] + 1})" if numbers and isinstance(location[-1], str) else "")


def _known_keys(model: type[BaseModel], location: Location) -> list[str]:
    """Names of the keys that ``model`` knows at ``location``."""
    here: Any = model
    for part in location:
        if isinstance(part, int):  # a position in a list of tables: its model is found already
            continue
        if isinstance(here, type) and issubclass(here, BaseModel):
            field = here.model_fields.get(str(part))
            here = field.annotation if field else None
        here = _section_of(here)
    if isinstance(here, type) and issubclass(here, BaseModel):
        return list(here.model_fields)
    return []


def _section_of(annotation: Any) -> Any:
    """The model class inside ``tuple[FileSection, ...]``, ``FileSection | None``, ``dict[str, FileSection]``."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for inner in get_args(annotation):
        found = _section_of(inner)
        if found is not None:
            return found
    return None
