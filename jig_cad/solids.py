"""The jig as solids: plates with drilled holes, posts between them, strings as tubes; watertight meshes in {J} [mm]."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import shapely
from numpy.typing import NDArray

from geometry import InputError
from jig_cad.jig import Jig
from jig_cad.pillar import UPRIGHT, nominal_anchors

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

_BLOCK_MM = 4.0  # what holds a string's end where there are no plates
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
        side = jig.require_pillar("a plate with posts").side_mm
        y, z = side / 2 + self.post_outwards_mm, np.sqrt(3) / 2 * side + self.post_behind_mm
        return np.array([[-y, z], [y, z]])

    def plate(self, jig: Jig) -> Any:
        """The outline of both plates as a shapely polygon in (y, z) [mm], without holes."""
        pillar = jig.require_pillar("a plate with posts")
        holes, drawn = jig.anchors_mm[:, 1:], jig.nominal_anchors_mm[:, 1:]
        strayed = holes[np.linalg.norm(holes - drawn, axis=1) > self.plate_margin_mm / 2]
        corners = np.vstack([nominal_anchors(pillar.side_mm, pillar.height_mm)[:, 1:], strayed, self.posts_yz(jig)])
        return shapely.MultiPoint(corners).convex_hull.buffer(self.plate_margin_mm, quad_segs=_ARC_SEGMENTS)


def jig_solids(
    jig: Jig, design: PillarDesign | None = None, *, strings: bool = True, posts: bool = True
) -> dict[str, trimesh.Trimesh]:
    """Watertight meshes of a jig, in {J} [mm].

    Parameters
    ----------
    jig : Jig
        The holes are drilled at its anchors, measured or sampled where they are.
    design : PillarDesign, optional
        None: the defaults.
    strings, posts : bool
        Whether they are wanted; a ray caster that intersects strings as exact cylinders leaves them out.

    Returns
    -------
    dict of str to trimesh.Trimesh
        By name: "bottom plate", "top plate", "post 1" …, "string A" …; of strings that are no pillar a block at each
        anchor, "block NAME", in place of plates and posts.
    """
    design = design or PillarDesign()
    if jig.pillar is None:
        return _blocks(jig) | (_strings(jig, design) if strings else {})
    solids = {"bottom plate": _plate(jig, design, top=False), "top plate": _plate(jig, design, top=True)}
    if posts:
        for i, (y, z) in enumerate(design.posts_yz(jig), start=1):
            solids[f"post {i}"] = _rod([0, y, z], [jig.height_mm, y, z], design.post_diameter_mm, 4 * _ARC_SEGMENTS)
    return solids | (_strings(jig, design) if strings else {})


def block_edge_mm(jig: Jig) -> float:
    """The edge [mm] of the cubes that hold the strings of a set that is no pillar."""
    return max(_BLOCK_MM, 4 * jig.string_diameter_mm)


def _blocks(jig: Jig) -> dict[str, trimesh.Trimesh]:
    """A cube about every place at which strings end; anchors nearer to each other than half its edge share one."""
    import trimesh  # a quarter of a second, and most commands build no mesh

    edge, blocks, taken = block_edge_mm(jig), dict[str, trimesh.Trimesh](), list[Array]()
    for k in jig.used_anchors:
        place = jig.anchors_mm[k]
        if all(np.linalg.norm(place - other) > edge / 2 for other in taken):
            block: trimesh.Trimesh = trimesh.creation.box(np.full(3, edge))
            block.apply_translation(place)
            blocks[f"block {jig.anchors[k]}"] = block
            taken.append(place)
    return blocks


def _strings(jig: Jig, design: PillarDesign) -> dict[str, trimesh.Trimesh]:
    solids = {}
    for label, start, end in zip(jig.strings, jig.starts, jig.ends, strict=True):
        beyond = _beyond_anchor(label, jig, design) * (end - start) / np.linalg.norm(end - start)
        solids[f"string {label}"] = _rod(start - beyond, end + beyond, jig.string_diameter_mm, 24)
    return solids


def _plate(jig: Jig, design: PillarDesign, *, top: bool) -> trimesh.Trimesh:
    import trimesh  # a quarter of a second, and most commands build no mesh

    outline, radius = design.plate(jig), design.hole_mm(jig) / 2
    for i in jig.used_anchors:
        if (jig.nominal_anchors_mm[i, 0] > jig.height_mm / 2) == top:
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
    if jig.pillar is None:  # a share of the diameter of its own for each string
        return 0.3 * jig.string_diameter_mm * jig.strings.index(label) / len(jig.strings)
    role = jig.pillar.role(label)
    if role in UPRIGHT:
        return design.plate_thickness_mm
    return 0.2 * jig.string_diameter_mm if role == "D'" else 0.0


def _rod(start: object, end: object, diameter_mm: float, sections: int) -> trimesh.Trimesh:
    import trimesh  # a quarter of a second, and most commands build no mesh

    ends = np.array([start, end], dtype=float)
    rod: trimesh.Trimesh = trimesh.creation.cylinder(diameter_mm / 2, segment=ends, sections=sections)
    return rod
