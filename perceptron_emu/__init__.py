"""The emulator: scenes of strings and solids under a laser sheet, rendered to images with exact truth.

The main road is `pipeline.render`: moments of the exposure → what the laser lights and the camera sees (`light`) → mean
electrons on the chip (`image`) → grey levels (`chip`), with the truth of all of it. Below stand `lens` and `solids`;
beside it `gl`, a second renderer by OpenGL and pictures of the cell, and `scene_file`, which reads scene.toml.
"""

from typing import TYPE_CHECKING

from geometry.lazy import lazy_names
from perceptron_emu.config import EmulatorConfig

if TYPE_CHECKING:
    from perceptron_emu.check import check_optics, check_scene
    from perceptron_emu.chip import gain_dn_per_e
    from perceptron_emu.image import grain_px, speckle_contrast
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

# kernels take a fifth of a second to load, and calibration needs the settings alone
__getattr__ = lazy_names(
    __name__,
    {
        "perceptron_emu.check": (
            "check_optics",
            "check_scene",
        ),
        "perceptron_emu.chip": ("gain_dn_per_e",),
        "perceptron_emu.image": (
            "grain_px",
            "speckle_contrast",
        ),
        "perceptron_emu.lens": ("project",),
        "perceptron_emu.light": (
            "cylinders",
            "faces_in_sheet",
            "hidden_by_strings",
        ),
        "perceptron_emu.pipeline": (
            "mean_electrons",
            "render",
        ),
        "perceptron_emu.scene": (
            "ALUMINIUM",
            "BLACK_PLATE",
            "MATTE",
            "Material",
            "Scene",
            "Solid",
            "WALL",
            "panel",
        ),
        "perceptron_emu.scene_file": (
            "SceneFile",
            "Surroundings",
            "read_scene",
            "read_surroundings",
        ),
        "perceptron_emu.solids": (
            "hidden_by_solid",
            "profile_strip",
        ),
        "perceptron_emu.truth": (
            "RenderedFrame",
            "RenderedTruth",
            "SheetCurve",
            "StringTruth",
        ),
    },
)
