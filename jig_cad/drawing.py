"""The jig's drawing with dimensions, as SVG at 1:1: plan of the plates, front view of the strings, table of holes."""

from __future__ import annotations

from html import escape

import numpy as np
from numpy.typing import NDArray

from jig_cad.jig import Jig
from jig_cad.pillar import UPRIGHT, nominal_anchors
from jig_cad.solids import PillarDesign

Array = NDArray[np.float64]

_MARGIN = 18.0
_GAP = 30.0  # between the views
_LINE = 4.6  # of text, mm
_STYLE = """
  text { font: 3.2px sans-serif; fill: #111 } .small { font-size: 2.6px } .title { font-size: 5px; font-weight: bold }
  .part { fill: #eef1f4; stroke: #111; stroke-width: .35 } .hole { fill: #fff; stroke: #b00; stroke-width: .2 }
  .axis { stroke: #b00; stroke-width: .12; stroke-dasharray: 3 .8 .6 .8 } .dim { stroke: #046; stroke-width: .18 }
  .string { stroke: #070 } .back { stroke-dasharray: 2 1 } .num { fill: #046 }
"""


def drawing_svg(jig: Jig, design: PillarDesign | None = None) -> str:
    """The drawing of the jig as it stands (nominal, sampled or measured anchors) as SVG text, one unit a millimetre.

    InputError where the jig is no pillar.
    """
    jig.require_pillar("the drawing")
    design = design or PillarDesign()
    outline = np.asarray(design.plate(jig).exterior.coords)
    low, high = outline.min(0), outline.max(0)
    width, depth = high - low
    tall = jig.height_mm + 2 * design.plate_thickness_mm
    plan = _View(_MARGIN - low[0], _MARGIN + 2 * _LINE + high[1])
    front_x = _MARGIN + width + _GAP - low[0]
    front = _View(front_x, _MARGIN + 2 * _LINE + jig.height_mm + design.plate_thickness_mm)
    table_y = _MARGIN + 2 * _LINE + max(depth, tall) + _GAP
    body = [
        _text(_MARGIN, _MARGIN, f"String jig {jig.name}".strip(), "title"),
        *_plan(jig, design, plan, outline),
        *_front(jig, design, front, low[0], high[0]),
        *_table(jig, design, table_y),
    ]
    size = (2 * _MARGIN + 2 * width + _GAP, table_y + (len(jig.used_anchors) + 5) * _LINE + _MARGIN)
    head = f'<svg xmlns="http://www.w3.org/2000/svg" width="{size[0]:.1f}mm" height="{size[1]:.1f}mm"'
    view = f' viewBox="0 0 {size[0]:.1f} {size[1]:.1f}">'
    paper = '<rect width="100%" height="100%" fill="#fff"/>'
    return "\n".join([head + view, f"<style>{_STYLE}</style>", paper, *body, "</svg>\n"])


class _View:
    """A view's origin on the paper: right and up in the view [mm] to the paper's x and y."""

    def __init__(self, x: float, y: float) -> None:
        self.x, self.y = x, y

    def at(self, right: float, up: float) -> tuple[float, float]:
        return self.x + right, self.y - up


def _plan(jig: Jig, design: PillarDesign, view: _View, outline: Array) -> list[str]:
    """Seen from above: y to the right, z up."""
    points = " ".join(f"{x:.3f},{y:.3f}" for x, y in (view.at(*p) for p in outline))
    out = [f'<polygon class="part" points="{points}"/>']
    for y, z in design.posts_yz(jig):
        out += _circle(view.at(y, z), design.post_diameter_mm / 2, "part")
        out += [_text(*view.at(y - 5, z - design.post_diameter_mm / 2 - 3.5), "post", "small")]
    pillar = jig.require_pillar("the drawing")
    bottom = nominal_anchors(pillar.side_mm, pillar.height_mm)[::2, 1:]
    for role, (y, z) in zip(UPRIGHT, bottom, strict=True):
        out += _circle(view.at(y, z), design.hole_mm(jig) / 2, "hole")
        x, up = view.at(y, z)
        out += [_line((x - 4, up), (x + 4, up), "axis"), _line((x, up - 4), (x, up + 4), "axis")]
        out += [_text(x + 2, up - 2, pillar.strings.get(role, role), "")]
    half, deep = jig.side_mm / 2, np.sqrt(3) / 2 * jig.side_mm
    low = float(outline[:, 1].min())
    out += _dimension(view.at(-half, low - 6), view.at(half, low - 6), f"{jig.side_mm:g}")
    side = float(outline[:, 0].min()) - 5
    out += _dimension(view.at(side, 0), view.at(side, deep), f"{deep:.3f}")
    return [*out, _text(*view.at(-half, low - 14), "plan, from above: y right, z up; front below", "small")]


def _front(jig: Jig, design: PillarDesign, view: _View, low: float, high: float) -> list[str]:
    """Seen from the front, along +z: y to the right, x up; the farther strings are dashed."""
    t, h = design.plate_thickness_mm, jig.height_mm
    out = []
    for y, _ in design.posts_yz(jig):
        out += [_rect(view.at(y - design.post_diameter_mm / 2, h), design.post_diameter_mm, h)]
    out += [_rect(view.at(low, 0), high - low, t), _rect(view.at(low, h + t), high - low, t)]
    for label, start, end in zip(jig.strings, jig.starts, jig.ends, strict=True):
        far = " back" if min(start[2], end[2]) > jig.side_mm / 2 else ""
        a, b = view.at(start[1], start[0]), view.at(end[1], end[0])
        out += [_line(a, b, "string" + far, f"stroke-width:{max(jig.string_diameter_mm, 0.25):g}")]
        at = start + (end - start) * 0.62
        out += [_text(*view.at(at[1] + 1.2, at[0]), label, "")]
    out += _dimension(view.at(high + 6, 0), view.at(high + 6, h), f"{h:g}")
    out += _dimension(view.at(low - 9, h), view.at(low - 9, h + t), f"{t:g}")
    return [*out, _text(*view.at(low, -t - 6), "front: y right, x up; B, C stand behind", "small")]


def _table(jig: Jig, design: PillarDesign, y: float) -> list[str]:
    """Hole positions, and what the maker must keep to."""
    rows = [f"{'hole':<6}{'x / mm':>12}{'y / mm':>12}{'z / mm':>12}   strings"]
    for k in jig.used_anchors:
        p = jig.anchors_mm[k]
        at_hole = (jig.start_index == k) | (jig.end_index == k)
        ends = ", ".join(jig.strings[s] for s in np.flatnonzero(at_hole))
        rows += [f"{jig.anchors[k]:<6}{p[0]:12.3f}{p[1]:12.3f}{p[2]:12.3f}   {ends}"]
    kind = "as measured" if jig.measured else "where the string leaves the plate's inner face"
    half = jig.tolerance_mm / 2
    notes = [
        f"holes ⌀ {design.hole_mm(jig):g}, through, square to the plate; string ⌀ {jig.string_diameter_mm:g}; "
        f"posts ⌀ {design.post_diameter_mm:g}",
        f"hole centres ({kind}) within ± {half:g} mm in y and z; b: bottom plate, t: top plate; all dimensions in mm",
    ]
    mono = [
        _text(_MARGIN, y + i * _LINE, row, "", "font-family:monospace;white-space:pre") for i, row in enumerate(rows)
    ]
    return mono + [_text(_MARGIN, y + (len(rows) + 0.5 + i) * _LINE, note, "") for i, note in enumerate(notes)]


def _text(x: float, y: float, text: str, kind: str, style: str = "") -> str:
    return f'<text x="{x:.3f}" y="{y:.3f}" class="{kind}" style="{style}">{escape(text)}</text>'


def _line(a: tuple[float, float], b: tuple[float, float], kind: str, style: str = "") -> str:
    ends = f'x1="{a[0]:.3f}" y1="{a[1]:.3f}" x2="{b[0]:.3f}" y2="{b[1]:.3f}"'
    return f'<line {ends} class="{kind}" style="{style}"/>'


def _rect(top_left: tuple[float, float], width: float, height: float) -> str:
    x, y = top_left
    return f'<rect x="{x:.3f}" y="{y:.3f}" width="{width:.3f}" height="{height:.3f}" class="part"/>'


def _circle(centre: tuple[float, float], radius: float, kind: str) -> list[str]:
    return [f'<circle cx="{centre[0]:.3f}" cy="{centre[1]:.3f}" r="{radius:.3f}" class="{kind}"/>']


def _dimension(a: tuple[float, float], b: tuple[float, float], text: str) -> list[str]:
    """A dimension line between two points of the paper with ticks and its number."""
    (ax, ay), (bx, by) = a, b
    along = np.array([bx - ax, by - ay]) / np.hypot(bx - ax, by - ay)
    tick = 1.2 * np.array([-along[1], along[0]])
    ends = [_line((x - tick[0], y - tick[1]), (x + tick[0], y + tick[1]), "dim") for x, y in (a, b)]
    beside = np.array([(ax + bx) / 2, (ay + by) / 2]) + ([-1.5, -1.2] if abs(along[1]) < 0.5 else [1.2, 1.0])
    return [_line(a, b, "dim"), *ends, _text(float(beside[0]), float(beside[1]), text, "num")]
