"""target.toml (docs/formats.md): strings as in jig.toml, or a ball, balls, a plane, an edge, a wedge."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from geometry import InputError, Surface, Target, did_you_mean, toml_value
from jig_cad import Balls, Edge, Jig, Plane, Sphere, Wedge, jig_from_table, jig_text
from jig_cad.files import KINDS, table_model, without_names
from workbench.files.strict import FileSection, NotNegative, Positive, Vector3, validate
from workbench.files.toml_text import TomlSource, read_toml


class SphereFile(FileSection):
    """kind = "sphere"; without a diameter it is estimated."""

    kind: Literal["sphere"]
    diameter_mm: Positive | None = None
    diameter_sigma_mm: NotNegative = 0.0


class BallSection(FileSection):
    """[[ball]]: one of several, its centre in a frame of their own."""

    diameter_mm: Positive
    centre_mm: Vector3


class BallsFile(FileSection):
    """kind = "balls"."""

    kind: Literal["balls"]
    ball: tuple[BallSection, ...] = Field(min_length=2)


class PlaneFile(FileSection):
    """kind = "plane"; width and height are of the plate, for planning and pictures."""

    kind: Literal["plane"]
    width_mm: Positive | None = None
    height_mm: Positive | None = None


class EdgeFile(FileSection):
    """kind = "edge"."""

    kind: Literal["edge"]


class WedgeFile(FileSection):
    """kind = "wedge"; without an angle it is estimated."""

    kind: Literal["wedge"]
    angle_deg: Positive | None = None


def read_target(path: Path) -> Target:
    """The target of a target.toml or jig.toml.

    Parameters
    ----------
    path
        The file; without ``kind`` it is a jig.toml.

    Returns
    -------
    Target
        A Jig, Sphere, Balls, Plane, Edge or Wedge.

    Raises
    ------
    InputError
        Naming file, line and key.

    """
    source = read_toml(path)
    kind = source.data.get("kind", "strings")
    if kind not in KINDS:
        near = did_you_mean(str(kind), KINDS) or f" (known: {', '.join(KINDS)})"
        raise InputError(f'{source.where(("kind",))}: kind = "{str(kind)[:40]}" is no target{near}')
    try:
        if kind in _KINDS:
            return _KINDS[kind].made(source)
        validate(table_model(source.data, source.where(("kind",))), source, without_names(source.data))
        return jig_from_table(source.data, str(source.path))
    except InputError as error:
        raise error if str(error).startswith(str(path)) else InputError(f"{path}: {error}") from None


def _sphere(source: TomlSource) -> Sphere:
    ball = validate(SphereFile, source)
    if ball.diameter_mm is None:
        if ball.diameter_sigma_mm:
            raise InputError(f"{source.where(('diameter_sigma_mm',))}: stands without diameter_mm")
        return Sphere(diameter_sigma_mm=np.inf, name=ball.name)
    return Sphere(ball.diameter_mm, ball.diameter_sigma_mm, ball.name)


def _sphere_text(ball: Sphere) -> str:
    keys = {"diameter_mm": ball.diameter_mm, "diameter_sigma_mm": ball.diameter_sigma_mm or None}
    return _text("sphere", ball.name, keys if ball.known else {})


def _balls(source: TomlSource) -> Balls:
    balls = validate(BallsFile, source)
    names = [b.name or f"ball {k + 1}" for k, b in enumerate(balls.ball)]
    twice = next((n for n in names if names.count(n) > 1), None)
    if twice is not None:
        raise InputError(f'{source.where(("ball",))}: two balls are called "{twice}"')
    return Balls.of({n: (b.diameter_mm, b.centre_mm) for n, b in zip(names, balls.ball, strict=True)}, balls.name)


def _balls_text(target: Balls) -> str:
    balls = zip(target.names, target.diameters_mm.tolist(), target.centres_mm.tolist(), strict=True)
    each = [f"[[ball]]\nname = {toml_value(n)}\ndiameter_mm = {d!r}\ncentre_mm = {c}\n" for n, d, c in balls]
    return _text("balls", target.name, {}) + "".join(each)


def _plane(source: TomlSource) -> Plane:
    plane = validate(PlaneFile, source)
    return Plane(plane.width_mm, plane.height_mm, plane.name)


def _plane_text(plane: Plane) -> str:
    return _text("plane", plane.name, {"width_mm": plane.width_mm, "height_mm": plane.height_mm})


def _edge(source: TomlSource) -> Edge:
    return Edge(validate(EdgeFile, source).name)


def _edge_text(edge: Edge) -> str:
    return _text("edge", edge.name, {})


def _wedge(source: TomlSource) -> Wedge:
    wedge = validate(WedgeFile, source)
    known = wedge.angle_deg is not None
    return Wedge(angle_deg=wedge.angle_deg or 90.0, angle_known=known, name=wedge.name)


def _wedge_text(wedge: Wedge) -> str:
    return _text("wedge", wedge.name, {"angle_deg": wedge.angle_deg if wedge.angle_known else None})


class _Kind(NamedTuple):
    """How a target of one kind is made of its file, and written."""

    made: Callable[[TomlSource], Target]
    text: Callable[[Any], str]


_KINDS: dict[str, _Kind] = {
    "sphere": _Kind(_sphere, _sphere_text),
    "balls": _Kind(_balls, _balls_text),
    "plane": _Kind(_plane, _plane_text),
    "edge": _Kind(_edge, _edge_text),
    "wedge": _Kind(_wedge, _wedge_text),
}


def target_text(target: Target) -> str:
    """A target as the text of its file; read back it is the same."""
    if isinstance(target, Jig):
        return 'kind = "strings"\n' + jig_text(target)
    if isinstance(target, Surface) and target.kind in _KINDS:
        return _KINDS[target.kind].text(target)
    raise InputError(f"a target of class {type(target).__name__} has no file")


def _text(kind: str, name: str, keys: dict[str, float | None]) -> str:
    lines = [f"name = {toml_value(name)}"] if name else []
    lines += [f"kind = {toml_value(kind)}", *(f"{k} = {float(v)!r}" for k, v in keys.items() if v is not None)]
    return "\n".join(lines) + "\n"
