"""The jig as files: STL and GLB of its solids; drawings of any target for its maker, as SVG and DXF."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from geometry import InputError, Target, did_you_mean, write_bytes
from jig_cad.drawing import drawing_dxf, drawing_svg
from jig_cad.drawing_targets import target_drawing
from jig_cad.jig import Jig
from jig_cad.paper import dxf_text, svg_text
from jig_cad.solids import PillarDesign, jig_solids

FORMATS = (".stl", ".glb", ".svg", ".dxf")
DRAWINGS = (".svg", ".dxf")

# glTF is in metres with +Y up and +Z to the viewer: x of {J} goes up and the front, -z of {J}, faces the viewer
_GLTF_JIG = np.array([[0, 0.001, 0, 0], [0.001, 0, 0, 0], [0, 0, -0.001, 0], [0, 0, 0, 1]])
_COLOURS = {"bottom": (150, 155, 160, 255), "top": (150, 155, 160, 255), "post": (190, 195, 200, 255)}
_STRING_COLOUR = (235, 225, 190, 255)


def export_jig(jig: Jig, path: str | os.PathLike[str], design: PillarDesign | None = None) -> None:
    """Write the jig, whole or not at all; the path's ending chooses the format.

    Parameters
    ----------
    jig : Jig
    path : str or path
        .stl: all solids in one mesh, {J} [mm]. .glb: a scene of named solids, each in {J} [mm] under a node "jig" that
        turns and scales them to glTF's metres, Y up. .svg, .dxf: the drawing with dimensions and tolerances, on A3.
    design : PillarDesign, optional
        Plates, posts and holes; None: the defaults.

    Raises
    ------
    InputError
        For another ending, or a drawing of strings that are no pillar.
    """
    goal = Path(path)
    suffix = goal.suffix.lower()
    if suffix not in FORMATS:
        instead = did_you_mean(suffix, FORMATS) or f"; the jig is written as {', '.join(FORMATS)}"
        raise InputError(f'{goal}: unknown ending "{suffix}"{instead}')
    if suffix in DRAWINGS:
        write_bytes(goal, (drawing_svg if suffix == ".svg" else drawing_dxf)(jig, design).encode())
    elif suffix == ".stl":
        write_bytes(goal, _stl(jig, design))
    else:
        write_bytes(goal, _glb(jig, design))


def export_target(target: Target, path: str | os.PathLike[str]) -> None:
    """Write a target of any kind as `export_jig` does; surfaces have no solids of their own, so they are drawn alone.

    Parameters
    ----------
    target : Target
    path : str or path
        Its ending chooses the format.

    Raises
    ------
    InputError
        For an ending that the kind does not have.
    """
    if isinstance(target, Jig):
        export_jig(target, path)
        return
    goal = Path(path)
    suffix = goal.suffix.lower()
    if suffix not in DRAWINGS:
        instead = (
            did_you_mean(suffix, DRAWINGS) or f"; a target that is no string jig is written as {', '.join(DRAWINGS)}"
        )
        raise InputError(f'{goal}: unknown ending "{suffix}"{instead}')
    paper = target_drawing(target)
    write_bytes(goal, (svg_text if suffix == ".svg" else dxf_text)(paper).encode())


def _stl(jig: Jig, design: PillarDesign | None) -> bytes:
    import trimesh  # a quarter of a second, and most commands build no mesh

    whole: Any = trimesh.util.concatenate(list(jig_solids(jig, design).values()))
    return bytes(whole.export(file_type="stl"))


def _glb(jig: Jig, design: PillarDesign | None) -> bytes:
    import trimesh

    scene: Any = trimesh.Scene()
    scene.graph.update(frame_to="jig", frame_from=scene.graph.base_frame, matrix=_GLTF_JIG)
    for name, mesh in jig_solids(jig, design).items():
        visual: Any = mesh.visual
        visual.face_colors = _COLOURS.get(name.split()[0], _STRING_COLOUR)
        scene.add_geometry(mesh, node_name=name, geom_name=name, parent_node_name="jig")
    return bytes(scene.export(file_type="glb"))
