"""Which spot is which string: labels of frames and locations, and the way from the lit surface to the axis."""

from calib.label.again import relabel, settled
from calib.label.all_frames import label_alone, label_frames
from calib.label.frame import label_frame
from calib.label.refine import LabelledFrame
from calib.label.surface_offset import centroid_offsets

__all__ = [
    "LabelledFrame",
    "centroid_offsets",
    "label_alone",
    "label_frame",
    "label_frames",
    "relabel",
    "settled",
]
