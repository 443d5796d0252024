"""Solids: made ready for light, cut by planes of the sheet, asked what they hide, drawn as flat faces."""

from perceptron_emu.solids.bodies import Body, body_of, hidden_by_solid
from perceptron_emu.solids.bvh import Bvh, blocked, build_bvh
from perceptron_emu.solids.flat_faces import facets
from perceptron_emu.solids.panels import PanelPair, random_panels
from perceptron_emu.solids.raster import rasterise
from perceptron_emu.solids.section import LaserRays, Pieces, Shades, lit_in_planes

__all__ = [
    "Body",
    "Bvh",
    "LaserRays",
    "PanelPair",
    "Pieces",
    "Shades",
    "blocked",
    "body_of",
    "build_bvh",
    "facets",
    "hidden_by_solid",
    "lit_in_planes",
    "random_panels",
    "rasterise",
]
