"""Targets whose points lie on surfaces: many points condensed to few, and starts without anything known beforehand."""

from calib.surface.condense import Condensed, condensed
from calib.surface.starts import SurfaceStart, surface_start

__all__ = ["Condensed", "SurfaceStart", "condensed", "surface_start"]
