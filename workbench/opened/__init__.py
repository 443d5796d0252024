"""Images opened to tune detection on: pictures, names, truth, and the ranges of the parameters that are tuned."""

from workbench.opened.image_set import NO_CHAIN, ImageInfo, ImageRequest, ImageSet, open_images
from workbench.opened.labeller import Labeller
from workbench.opened.parameters import panel
from workbench.opened.pictures import Pictures, Stamp
from workbench.opened.profile_files import Content, ProfileRecords

__all__ = [
    "NO_CHAIN",
    "Content",
    "ImageInfo",
    "ImageRequest",
    "ImageSet",
    "Labeller",
    "Pictures",
    "ProfileRecords",
    "Stamp",
    "open_images",
    "panel",
]
