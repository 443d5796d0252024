"""Drawings of the other targets: a ball, balls on a plate, a plane, an edge, a wedge."""

from __future__ import annotations

from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Target
from jig_cad.drawing import fitting_scale, pillar_drawing, scale_text
from jig_cad.flat import Edge, Plane, Wedge
from jig_cad.jig import Jig
from jig_cad.paper import BORDER_MM, LINE_MM, Paper, xy
from jig_cad.sphere import Balls, Sphere

Array = NDArray[np.float64]

PLATE_MM = (200.0, 150.0)  # of a plane or an edge whose file states no size
STEM_SHARE = 0.3  # a stem's thickness over its ball's diameter: it hides little of the ball
FOOT_MM, FOOT_THICK_MM = 60.0, 15.0  # of a single ball's foot
PIN_CLEAR_MM = 25.0  # from the plate to the lowest ball
THICKNESS_SHARE = 1 / 10  # a plate's over its longer side: it must not bend
WEDGE_LONG_MM, WEDGE_LEG_MM = 150.0, 60.0
ROOM = np.array([250.0, 165.0])  # on the sheet, for one view


@singledispatch
def target_drawing(target: Target) -> Paper:
    """The sheet for a target of any kind; InputError where lines are no pillar, or no drawing is registered."""
    raise InputError(f"no drawing is known for a target of class {type(target).__name__}")


target_drawing.register(Jig, pillar_drawing)


@target_drawing.register(Sphere)
def _sphere(ball: Sphere) -> Paper:
    paper = _sheet("Ball", ball.name, "ball: ceramic or steel, matt (etched, or sprayed thin and even)")
    d = ball.diameter_mm
    stem, neck = max(4.0, STEM_SHARE * d), 1.2 * d
    k = fitting_scale(np.array([max(d, FOOT_MM), d + neck + FOOT_THICK_MM]), ROOM)
    foot = np.array([BORDER_MM + 130.0, 85.0])
    centre = foot + xy(0, k * (FOOT_THICK_MM + neck + d / 2))
    paper.circle("part", centre, k * d / 2)
    paper.cross(centre, k * d / 2 + 4)
    low = centre[1] - k * np.sqrt(d**2 - stem**2) / 2
    for s in (-1, 1):
        x = foot[0] + s * k * stem / 2
        paper.path("part", [[x, low], [x, foot[1] + k * FOOT_THICK_MM]])
    half = k * FOOT_MM / 2
    paper.path("part", _box(foot[0] - half, foot[1], foot[0] + half, foot[1] + k * FOOT_THICK_MM), closed=True)
    known = "" if ball.known else " (as you have it: it is estimated)"
    tolerance = max(0.001, ball.diameter_sigma_mm if np.isfinite(ball.diameter_sigma_mm) else 0.01)
    paper.leader(
        centre + k * d / 2 * np.array([0.71, 0.71]), centre + k * d / 2 + xy(8, 8), f"⌀{d:g} ± {tolerance:g}{known}"
    )
    paper.leader(
        [foot[0] + k * stem / 2, foot[1] + k * (FOOT_THICK_MM + neck / 2)],
        [foot[0] + k * stem / 2 + 12, foot[1] + k * (FOOT_THICK_MM + neck / 2) - 8],
        f"stem ⌀{stem:.3g}",
    )
    paper.dimension(
        [foot[0] - half, foot[1]], [foot[0] - half, centre[1]], 14, f"{FOOT_THICK_MM + neck + d / 2:.3g}", axis=1
    )
    paper.dimension([foot[0] - half, foot[1]], [foot[0] + half, foot[1]], -10, f"⌀{FOOT_MM:g}", axis=0)
    paper.lines(
        (BORDER_MM + 6, 60.0),
        [
            "1  a tooling or bearing ball: form within 0.001 to 0.005 mm costs little and is far below any noise",
            "2  matt all over: a glossy ball shows the laser as one bright glint and its arc is cut to pieces",
            "3  what was sprayed on adds to the diameter: measure it after, or leave diameter_mm out of target.toml",
            "4  the foot clamped or glued; a magnet moves when the arm shakes the table",
        ],
        2.8,
    )
    return _with_block(paper, k)


@target_drawing.register(Balls)
def _balls(balls: Balls) -> Paper:
    paper = _sheet("Balls", balls.name, "balls as for a tooling ball; plate: aluminium or steel; matt")
    centres, radius = balls.centres_mm, balls.diameters_mm / 2
    low = float(np.min(centres[:, 2] - radius)) - PIN_CLEAR_MM
    margin = float(np.max(radius)) + 10
    corner, far = centres[:, :2].min(axis=0) - margin, centres[:, :2].max(axis=0) + margin
    size = far - corner
    tall = float(np.max(centres[:, 2] + radius)) - low + FOOT_THICK_MM
    k = fitting_scale(np.array([2 * size[0] + 70, max(size[1], tall)]), np.array([330.0, 150.0]))
    plan = np.array([BORDER_MM + 45, 115.0]) - k * corner
    paper.text([BORDER_MM + 45, 115.0 + k * size[1] + 10], "From above (x right, y up)", 3.5)
    paper.path("part", _box(*(plan + k * corner), *(plan + k * far)), closed=True)
    side = np.array([plan[0] + k * far[0] + 45 - k * corner[0], 115.0 + k * (FOOT_THICK_MM - low)])
    paper.text(
        [side[0] + k * corner[0], side[1] + k * (tall + low - FOOT_THICK_MM) + 10], "From the side (x right, z up)", 3.5
    )
    paper.path(
        "part",
        _box(side[0] + k * corner[0], side[1] + k * (low - FOOT_THICK_MM), side[0] + k * far[0], side[1] + k * low),
        closed=True,
    )
    for name, c, r in zip(balls.names, centres, radius, strict=True):
        at, beside = plan + k * c[:2], side + k * c[[0, 2]]
        stem = max(2.0, STEM_SHARE * r)
        for centre in (at, beside):
            paper.circle("part", centre, k * r)
            paper.cross(centre, k * r + 2)
        for s in (-1, 1):
            x = beside[0] + s * k * stem
            paper.path("part", [[x, beside[1] - k * np.sqrt(r**2 - stem**2)], [x, side[1] + k * low]])
        paper.text(at + xy(k * r * 0.75 + 1, k * r * 0.75 + 1), name, 3.2)
    paper.dimension(
        plan + k * np.array([corner[0], corner[1]]),
        plan + k * np.array([far[0], corner[1]]),
        -9,
        f"{size[0]:g}",
        axis=0,
    )
    paper.dimension(plan + k * corner, plan + k * np.array([corner[0], far[1]]), 9, f"{size[1]:g}", axis=1)
    rows = [f"{'ball':<12}{'x / mm':>10}{'y / mm':>10}{'z / mm':>10}{'diameter':>10}"]
    rows += [
        f"{name[:11]:<12}{c[0]:10.3f}{c[1]:10.3f}{c[2]:10.3f}{2 * r:10.3f}"
        for name, c, r in zip(balls.names, centres, radius, strict=True)
    ]
    paper.lines((BORDER_MM + 6, 88.0), rows, 2.8, mono=True)
    paper.lines(
        (BORDER_MM + 6, 88.0 - (len(rows) + 1) * LINE_MM),
        [
            "centres are what a measuring machine says after all is glued: built within ± 0.5, measured within 0.005",
            f"plate {FOOT_THICK_MM:g} thick; pins pressed in and glued; measured centres, in any axes, by",
            "perceptron-emu jig target.toml --anchors measured.csv --out target.toml",
        ],
        2.8,
    )
    return _with_block(paper, k)


@target_drawing.register(Plane)
def _plane(plane: Plane) -> Paper:
    paper = _sheet("Plane", plane.name, "granite, steel or cast aluminium plate, lapped, matt")
    w, h = plane.width_mm or PLATE_MM[0], plane.height_mm or PLATE_MM[1]
    return _plate(
        paper,
        w,
        h,
        [
            "1  the measured face flat within 0.005: what it bends is measured as an error of the sensor's pose",
            "2  matt and of one colour: no ground or milled marks that shine along one direction",
            "3  on three feet (threads M6 from below, two at one side, one at the other): four feet bend it",
        ],
        "flat within 0.005",
    )


@target_drawing.register(Edge)
def _edge(_: Edge) -> Paper:
    paper = _sheet("Edge", "", "hardened steel, ground; matt upper face")
    return _plate(
        paper,
        *PLATE_MM,
        [
            "1  the measured border (upper in the drawing) straight within 0.005, sharp: radius below 0.02, no burr",
            "2  behind it nothing within 50: the profile must end or jump there",
            "3  flat within 0.01, matt; on three feet",
        ],
        "border straight within 0.005, r < 0.02",
    )


def _plate(paper: Paper, w: float, h: float, notes: list[str], mark: str) -> Paper:
    t = max(10.0, THICKNESS_SHARE * max(w, h))
    k = fitting_scale(np.array([w + t + 60, h]), ROOM)
    at = np.array([BORDER_MM + 40, 90.0])
    paper.path("part", _box(at[0], at[1], at[0] + k * w, at[1] + k * h), closed=True)
    side = at + xy(k * w + 40, 0)
    paper.path("part", _box(side[0], side[1], side[0] + k * t, side[1] + k * h), closed=True)
    feet = np.array([[0.15 * w, 0.12 * h], [0.85 * w, 0.12 * h], [0.5 * w, 0.88 * h]])
    for foot in feet:
        paper.circle("hidden", at + k * foot, k * 3)
        paper.cross(at + k * foot, k * 3 + 2)
    paper.dimension(at, at + xy(k * w, 0), -10, f"{w:g}", axis=0)
    paper.dimension(at, at + xy(0, k * h), 12, f"{h:g}", axis=1)
    paper.dimension(side, side + xy(k * t, 0), -10, f"{t:g}", axis=0)
    paper.leader(at + k * feet[0], at + k * feet[0] + xy(12, 12), "3 × M6, 8 deep, from behind")
    paper.leader(at + xy(k * w * 0.3, k * h), at + xy(k * w * 0.3 + 10, k * h + 10), mark)
    paper.lines((BORDER_MM + 6, 60.0), notes, 2.8)
    return _with_block(paper, k)


@target_drawing.register(Wedge)
def _wedge(wedge: Wedge) -> Paper:
    paper = _sheet("Wedge", wedge.name, "two ground plates or one milled block, matt")
    half = np.deg2rad(wedge.angle_deg) / 2
    leg = WEDGE_LEG_MM * np.array([np.sin(half), -np.cos(half)])
    k = fitting_scale(np.array([2 * leg[0] + 60 + WEDGE_LONG_MM, WEDGE_LEG_MM + 20]), ROOM)
    ridge = np.array([BORDER_MM + 40 + k * leg[0], 90.0 + k * (20 - leg[1])])
    a, b = ridge + k * leg * [-1, 1], ridge + k * leg
    base = np.array([0, -k * 20])
    paper.path("part", [ridge, b, b + base, a + base, a], closed=True)
    known = "" if wedge.angle_known else " (any: it is estimated)"
    paper.leader(ridge, ridge + xy(14, 9), f"{wedge.angle_deg:g}° ± 0.02°{known}, ridge sharp or undercut")
    paper.dimension(a + base, b + base, -10, f"{2 * leg[0]:.1f}", axis=0)
    top = np.array([b[0] + 45, (b + base)[1]])
    end = top + xy(k * WEDGE_LONG_MM, ridge[1] - top[1])
    paper.path("part", _box(*top, *end), closed=True)
    paper.dimension(top, [end[0], top[1]], -10, f"{WEDGE_LONG_MM:g}", axis=0)
    paper.lines(
        (BORDER_MM + 6, 60.0),
        [
            "1  both faces flat within 0.005, the ridge straight within 0.01; a valley serves as well",
            "2  the ridge itself is not measured, it is where the faces' planes meet: a groove along it does no harm",
            "3  matt; on three feet",
        ],
        2.8,
    )
    return _with_block(paper, k)


def _sheet(kind: str, name: str, material: str) -> Paper:
    return Paper(f"{kind} {name}".strip(), material=material)


def _with_block(paper: Paper, scale: float) -> Paper:
    paper.title_block(
        [
            ("scale", scale_text(scale) + "; all dimensions in mm"),
            ("general tolerances", "ISO 2768-mK where none is given"),
            ("material", paper.material),
        ]
    )
    return paper


def _box(x0: float, y0: float, x1: float, y1: float) -> list[list[float]]:
    return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
