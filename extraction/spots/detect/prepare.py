"""The matched blur, and the frame's own background and noise."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.config import DetectConfig
from extraction.image import Image
from extraction.noise import QUANTISATION_VARIANCE
from extraction.spots.detect.blur import Image32, blur

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PreparedImage:
    """An image ready for detection.

    image: the raw grey levels (H, W). smooth: after the matched blur (H, W) [DN]. kernel: that blur's row (K,).
    background, noise, tops: level, standard deviation and largest value of the blurred image per block (h, w) [DN].
    """

    image: Image
    smooth: Image32
    kernel: Array
    background: Image32
    noise: Image32
    tops: Image32


def prepare(image: Image, config: DetectConfig) -> PreparedImage:
    """Blur the image with the matched filter and measure background and noise block by block."""
    blurred = blur(image, config.blur_sigma_px)
    # a spot or a stripe lies in the minority of 5 × 5 blocks; the blurred quantisation error is the least noise
    background = np.asarray(cv2.medianBlur(blurred.mean, 5), dtype=np.float32)
    floor = QUANTISATION_VARIANCE * float(np.sum(blurred.kernel**2)) ** 2
    noise = np.sqrt(np.maximum(cv2.medianBlur(blurred.variance, 5), np.float32(floor)))
    return PreparedImage(image, blurred.smooth, blurred.kernel, background, np.asarray(noise, np.float32), blurred.tops)
