"""The part of the image that is looked at, as a mask of pixels."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.config import RegionConfig

Mask = NDArray[np.bool_]

_SHIFT = 4  # binary digits of a pixel that OpenCV's polygons are drawn to


def region_mask(region: RegionConfig, shape: tuple[int, ...]) -> Mask | None:
    """The pixels of an image that a region lets through.

    Parameters
    ----------
    region
        Polygons that are looked at, and polygons that are not.
    shape
        Of the image, (H, W).

    Returns
    -------
    mask
        True where a pixel may be used (H, W), pixels on a border included; None where all may.
    """
    if not region.keep and not region.leave_out:
        return None
    import cv2  # a tenth of a second, and most recipes draw no region

    mask = np.full(shape[:2], 0 if region.keep else 1, np.uint8)
    for polygons, value in ((region.keep, 1), (region.leave_out, 0)):
        for polygon in polygons:
            points = np.rint(np.array(polygon) * 2**_SHIFT).astype(np.int32)
            cv2.fillPoly(mask, [points], value, shift=_SHIFT)
    return mask.view(np.bool_)
