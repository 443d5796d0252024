"""The string jig: lines, anchors, tolerances; solids as meshes; drawings, STL and GLB."""

from typing import TYPE_CHECKING

from geometry.lazy import lazy_names
from jig_cad.files import jig_from_table, jig_text, read_jig, write_jig
from jig_cad.flat import Edge, Plane, Wedge, frame_with_x
from jig_cad.jig import Jig, sample_tolerance
from jig_cad.measured import MeasuredTarget, measured_balls, measured_jig
from jig_cad.pillar import ANCHORS, DEFAULT_STRINGS, STRINGS, Pillar, nominal_anchors
from jig_cad.sized import SIZES, SizedJig
from jig_cad.sphere import Balls, Sphere

if TYPE_CHECKING:
    from jig_cad.drawing import drawing_dxf, drawing_svg
    from jig_cad.export import export_jig, export_target
    from jig_cad.solids import PillarDesign, jig_solids

__all__ = [
    "ANCHORS",
    "DEFAULT_STRINGS",
    "SIZES",
    "STRINGS",
    "Balls",
    "Edge",
    "Jig",
    "MeasuredTarget",
    "Pillar",
    "PillarDesign",
    "Plane",
    "SizedJig",
    "Sphere",
    "Wedge",
    "drawing_dxf",
    "drawing_svg",
    "export_jig",
    "export_target",
    "frame_with_x",
    "jig_from_table",
    "jig_solids",
    "jig_text",
    "measured_balls",
    "measured_jig",
    "nominal_anchors",
    "read_jig",
    "sample_tolerance",
    "write_jig",
]

# meshes take most of a second to import, and calibration needs none
__getattr__ = lazy_names(
    __name__,
    {
        "jig_cad.drawing": (
            "drawing_dxf",
            "drawing_svg",
        ),
        "jig_cad.export": (
            "export_jig",
            "export_target",
        ),
        "jig_cad.solids": (
            "PillarDesign",
            "jig_solids",
        ),
    },
)
