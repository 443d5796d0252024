"""Stripe images on disk: read with every way checked in which one can be broken or wrong, written losslessly."""

from __future__ import annotations

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction import MAX_PIXELS
from geometry import InputError, Sensor
from workbench.files.atomic import write_bytes

Image = NDArray[np.uint8] | NDArray[np.uint16]

MAX_FILE_BYTES = 512 * 2**20  # four bytes for each of MAX_PIXELS, and as much again
PNG, TIFF = b"\x89PNG\r\n\x1a\n", (b"II*\x00", b"MM\x00*")
SUFFIXES = (".png", ".tif", ".tiff")


def read_image(path: Path, sensor: Sensor) -> Image:
    """A grey image (H, W), uint8 or uint16, that fits ``sensor``.

    Parameters
    ----------
    path
        A PNG or TIFF.
    sensor
        Whose size and bit depth the image must have; colour images pass where their channels are equal.

    Returns
    -------
    Image
        Grey levels, right-aligned.

    Raises
    ------
    InputError
        Where the file is missing, damaged, cut short or of another kind than the sensor's.

    """
    camera = sensor.require_camera()
    data = _read_file(path)
    width, height = _size(path, data)
    if width * height > MAX_PIXELS:
        raise InputError(f"{path}: {width} × {height} px is larger than the {MAX_PIXELS // 2**20} Mpx that are read")
    if (width, height) != (camera.width_px, camera.height_px):
        raise InputError(
            f"{path}: is {width} × {height} px, the sensor's image is {camera.width_px} × {camera.height_px} px"
        )
    image = _decode(path, data)
    return _check_levels(path, image, sensor)


def _read_file(path: Path) -> bytes:
    try:
        if path.stat().st_size > MAX_FILE_BYTES:
            raise InputError(f"{path}: is larger than {MAX_FILE_BYTES // 2**20} MB")
        data = path.read_bytes()
    except FileNotFoundError:
        raise InputError(f"{path}: no such image file") from None
    except (OSError, ValueError) as error:
        raise InputError(f"{path}: can not be read ({getattr(error, 'strerror', None) or error})") from None
    if not data:
        raise InputError(f"{path}: the image file is empty (0 bytes)")
    return data


def _size(path: Path, data: bytes) -> tuple[int, int]:
    """Width and height by the file's own header, before anything is decoded."""
    if data.startswith(PNG):
        return _png_size(path, data)
    if data.startswith(TIFF):
        return _tiff_size(path, data)
    kind = "a JPEG, whose compression moves spots" if data.startswith(b"\xff\xd8") else "neither PNG nor TIFF"
    raise InputError(f"{path}: is {kind}; images must be PNG or TIFF")


def _png_size(path: Path, data: bytes) -> tuple[int, int]:
    """Walks the chunks: OpenCV decodes a cut or damaged PNG to a partly grey picture without a word."""
    position, ended = len(PNG), False
    while not ended:
        head = data[position : position + 8]
        length = struct.unpack(">I", head[:4])[0] if len(head) == 8 else len(data)
        body = data[position + 4 : position + 8 + length]
        check = data[position + 8 + length : position + 12 + length]
        if len(check) < 4:
            raise InputError(f"{path}: the PNG is cut short")
        if zlib.crc32(body) != struct.unpack(">I", check)[0]:
            raise InputError(f"{path}: the PNG is damaged (checksum of a chunk)")
        position, ended = position + 12 + length, head[4:] == b"IEND"
    if data[12:16] != b"IHDR" or len(data) < 24:
        raise InputError(f"{path}: the PNG has no header")
    width, height = struct.unpack(">II", data[16:24])
    return int(width), int(height)


def _tiff_size(path: Path, data: bytes) -> tuple[int, int]:
    """Reads the first directory; its strips or tiles must lie inside the file."""
    order = "<" if data[:2] == b"II" else ">"
    try:
        offset = struct.unpack(order + "I", data[4:8])[0]
        count = struct.unpack(order + "H", data[offset : offset + 2])[0]
        tags = dict(_tiff_tag(order, data, offset + 2 + 12 * i) for i in range(count))
        width, height = tags[256][0], tags[257][0]
        starts, sizes = tags.get(273) or tags[324], tags.get(279) or tags[325]
        if max(a + b for a, b in zip(starts, sizes, strict=True)) > len(data):
            raise InputError(f"{path}: the TIFF is cut short")
    except (struct.error, KeyError, IndexError, ValueError):
        raise InputError(f"{path}: the TIFF is damaged or cut short") from None
    return int(width), int(height)


def _tiff_tag(order: str, data: bytes, at: int) -> tuple[int, tuple[int, ...]]:
    tag, kind, count = struct.unpack(order + "HHI", data[at : at + 8])
    code, size = {3: ("H", 2), 4: ("I", 4)}.get(kind, ("B", 1))
    start = at + 8 if count * size <= 4 else struct.unpack(order + "I", data[at + 8 : at + 12])[0]
    if kind not in (3, 4):
        return int(tag), ()
    return int(tag), struct.unpack(f"{order}{count}{code}", data[start : start + count * size])


def _decode(path: Path, data: bytes) -> NDArray[np.generic]:
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    if image is None:
        raise InputError(f"{path}: the image can not be decoded, the file is damaged")
    return np.asarray(image)


def _check_levels(path: Path, image: NDArray[np.generic], sensor: Sensor) -> Image:
    """Grey, of the container and within the grey levels that the sensor's bit depth says."""
    camera = sensor.require_camera()
    if image.ndim == 3:
        colour = image[..., :3]
        if image.shape[2] < 3 or np.any(colour[..., 0] != colour[..., 1]) or np.any(colour[..., 1] != colour[..., 2]):
            raise InputError(f"{path}: is a colour image; the sensor's images are grey")
        image = colour[..., 0]
    wanted = np.dtype(np.uint8 if camera.bit_depth == 8 else np.uint16)
    if image.dtype != wanted:
        raise InputError(
            f"{path}: has {image.dtype.itemsize * 8} bits a pixel, bit_depth = {camera.bit_depth} of the sensor needs "
            f"{wanted.itemsize * 8}"
        )
    highest = int(image.max())
    if highest > camera.full_scale_dn:
        raise InputError(
            f"{path}: holds the grey level {highest}, above the {camera.full_scale_dn} of "
            f"bit_depth = {camera.bit_depth}; levels must be right-aligned"
        )
    return np.ascontiguousarray(image)


def write_png(path: Path, image: Image, compression: int = 1) -> None:
    """Write an image as PNG, atomically and with the same bytes every time; colour images are in BGR order."""
    done, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, compression])
    if not done:
        raise InputError(f"{path}: the image can not be written as PNG")
    write_bytes(path, data.tobytes())
