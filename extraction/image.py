"""The image that extraction takes: grey levels of the sensor's size and depth."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Sensor
from geometry.compiled import kernel

Image = NDArray[np.uint8] | NDArray[np.uint16]

MAX_PIXELS = 2**26  # 8192 × 8192, beyond any sensor's: a small file may claim to unpack to more


def grey_levels(image: object) -> Image:
    """The image as an array (H, W) of uint8 or uint16; InputError says what it is instead."""
    if not isinstance(image, np.ndarray):
        raise InputError(f"the image is {type(image).__name__}, not an array of grey levels (rows, columns)")
    if image.ndim == 3 and image.shape[2] == 1:
        image = image[:, :, 0]
    if image.ndim != 2:
        raise InputError(f"the image has shape {image.shape}: grey levels (rows, columns) are needed, not colour")
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"the image holds {image.dtype}: grey levels must be uint8 or uint16")
    if image.size > MAX_PIXELS:
        raise InputError(f"the image has {image.size} pixels: at most {MAX_PIXELS} can be handled")
    return image


def check_image(image: object, sensor: Sensor) -> Image:
    """The image as grey levels of the sensor's size and depth; InputError says what does not fit."""
    camera, image = sensor.require_camera(), grey_levels(image)
    height, width = image.shape
    if (width, height) != (camera.width_px, camera.height_px):
        hint = ", it is turned by 90°" if (height, width) == (camera.width_px, camera.height_px) else ""
        raise InputError(
            f"the image is {width} × {height} px but [image] of the sensor says "
            f"{camera.width_px} × {camera.height_px} px{hint}"
        )
    if image.dtype == np.uint8 and camera.bit_depth > 8:
        raise InputError(f"the image has 8 bits but [image] bit_depth of the sensor is {camera.bit_depth}")
    if image.dtype == np.uint16 and int(image.max()) > camera.full_scale_dn:
        raise InputError(
            f"the image holds grey level {int(image.max())}, above the {camera.full_scale_dn} of "
            f"[image] bit_depth = {camera.bit_depth}"
        )
    return image


_PLATEAU = 4.0  # times the levels below, that the highest level must be met to be a clipping level
_TOP, _LEVELS = 0.8, 12  # of the highest level, and how many of the levels in use, that are looked at
_FEWEST_CLIPPED = 24  # pixels that make a plateau
_NEIGHBOURS = 0.5  # of them, that have another of the same level beside them: noise has no plateaus


def clipping_level(image: NDArray[Any], stated: float | None = None) -> float:
    """The grey level from which pixels are clipped.

    Parameters
    ----------
    image
        Grey levels (H, W), uint8 or uint16.
    stated
        What the camera is said to clip at; the type's largest where None.

    Returns
    -------
    level
        The stated one, or a lower one where the image itself shows a plateau at its highest levels: cameras clip at
        235, 200 or 4080 as well as at full scale. Half a level below it, so that rounding leaves no gap.
    """
    level = float(np.iinfo(image.dtype).max if stated is None else stated)
    if image.size == 0:
        return level
    top = int(image.max())
    if top >= level:
        return level
    if np.count_nonzero(image == top) < _FEWEST_CLIPPED:
        return level
    used, count = np.unique(image[image >= _TOP * top], return_counts=True)
    used, count = used[::-1][:_LEVELS].astype(float), count[::-1][:_LEVELS].astype(float)
    plateau = 0  # lower levels that belong to it: a noisy plateau takes its neighbours with it
    while plateau < min(3, len(used) - 2) and count[plateau + 1] > 0.2 * count[0]:
        plateau += 1
    own = float(count[: plateau + 1].sum())
    below = float(count[plateau + 1 :].mean()) if len(count) > plateau + 1 else 0.0
    if own < _FEWEST_CLIPPED or own / (plateau + 1) < _PLATEAU * max(below, 1.0):
        return level
    lowest = float(used[plateau])
    return lowest - 0.5 if _touching(image, int(lowest)) >= _NEIGHBOURS else level


@kernel
def _touching(image: NDArray[np.generic], level: int) -> float:
    """Of the pixels from that level up, the share with neighbours that are too: two along one axis, one along the
    other.

    A peak's top is a line of equal pixels at most; a plateau is broad.
    """
    rows, columns = image.shape
    n, near = 0, 0
    for r in range(rows):
        for c in range(columns):
            if int(image[r, c]) >= level:
                n += 1
                left = c > 0 and int(image[r, c - 1]) >= level
                right = c < columns - 1 and int(image[r, c + 1]) >= level
                above = r > 0 and int(image[r - 1, c]) >= level
                below = r < rows - 1 and int(image[r + 1, c]) >= level
                near += (left and right and (above or below)) or (above and below and (left or right))
    return near / n if n else 0.0
