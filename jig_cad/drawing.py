"""The drawing from which a workshop makes a string jig: plates, posts, holes, dimensions, tolerances, on one sheet."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from jig_cad.jig import Jig
from jig_cad.paper import A3_MM, BORDER_MM, LINE_MM, Paper, dxf_text, svg_text, xy
from jig_cad.pillar import UPRIGHT
from jig_cad.solids import PillarDesign

Array = NDArray[np.float64]

SCALES = (5.0, 2.0, 1.0, 0.5, 0.2, 0.1)  # paper over part
POST_FIT_MM, POST_SCREW, SPIGOT_MM = 8.0, "M5", 8.0  # a post's spigot, its screw, and how deep the spigot goes
LAND_MM, COUNTERBORE_MM = 2.0, 3.0  # plate left round a string's hole, and the bore from outside that leaves it
HEIGHT_TOLERANCE_MM, EQUAL_MM = 0.02, 0.01  # of the posts' length, and from post to post
DETAIL = 5.0  # scale of the hole's section


def drawing_svg(jig: Jig, design: PillarDesign | None = None) -> str:
    """The drawing of the jig as it stands (nominal, sampled or measured anchors), an A3 sheet.

    Parameters
    ----------
    jig : Jig
        A pillar.
    design : PillarDesign, optional
        None: the defaults.

    Returns
    -------
    str
        SVG, in mm.

    Raises
    ------
    InputError
        Where the jig is no pillar.
    """
    return svg_text(pillar_drawing(jig, design))


def drawing_dxf(jig: Jig, design: PillarDesign | None = None) -> str:
    """The drawing of the jig as it stands, an A3 sheet.

    Parameters
    ----------
    jig : Jig
        A pillar.
    design : PillarDesign, optional
        None: the defaults.

    Returns
    -------
    str
        DXF, in mm.

    Raises
    ------
    InputError
        Where the jig is no pillar.
    """
    return dxf_text(pillar_drawing(jig, design))


def pillar_drawing(jig: Jig, design: PillarDesign | None = None) -> Paper:
    """The sheet: plate, assembly from the front, post, hole, tables and notes."""
    jig.require_pillar("the drawing")
    design = design or PillarDesign()
    paper = Paper(f"String jig {jig.name}".strip())
    outline = np.asarray(design.plate(jig).exterior.coords)
    low, high = outline.min(axis=0), outline.max(axis=0)
    tall = jig.height_mm + 2 * design.plate_thickness_mm
    room = np.array([(A3_MM[0] - 2 * BORDER_MM - 115) / 2, 145.0])
    scale = fitting_scale(np.array([high[0] - low[0], max(high[1] - low[1], tall)]), room)
    top = A3_MM[1] - BORDER_MM - 14
    plan = _View(BORDER_MM + 38 - scale * low[0], top - 12 - scale * high[1], scale)
    front_left = BORDER_MM + 38 + scale * (high[0] - low[0]) + 52
    front = _View(front_left - scale * low[0], top - 12 - scale * (jig.height_mm + design.plate_thickness_mm), scale)
    _plate(paper, jig, design, plan, outline)
    _assembly(paper, jig, design, front, low[0], high[0])
    _hole(paper, jig, design, (A3_MM[0] - BORDER_MM - 85, top - 30))
    _post(paper, jig, design, (A3_MM[0] - BORDER_MM - 85, top - 85), scale)
    _tables(paper, jig, (BORDER_MM + 4, 78.0))
    _notes(paper, jig, design, (BORDER_MM + 132, 78.0))
    rows = [
        ("scale", scale_text(scale) + f", hole {scale_text(DETAIL)}; all dimensions in mm"),
        ("general tolerances", "ISO 2768-mK where none is given"),
        ("material", "plates: aluminium, matt black; posts: steel or aluminium, matt"),
        ("frame {J}", "origin: hole A, bottom plate's inner face; x up, y right, z back"),
    ]
    paper.title_block(rows)
    return paper


def fitting_scale(size: Array, room: Array) -> float:
    """The largest usual scale at which a part of that size (2,) has room (2,) on the paper."""
    fits = [s for s in SCALES if np.all(s * size <= room)]
    return fits[0] if fits else SCALES[-1]


def scale_text(scale: float) -> str:
    """``1 : 2``."""
    return f"{scale:g} : 1" if scale >= 1 else f"1 : {1 / scale:g}"


class _View:
    """A view's origin on the paper and its scale: right and up in the view [mm] to the paper."""

    def __init__(self, x: float, y: float, scale: float) -> None:
        self.origin, self.scale = np.array([x, y]), scale

    def at(self, *points: object) -> Array:
        return np.asarray(self.origin + self.scale * np.asarray(points, dtype=float))


def _plate(paper: Paper, jig: Jig, design: PillarDesign, view: _View, outline: Array) -> None:
    """Seen from above: y to the right, z up."""
    low, high = outline.min(axis=0), outline.max(axis=0)
    paper.text(view.at((low[0], high[1]))[0] + xy(0, 16), "Plate, 2 off, from above (y right, z up)", 3.5)
    paper.path("part", view.at(*outline), closed=True)
    hole = design.hole_mm(jig)
    bottom = {
        role: jig.nominal_anchors_mm[_anchor(jig, role), 1:] for role in UPRIGHT if _anchor(jig, role) is not None
    }
    for role, yz in bottom.items():
        (at,) = view.at(yz)
        paper.circle("hole", at, max(view.scale * hole / 2, 0.3))
        paper.circle("hidden", at, view.scale * COUNTERBORE_MM / 2)
        paper.cross(at, 4.0)
        paper.text(at + xy(2.5, 2.5), role, 3.5)
    posts = design.posts_yz(jig)
    for yz in posts:
        (at,) = view.at(yz)
        paper.circle("hole", at, view.scale * POST_FIT_MM / 2)
        paper.cross(at, view.scale * POST_FIT_MM / 2 + 2)
    side, deep = jig.side_mm, np.sqrt(3) / 2 * jig.side_mm
    t = jig.tolerance_mm / 2
    a, b, c = view.at((0, 0), (-side / 2, deep), (side / 2, deep))
    below = view.at((0, low[1]))[0][1] - 8
    left = view.at((low[0], 0))[0][0] - 8
    paper.dimension(b, a, below - a[1], f"{side / 2:g} ± {t:g}", axis=0)
    paper.dimension(b, c, below - b[1] - 8, f"{side:g} ± {t:g}", axis=0)
    paper.dimension(a, b, b[0] - left, f"{deep:.3f} ± {t:g}", axis=1)
    p1, p2 = view.at(*posts)
    paper.dimension(a, p1, p1[0] - left + 8, f"{posts[0, 1]:.3f} ± 0.02", axis=1)
    paper.dimension(p1, p2, 8 + view.at(high)[0][1] - p1[1], f"{2 * posts[1, 0]:g} ± 0.02", axis=0)
    corner = view.at((low[0], high[1]))[0]
    paper.dimension([corner[0], view.at((0, low[1]))[0][1]], corner, 24, f"{high[1] - low[1]:.1f}", axis=1)
    (post,) = view.at(posts[1])
    r = view.scale * POST_FIT_MM / 2 * 0.7071
    paper.leader(post + xy(r, -r), post + xy(12, -14), f"2 × ⌀{POST_FIT_MM:g} H7 through")
    margin = design.plate_margin_mm
    paper.text(
        view.at((low[0], low[1]))[0] - xy(0, 28),
        f"rim: {margin:g} round all holes; thickness {design.plate_thickness_mm:g}; faces ground, parallel within 0.02",
    )


def _anchor(jig: Jig, role: str) -> int | None:
    """The index of the bottom anchor of the pillar's string ``role``, or None where the jig has no such string."""
    pillar = jig.require_pillar("the drawing")
    if role not in pillar.strings:
        return None
    k = jig.strings.index(pillar.strings[role])
    ends = (int(jig.start_index[k]), int(jig.end_index[k]))
    return min(ends, key=lambda i: float(jig.nominal_anchors_mm[i, 0]))


def _assembly(paper: Paper, jig: Jig, design: PillarDesign, view: _View, low: float, high: float) -> None:
    """Seen from the front, along +z: y to the right, x up; the farther strings are dashed."""
    t, h = design.plate_thickness_mm, jig.height_mm
    paper.text(view.at((low, h + t))[0] + xy(0, 12), "Assembly from the front (y right, x up)", 3.5)
    for y, _ in design.posts_yz(jig):
        r = design.post_diameter_mm / 2
        paper.path("part", view.at((y - r, 0), (y + r, 0), (y + r, h), (y - r, h)), closed=True)
    for level in (-t, h):
        paper.path("part", view.at((low, level), (high, level), (high, level + t), (low, level + t)), closed=True)
    for label, start, end in zip(jig.strings, jig.starts, jig.ends, strict=True):
        far = min(start[2], end[2]) > jig.side_mm / 2
        paper.path("hidden" if far else "string", view.at((start[1], start[0]), (end[1], end[0])))
        at = start + (end - start) * 0.62
        paper.text(view.at((at[1], at[0]))[0] + xy(1.0, 0), label, 3.2)
    right = view.at((high, 0), (high, h))
    paper.dimension(right[1], right[0], 9, f"{h:g} ± {HEIGHT_TOLERANCE_MM:g}", axis=1)
    left = view.at((low, h), (low, h + t))
    paper.dimension(left[0], left[1], 5, f"{t:g}", axis=1)
    across = view.at((low, -t), (high, -t))
    paper.dimension(across[0], across[1], -9, f"{high - low:.1f}", axis=0)
    paper.text(
        view.at((low, -t))[0] - xy(0, 18),
        "dashed: strings behind; a string ends at its holes' centres on the inner faces",
    )


def _hole(paper: Paper, jig: Jig, design: PillarDesign, at: tuple[float, float]) -> None:
    """A string's hole in section, the inner face above."""
    view = _View(*at, DETAIL)
    d, t = design.hole_mm(jig), design.plate_thickness_mm
    land = min(LAND_MM, t / 2)
    bore = max(COUNTERBORE_MM, 2 * d)
    wide, show = 5.0, min(t, 5.0)
    paper.text(view.at((-wide, 0))[0] + xy(-2, 16), f"String hole, {scale_text(DETAIL)}, inner face above", 3.5)
    for s in (-1, 1):
        profile = [(s * d / 2, 0), (s * d / 2, -land), (s * bore / 2, -land), (s * bore / 2, -show), (s * wide, -show)]
        paper.path("part", view.at(*profile, (s * wide, 0), (s * d / 2, 0)))
    paper.path("axis", view.at((0, 0.8), (0, -show - 0.8)))
    a, b = view.at((wide, 0), (wide, -land))
    paper.dimension(b, a, -5, f"{land:g}", axis=1)
    tip = view.at((d / 2, -0.4))[0]
    paper.leader(tip, view.at((wide, 0.9))[0] + xy(-14, 2), f"⌀{d:g} ± 0.02, rim r 0.1")
    tip = view.at((bore / 2, -land - 1))[0]
    paper.leader(tip, view.at((wide - 1, -show))[0] - xy(0, 4), f"⌀{bore:g} from outside")


def _post(paper: Paper, jig: Jig, design: PillarDesign, at: tuple[float, float], scale: float) -> None:
    """A post, lying: its length is the height between the plates."""
    h, r, s = jig.height_mm, design.post_diameter_mm / 2, POST_FIT_MM / 2
    deep = min(SPIGOT_MM, design.plate_thickness_mm - 1)
    scale = (
        fitting_scale(np.array([h + 2 * deep, 2 * r]), np.array([80.0, 30.0])) if scale * (h + 2 * deep) > 80 else scale
    )
    view = _View(at[0] - scale * h / 2 + 4, at[1] - 12, scale)
    left = view.at((-deep, r))[0]
    paper.text([at[0] - 27, left[1] + 16], f"Post, 2 off, {scale_text(scale)}", 3.5)
    paper.path("part", view.at((0, -r), (h, -r), (h, r), (0, r)), closed=True)
    for x0, x1 in ((-deep, 0.0), (h, h + deep)):
        paper.path("part", view.at((x0, -s), (x1, -s), (x1, s), (x0, s)), closed=True)
    paper.path("axis", view.at((-deep - 2, 0), (h + deep + 2, 0)))
    a, b = view.at((0, r), (h, r))
    paper.dimension(a, b, 6, f"{h:g} ± {HEIGHT_TOLERANCE_MM:g}", axis=0)
    a, b = view.at((h, -s), (h + deep, -s))
    paper.dimension(a, b, -8, f"{deep:g}", axis=0)
    paper.leader(view.at((h / 2, -r))[0], view.at((h / 2, -r))[0] + xy(6, -9), f"⌀{2 * r:g}")
    paper.leader(
        view.at((-deep / 2, -s))[0],
        view.at((-deep / 2, -s))[0] + xy(6, -17),
        f"⌀{POST_FIT_MM:g} h6, {POST_SCREW} × 12, both ends",
    )


def _tables(paper: Paper, jig: Jig, at: tuple[float, float]) -> None:
    """Hole positions, and which string runs where."""
    kind = "as measured" if jig.measured else "as drawn"
    rows = [f"{'hole':<6}{'x / mm':>10}{'y / mm':>10}{'z / mm':>10}  strings"]
    for k in jig.used_anchors:
        p = jig.anchors_mm[k]
        here = (jig.start_index == k) | (jig.end_index == k)
        ends = ", ".join(jig.strings[s] for s in np.flatnonzero(here))
        rows += [f"{jig.anchors[k]:<6}{p[0]:10.3f}{p[1]:10.3f}{p[2]:10.3f}  {ends}"]
    paper.text((at[0], at[1] + 5), f"Hole centres on the inner faces, {kind}; b: bottom, t: top", 3.2)
    paper.lines(at, rows, 2.8, mono=True)
    below = at[1] - (len(rows) + 1.2) * LINE_MM
    runs = [f"{'string':<8}{'from':<6}{'to':<6}{'free length / mm':>17}"]
    for k, label in enumerate(jig.strings):
        a, b = jig.anchors[jig.start_index[k]], jig.anchors[jig.end_index[k]]
        runs += [f"{label:<8}{a:<6}{b:<6}{jig.lengths[k]:17.3f}"]
    paper.lines((at[0], below), runs, 2.8, mono=True)


def _notes(paper: Paper, jig: Jig, design: PillarDesign, at: tuple[float, float]) -> None:
    d, half = design.hole_mm(jig), jig.tolerance_mm / 2
    play = (d - jig.string_diameter_mm) / 2
    notes = [
        f"1  hole centres within ± {half:g} mm in y and z of the table, from hole A of the bottom",
        "   plate along the line through B and C; both plates drilled and reamed clamped together,",
        "   so that their holes are the same; mark the pair's front before it is taken apart",
        f"2  string ⌀ {jig.string_diameter_mm:g} in a hole ⌀ {d:g}: it lies on the rim, up to {play:.2f} mm off;",
        "   where that is more than the tolerance, measure where the strings leave",
        "3  inner rims rounded and polished: an edge cuts the string and moves it",
        f"4  posts equally long within {EQUAL_MM:g}, shoulders square; {POST_SCREW} screws with washers from outside",
        "5  all faces towards the strings matt black; posts matt: gloss lights the strings a second time",
        "6  one thread a string, knotted outside over a washer, drawn over the other plate's outer",
        "   rim and clamped at 3 to 5 N (a spring or a weight while it is fixed)",
        "7  outer edges broken 0.3; threads in the base plate for the cell: M6, 15 from the rim behind B, C",
    ]
    paper.text((at[0], at[1] + 5), "Notes", 3.2)
    paper.lines(at, notes, 2.6)
