"""A sheet of a technical drawing: lines, circles, outlines, texts and dimensions, written as SVG and as DXF."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from itertools import pairwise
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Layer = Literal["part", "hole", "hidden", "axis", "dim", "string", "text", "frame", "thin"]
Anchor = Literal["start", "middle", "end"]

# stroke [mm], dashes [mm] and colour of every layer, and its colour by number in DXF
LAYERS: dict[Layer, tuple[float, str, str, int]] = {
    "part": (0.5, "", "#111", 7),
    "hole": (0.35, "", "#111", 7),
    "hidden": (0.25, "2 1", "#555", 8),
    "axis": (0.18, "6 1 1 1", "#b00", 1),
    "dim": (0.18, "", "#046", 5),
    "string": (0.3, "", "#070", 3),
    "text": (0.0, "", "#111", 7),
    "frame": (0.7, "", "#111", 7),
    "thin": (0.18, "", "#111", 7),
}
A3_MM, BORDER_MM = (420.0, 297.0), 10.0
ARROW_MM, GAP_MM = 2.2, 1.0  # of dimensions
LINE_MM = 4.2  # from one line of text to the next
LETTER_SHARE = 0.55  # a letter's width over its height, for lengths of text
_ROUND = 4  # decimals of millimetres in files


def xy(right: float, up: float) -> Array:
    """A step on the sheet."""
    return np.array([right, up], dtype=float)


@dataclass(frozen=True, eq=False)
class Stroke:
    """One thing on the sheet: a path through points (N, 2), closed or not; with a radius a circle about the point."""

    layer: Layer
    points: Array
    closed: bool = False
    radius: float = 0.0


@dataclass(frozen=True)
class Words:
    """Text at a point of the sheet; turned by degrees against the clock."""

    x: float
    y: float
    text: str
    height: float = 2.8
    anchor: Anchor = "start"
    turn_deg: float = 0.0
    mono: bool = False


@dataclass(eq=False)
class Paper:
    """A landscape sheet, (0, 0) its lower left corner, y up, [mm]."""

    title: str
    size: tuple[float, float] = A3_MM
    material: str = ""
    shapes: list[Stroke] = field(default_factory=list)
    words: list[Words] = field(default_factory=list)

    def path(self, layer: Layer, points: ArrayLike, *, closed: bool = False) -> None:
        """A line through points (N, 2)."""
        self.shapes.append(Stroke(layer, np.asarray(points, dtype=float), closed))

    def circle(self, layer: Layer, centre: ArrayLike, radius: float) -> None:
        """A circle."""
        self.shapes.append(Stroke(layer, np.asarray(centre, dtype=float)[None], radius=radius))

    def text(
        self, at: ArrayLike, text: str, height: float = 2.8, anchor: Anchor = "start", turn_deg: float = 0.0
    ) -> None:
        """Words at a point."""
        x, y = np.asarray(at, dtype=float)
        self.words.append(Words(float(x), float(y), text, height, anchor, turn_deg))

    def lines(self, at: tuple[float, float], rows: Sequence[str], height: float = 2.8, *, mono: bool = False) -> None:
        """Rows of text, downwards from a point."""
        for k, row in enumerate(rows):
            self.words.append(Words(at[0], at[1] - k * LINE_MM, row, height, mono=mono))

    def arrow(self, tip: Array, along: Array) -> None:
        """The head of a dimension's arrow at ``tip``, pointing along the unit vector."""
        across = np.array([-along[1], along[0]])
        back = tip - ARROW_MM * along
        self.path("dim", [tip, back + 0.35 * across, back - 0.35 * across], closed=True)

    def dimension(self, a: ArrayLike, b: ArrayLike, offset: float, text: str, axis: int | None = None) -> None:
        """The distance from a to b, its line ``offset`` to the left of the way; along one axis where one is named."""
        a, b = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
        way = b - a if axis is None else np.eye(2)[axis] * (b - a)
        along = way / np.linalg.norm(way)
        left = np.array([-along[1], along[0]])
        level = max(float(a @ left), float(b @ left)) if offset > 0 else min(float(a @ left), float(b @ left))
        level += offset
        ends = [p + (level - float(p @ left)) * left for p in (a, b)]
        for p, end in zip((a, b), ends, strict=True):
            beyond = np.sign(level - float(p @ left)) * left
            self.path("dim", [p + GAP_MM * beyond, end + 1.5 * beyond])
        length = float(np.linalg.norm(ends[1] - ends[0]))
        width = 2.8 * LETTER_SHARE * len(text)
        outside = length < 2.5 * ARROW_MM
        if outside:
            self.path("dim", [ends[0] - 3 * ARROW_MM * along, ends[1] + 3 * ARROW_MM * along])
        else:
            self.path("dim", ends)
        self.arrow(ends[0], along if outside else -along)
        self.arrow(ends[1], -along if outside else along)
        turn = float(np.rad2deg(np.arctan2(along[1], along[0])))
        turn = turn - 180 if turn > 90.1 else turn + 180 if turn <= -89.9 else turn
        up = np.array([-np.sin(np.deg2rad(turn)), np.cos(np.deg2rad(turn))])
        middle = (ends[0] + ends[1]) / 2
        if width > length - 2 * ARROW_MM:
            right = np.array([np.cos(np.deg2rad(turn)), np.sin(np.deg2rad(turn))])
            far = ends[1] if float((ends[1] - ends[0]) @ right) > 0 else ends[0]
            self.text(far + right * (3 * ARROW_MM + 1) - up * 1.0, text, turn_deg=turn)
            return
        self.text(middle + up * 0.8, text, anchor="middle", turn_deg=turn)

    def leader(self, tip: ArrayLike, knee: ArrayLike, text: str) -> None:
        """A note that points at something."""
        tip, knee = np.asarray(tip, dtype=float), np.asarray(knee, dtype=float)
        right = 1.0 if knee[0] >= tip[0] else -1.0
        self.path("dim", [tip, knee, knee + xy(4 * right, 0)])
        self.arrow(tip, (tip - knee) / np.linalg.norm(tip - knee))
        anchor: Anchor = "start" if right > 0 else "end"
        self.text(knee + np.array([5 * right, -1.0]), text, anchor=anchor)

    def cross(self, centre: ArrayLike, reach: float) -> None:
        """The axes of a hole."""
        x, y = np.asarray(centre, dtype=float)
        self.path("axis", [[x - reach, y], [x + reach, y]])
        self.path("axis", [[x, y - reach], [x, y + reach]])

    def title_block(self, rows: Sequence[tuple[str, str]]) -> None:
        """The sheet's frame, and at its lower right what the drawing is."""
        w, h = self.size
        b = BORDER_MM
        self.path("frame", [[b, b], [w - b, b], [w - b, h - b], [b, h - b]], closed=True)
        left, top = w - b - 120, b + 7 * (len(rows) + 1)
        self.path("frame", [[left, b], [w - b, b], [w - b, top], [left, top]], closed=True)
        self.text((left + 2, top - 5.2), self.title, 4.2)
        for k, (what, value) in enumerate(rows):
            y = top - 7 * (k + 1)
            self.path("thin", [[left, y], [w - b, y]])
            self.text((left + 2, y - 4.8), what, 2.5)
            self.text((left + 30, y - 4.8), value, 2.8)


def svg_text(paper: Paper) -> str:
    """The sheet as SVG, one unit a millimetre of the paper."""
    w, h = paper.size
    styles = [
        f".{name} {{ fill: none; stroke: {colour}; stroke-width: {width}"
        + (f"; stroke-dasharray: {dashes}" if dashes else "")
        + " }"
        for name, (width, dashes, colour, _) in LAYERS.items()
        if name != "text"
    ]
    out = [
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{w:g}mm" height="{h:g}mm" viewBox="0 0 {w:g} {h:g}">',
        f"<title>{escape(paper.title)}</title>",
        "<style>" + " ".join(styles) + " text { font-family: 'DejaVu Sans', sans-serif; fill: #111; white-space: pre }"
        " .mono { font-family: 'DejaVu Sans Mono', monospace }</style>",
        '<rect width="100%" height="100%" fill="#fff"/>',
    ]
    for s in paper.shapes:
        points = np.round(s.points * [1, -1] + xy(0, h), _ROUND) + 0.0
        if s.radius:
            (x, y), r = points[0], round(s.radius, _ROUND)
            out.append(f'<circle class="{s.layer}" cx="{x:g}" cy="{y:g}" r="{r:g}"/>')
        else:
            path = " ".join(f"{x:.10g},{y:.10g}" for x, y in points)
            out.append(f'<{"polygon" if s.closed else "polyline"} class="{s.layer}" points="{path}"/>')
    for t in paper.words:
        x, y = round(t.x, _ROUND), round(h - t.y, _ROUND)
        turn = f' transform="rotate({-t.turn_deg:g} {x:g} {y:g})"' if t.turn_deg else ""
        kind = ' class="mono"' if t.mono else ""
        out.append(
            f'<text{kind} x="{x:g}" y="{y:g}" font-size="{t.height:g}" text-anchor="{t.anchor}"{turn}>'
            f"{escape(t.text)}</text>"
        )
    return "\n".join([*out, "</svg>\n"])


def dxf_text(paper: Paper) -> str:
    """The sheet as DXF of release 12, in millimetres of the paper; every CAD program reads it."""
    groups: list[tuple[int, object]] = [(0, "SECTION"), (2, "HEADER"), (9, "$ACADVER"), (1, "AC1009")]
    groups += [(9, "$INSUNITS"), (70, 4), (0, "ENDSEC"), (0, "SECTION"), (2, "TABLES")]
    groups += [(0, "TABLE"), (2, "LAYER"), (70, len(LAYERS))]
    for name, (_, _, _, colour) in LAYERS.items():
        groups += [(0, "LAYER"), (2, name.upper()), (70, 0), (62, colour), (6, "CONTINUOUS")]
    groups += [(0, "ENDTAB"), (0, "ENDSEC"), (0, "SECTION"), (2, "ENTITIES")]
    for s in paper.shapes:
        groups += _entity(s)
    for t in paper.words:
        groups += [(0, "TEXT"), (8, "TEXT"), (10, t.x), (20, t.y), (30, 0.0), (40, t.height)]
        groups += [(1, _plain(t.text)), (50, t.turn_deg)]
        if t.anchor != "start":
            groups += [(72, 1 if t.anchor == "middle" else 2), (11, t.x), (21, t.y), (31, 0.0)]
    groups += [(0, "ENDSEC"), (0, "EOF")]
    return "".join(f"{code:>3}\n{_value(value)}\n" for code, value in groups)


def _entity(s: Stroke) -> list[tuple[int, object]]:
    layer = s.layer.upper()
    if s.radius:
        x, y = s.points[0].tolist()
        return [(0, "CIRCLE"), (8, layer), (10, x), (20, y), (30, 0.0), (40, s.radius)]
    points = [*s.points, s.points[0]] if s.closed else list(s.points)
    out: list[tuple[int, object]] = []
    for a, b in pairwise(points):
        out += [(0, "LINE"), (8, layer), (10, float(a[0])), (20, float(a[1])), (30, 0.0)]
        out += [(11, float(b[0])), (21, float(b[1])), (31, 0.0)]
    return out


def _value(value: object) -> str:
    return f"{round(value, _ROUND) + 0.0:.4f}" if isinstance(value, float) else str(value)


def _plain(text: str) -> str:
    """Release 12 knows ASCII and %%c, %%d, %%p for ⌀, ° and ±."""
    for sign, code in (
        ("⌀", "%%c"),
        ("°", "%%d"),
        ("±", "%%p"),
        ("×", "x"),
        ("–", "-"),
        ("′", "'"),
        ("≥", ">="),
        ("≤", "<="),
    ):
        text = text.replace(sign, code)
    return text.encode("ascii", "replace").decode()
