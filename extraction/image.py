"""The image that extraction takes: grey levels of the sensor's size and depth."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Sensor

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
