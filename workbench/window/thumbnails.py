"""Small pictures for the strip and the contact sheet: the brightest pixel of each block, brightened.

Spots are lifted over their surroundings, and the surroundings keep their own brightness: a white image is white.
"""

from __future__ import annotations

import cv2
import numpy as np

from workbench.files import Image

WIDTH_PX = 240  # twice the strip's, for fine screens


def thumbnail(image: Image, full_scale_dn: float) -> bytes:
    """A PNG at most WIDTH_PX wide; block maxima, so that spots of a few pixels are not averaged away."""
    step = max(1, -(-image.shape[1] // WIDTH_PX))
    grown = cv2.dilate(image, np.ones((step, step), np.uint8), anchor=(0, 0))
    small = grown[::step, ::step].astype(np.float32)
    floor, top = float(np.median(small)), float(small.max())
    ground = np.clip(np.minimum(small, floor) / max(full_scale_dn, 1.0), 0, 1)
    bright = ground + (1 - ground) * np.sqrt(np.clip((small - floor) / max(top - floor, 1.0), 0, 1))
    return cv2.imencode(".png", np.rint(bright * 255).astype(np.uint8))[1].tobytes()
