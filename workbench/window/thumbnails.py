"""Small pictures for the strip and the contact sheet: the brightest pixel of each block, brightened.

Spots are lifted over their surroundings, and the surroundings keep their own brightness: a white image is white.
"""

from __future__ import annotations

import cv2
import numpy as np

from extraction import Profile
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


def profile_thumbnail(profile: Profile) -> bytes:
    """A PNG of a profile's points on black, y and z to one scale."""
    size = np.array([WIDTH_PX, WIDTH_PX * 4 // 5])
    canvas = np.zeros((size[1], size[0]), np.uint8)
    yz = profile.yz_mm[np.isfinite(profile.yz_mm).all(axis=1)]
    if len(yz):
        low, span = yz.min(axis=0), np.maximum(np.ptp(yz, axis=0), 1e-6)
        scale = float(np.min(0.9 * size / span))
        at = np.rint((yz - low - span / 2) * scale + size / 2).astype(int)
        canvas[np.clip(at[:, 1], 0, size[1] - 1), np.clip(at[:, 0], 0, size[0] - 1)] = 255
        canvas = cv2.dilate(canvas, np.ones((2, 2), np.uint8))
    return cv2.imencode(".png", canvas)[1].tobytes()
