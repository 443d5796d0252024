"""The jig as solids: plates with drilled holes, posts between them, strings as tubes; watertight meshes in {J} [mm]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import shapely
import trimesh
from numpy.typing import NDArray

from geometry import InputError
from jig_cad.jig import ANCHORS, STRINGS, Jig

Array = NDArray[np.float64]

_ARC_SEGMENTS = 16  # per quarter turn
_UP = np.array([[0, 0, 1, 0], [1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1.0]])  # drawn in (y, z), extruded along x


@dataclass(frozen=True)
class PillarDesign:
    """What holds the strings; none of it enters a calibration.

    The plates' inner faces are at x = 0 and x = h, where the strings leave the holes' centres. Two posts stand behind
    strings B and C, ``post_behind_mm`` beyond and ``post_outwards_mm`` outside them: seen from the front (-z) they hide
    no string (measured by benchmarks/jig_posts.py, docs/jig_cad.md).
    hole_diameter_mm: None for twice the string's, which lets two strings leave one hole.
    """

    plate_thickness_mm: float = 10.0
    plate_margin_mm: float = 8.0
    hole_diameter_mm: float | None = None
    post_diameter_mm: float = 12.0
    post_behind_mm: float = 20.0
    post_outwards_mm: float = 15.0

    def __post_init__(self) -> None:
        """InputError where the numbers can not be a pillar."""
        for key in ("plate_thickness_mm", "plate_margin_mm", "post_diameter_mm"):
            if not (np.isfinite(value := getattr(self, key)) and value > 0):
                raise InputError(f"{key} = {value:g}: must be a positive, finite number of millimetres")

    def hole_mm(self, jig: Jig) -> float:
        """The holes' diameter [mm]; InputError where the string does not fit or the hole breaks the plate's rim."""
        hole = 2 * jig.string_diameter_mm if self.hole_diameter_mm is None else self.hole_diameter_mm
        if not jig.string_diameter_mm < hole < 2 * self.plate_margin_mm:
            raise InputError(
                f"hole_diameter_mm = {hole:g}: must lie between the string's {jig.string_diameter_mm:g} mm and twice "
                f"plate_margin_mm = {self.plate_margin_mm:g}"
            )
        return float(hole)

    def posts_yz(self, jig: Jig) -> Array:
        """The posts' axes (2, 2) as (y, z) in {J} [mm]."""
        y, z = jig.side_mm / 2 + self.post_outwards_mm, np.sqrt(3) / 2 * jig.side_mm + self.post_behind_mm
        return np.array([[-y, z], [y, z]])

    def plate(self, jig: Jig) -> Any:
        """The outline of both plates as a shapely polygon in (y, z) [mm], without holes."""
        holes, drawn = jig.anchors_mm[:, 1:], jig.nominal_anchors_mm[:, 1:]
        strayed = holes[np.linalg.norm(holes - drawn, axis=1) > self.plate_margin_mm / 2]
        corners = np.vstack([drawn, strayed, self.posts_yz(jig)])
        return shapely.MultiPoint(corners).convex_hull.buffer(self.plate_margin_mm, quad_segs=_ARC_SEGMENTS)


def jig_solids(
    jig: Jig, design: PillarDesign | None = None, *, strings: bool = True, posts: bool = True
) -> dict[str, trimesh.Trimesh]:
    """Watertight meshes in {J} [mm] by name: "bottom plate", "top plate", "post 1" …, "string A" ….

    The holes are drilled at the jig's anchors (measured or sampled, where they are). strings, posts: whether they are
    wanted; a ray caster that intersects strings as exact cylinders leaves them out.
    """
    design = design or PillarDesign()
    solids = {"bottom plate": _plate(jig, design, top=False), "top plate": _plate(jig, design, top=True)}
    if posts:
        for i, (y, z) in enumerate(design.posts_yz(jig), start=1):
            solids[f"post {i}"] = _rod([0, y, z], [jig.height_mm, y, z], design.post_diameter_mm, 4 * _ARC_SEGMENTS)
    if strings:
        for label, start, end in zip(jig.strings, jig.starts, jig.ends, strict=True):
            beyond = _beyond_anchor(label, jig, design) * (end - start) / np.linalg.norm(end - start)
            solids[f"string {label}"] = _rod(start - beyond, end + beyond, jig.string_diameter_mm, 24)
    return solids


def used_anchors(jig: Jig) -> tuple[str, ...]:
    """The anchors at which a string ends, in the order of ANCHORS."""
    return tuple(a for a in ANCHORS if any(a in STRINGS[s] for s in jig.strings))


def _plate(jig: Jig, design: PillarDesign, *, top: bool) -> trimesh.Trimesh:
    outline, radius = design.plate(jig), design.hole_mm(jig) / 2
    for i, anchor in enumerate(ANCHORS):
        if anchor.endswith("t") == top and anchor in used_anchors(jig):
            hole = shapely.Point(jig.anchors_mm[i, 1:]).buffer(radius, quad_segs=_ARC_SEGMENTS)
            outline = outline.difference(hole)
    mesh: trimesh.Trimesh = trimesh.creation.extrude_polygon(outline, design.plate_thickness_mm)
    mesh.apply_transform(_UP)
    mesh.apply_translation([jig.height_mm if top else -design.plate_thickness_mm, 0, 0])
    return mesh


def _beyond_anchor(label: str, jig: Jig, design: PillarDesign) -> float:
    """How far a string's tube goes on beyond its anchors [mm]: the upright ones through the plates.

    Tubes that end in one point would share edges, and a file of all solids would not be watertight.
    """
    if not label.endswith("'"):
        return design.plate_thickness_mm
    return 0.2 * jig.string_diameter_mm if label == "D'" else 0.0


def _rod(start: object, end: object, diameter_mm: float, sections: int) -> trimesh.Trimesh:
    ends = np.array([start, end], dtype=float)
    rod: trimesh.Trimesh = trimesh.creation.cylinder(diameter_mm / 2, segment=ends, sections=sections)
    return rod
