"""The string jig: lines, anchors, tolerances; solids as meshes; drawings, STL and GLB."""

from jig_cad.files import jig_from_table, jig_text, read_jig, write_jig
from jig_cad.jig import (
    ANCHORS,
    DEFAULT_STRINGS,
    STRINGS,
    Jig,
    half_turn_label,
    nominal_anchors,
    sample_tolerance,
)

__all__ = [
    "ANCHORS",
    "DEFAULT_STRINGS",
    "STRINGS",
    "Jig",
    "half_turn_label",
    "jig_from_table",
    "jig_text",
    "nominal_anchors",
    "read_jig",
    "sample_tolerance",
    "write_jig",
]
