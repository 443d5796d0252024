"""The lens: where points of the sheet fall in the image, how much light it gathers and how sharply it draws."""

from perceptron_emu.lens.optics import (
    Gather,
    defocus_radius_px,
    field_sigma_px,
    filter_transmission,
    focal_length_mm,
    focus_distance_mm,
    gather,
    gathered,
    principal_distance_mm,
    pupil_points_mm,
    sharp_sigma_px,
    working_f_number,
)
from perceptron_emu.lens.projection import lens, project, tilt_rotation, to_camera

__all__ = [
    "Gather",
    "defocus_radius_px",
    "field_sigma_px",
    "filter_transmission",
    "focal_length_mm",
    "focus_distance_mm",
    "gather",
    "gathered",
    "lens",
    "principal_distance_mm",
    "project",
    "pupil_points_mm",
    "sharp_sigma_px",
    "tilt_rotation",
    "to_camera",
    "working_f_number",
]
