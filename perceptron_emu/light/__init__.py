"""The laser on the scene: the sheet, what it reaches first, and the light that each lit point sends to the chip."""

from perceptron_emu.light.bounce import BounceRoom, Sources, bounce_room, bounce_sources, far_lamp, radiance
from perceptron_emu.light.lighting import LitScene, light_scene, thread_of
from perceptron_emu.light.motion import Moment, moments, moved
from perceptron_emu.light.nodes import TILE_PX, LightNodes, join, string_group, stripe_group
from perceptron_emu.light.sheet import SHEET_REACH, across, along, axis_meets_sheet_mm, half_width_mm
from perceptron_emu.light.sheet_faces import Faces, faces_in_sheet
from perceptron_emu.light.strings import Cylinders, cylinders, hidden_by_strings, light_strings
from perceptron_emu.light.stripes import OFF_SURFACE_MM, lit_pieces
from perceptron_emu.light.transport import Light

__all__ = [
    "OFF_SURFACE_MM",
    "SHEET_REACH",
    "TILE_PX",
    "BounceRoom",
    "Cylinders",
    "Faces",
    "Light",
    "LightNodes",
    "LitScene",
    "Moment",
    "Sources",
    "across",
    "along",
    "axis_meets_sheet_mm",
    "bounce_room",
    "bounce_sources",
    "cylinders",
    "faces_in_sheet",
    "far_lamp",
    "half_width_mm",
    "hidden_by_strings",
    "join",
    "light_scene",
    "light_strings",
    "lit_pieces",
    "moments",
    "moved",
    "radiance",
    "string_group",
    "stripe_group",
    "thread_of",
]
