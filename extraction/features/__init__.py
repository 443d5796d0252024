"""What of a profile lies on a target: arcs, straight stretches, corners and wedges, found by RANSAC."""

from extraction.features.consensus import local_scatter
from extraction.features.find import FEATURE_KINDS, find_target_points
from extraction.features.points import TargetPoints
from extraction.features.shapes import Circle, Line
from extraction.features.strings import string_points

__all__ = ["FEATURE_KINDS", "Circle", "Line", "TargetPoints", "find_target_points", "local_scatter", "string_points"]
