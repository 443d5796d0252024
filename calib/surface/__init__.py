"""Targets whose points lie on surfaces: many points condensed to few, and starts without anything known beforehand."""

from calib.surface.begin import Begun, begin_on_surfaces
from calib.surface.condense import Condensed, condensed
from calib.surface.describe import described, own_centres, section_depths

__all__ = ["Begun", "Condensed", "begin_on_surfaces", "condensed", "described", "own_centres", "section_depths"]
