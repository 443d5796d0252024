"""The emulator: scenes of strings and solids under a laser sheet, rendered to images with exact truth.

The main road is `pipeline.render`: moments of the exposure → what the laser lights and the camera sees (`light`) → mean
electrons on the chip (`image`) → grey levels (`chip`), with the truth of all of it. Below stand `lens` and `solids`;
beside it `gl`, a second renderer by OpenGL and pictures of the cell, and `scene_file`, which reads scene.toml.
"""

from perceptron_emu.check import check_optics, check_scene
from perceptron_emu.chip import gain_dn_per_e
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.image import contrast as speckle_contrast
from perceptron_emu.image import grain_px
from perceptron_emu.lens import project
from perceptron_emu.light import cylinders, faces_in_sheet, hidden_by_strings
from perceptron_emu.pipeline import mean_electrons, render
from perceptron_emu.scene import ALUMINIUM, BLACK_PLATE, MATTE, WALL, Material, Scene, Solid, panel
from perceptron_emu.scene_file import SceneFile, Surroundings, read_scene, read_surroundings
from perceptron_emu.solids import hidden_by_solid, profile_strip
from perceptron_emu.truth import RenderedFrame, RenderedTruth, SheetCurve, StringTruth

__all__ = [
    "ALUMINIUM",
    "BLACK_PLATE",
    "MATTE",
    "WALL",
    "EmulatorConfig",
    "Material",
    "RenderedFrame",
    "RenderedTruth",
    "Scene",
    "SceneFile",
    "SheetCurve",
    "Solid",
    "StringTruth",
    "Surroundings",
    "check_optics",
    "check_scene",
    "cylinders",
    "faces_in_sheet",
    "gain_dn_per_e",
    "grain_px",
    "hidden_by_solid",
    "hidden_by_strings",
    "mean_electrons",
    "panel",
    "profile_strip",
    "project",
    "read_scene",
    "read_surroundings",
    "render",
    "speckle_contrast",
]
