"""Targets whose points lie on surfaces: many points condensed to few, and starts without anything known beforehand."""

from calib.surface.begin import Begun, begin_on_surfaces
from calib.surface.condense import Condensed, condensed
from calib.surface.describe import described, own_centres, section_depths
from calib.surface.diameter import contradicted_diameter, estimated_diameter, with_free_diameters
from calib.surface.views import OPEN_CONDITION, Degenerate, degenerate, general_advice

__all__ = [
    "OPEN_CONDITION",
    "Begun",
    "Condensed",
    "Degenerate",
    "begin_on_surfaces",
    "condensed",
    "contradicted_diameter",
    "degenerate",
    "described",
    "estimated_diameter",
    "general_advice",
    "own_centres",
    "section_depths",
    "with_free_diameters",
]
