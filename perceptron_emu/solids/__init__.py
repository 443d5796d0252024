"""Solids: made ready for light, cut by planes of the sheet, asked what they hide, drawn as flat faces."""

from perceptron_emu.solids.bodies import Body, body_of, hidden_by_solid
from perceptron_emu.solids.bvh import Bvh, blocked, build_bvh
from perceptron_emu.solids.flat_faces import FlatFaces, flat_faces
from perceptron_emu.solids.panels import PanelPair, profile_strip, random_panels
from perceptron_emu.solids.section import LaserRays, Shades, SheetPieces, lit_in_planes
from perceptron_emu.solids.world import (
    Hit,
    World,
    between,
    first_met,
    hidden_by_solids,
    into_solids,
    normal_at,
    world_of,
)

__all__ = [
    "Body",
    "Bvh",
    "FlatFaces",
    "Hit",
    "LaserRays",
    "PanelPair",
    "Shades",
    "SheetPieces",
    "World",
    "between",
    "blocked",
    "body_of",
    "build_bvh",
    "first_met",
    "flat_faces",
    "hidden_by_solid",
    "hidden_by_solids",
    "into_solids",
    "lit_in_planes",
    "normal_at",
    "profile_strip",
    "random_panels",
    "world_of",
]
