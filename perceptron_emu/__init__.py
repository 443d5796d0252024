"""The emulator: scenes of strings and solids under a laser sheet, rendered to images with exact truth."""

from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens.projection import project
from perceptron_emu.render import mean_electrons, render
from perceptron_emu.scene import ALUMINIUM, BLACK_PLATE, MATTE, WALL, Material, Scene, Solid, panel
from perceptron_emu.truth import Frame, FrameTruth, SheetCurve, StringTruth

__all__ = [
    "ALUMINIUM",
    "BLACK_PLATE",
    "MATTE",
    "WALL",
    "EmulatorConfig",
    "Frame",
    "FrameTruth",
    "Material",
    "Scene",
    "SheetCurve",
    "Solid",
    "StringTruth",
    "mean_electrons",
    "panel",
    "project",
    "render",
]
