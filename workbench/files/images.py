"""Stripe images on disk: read with every way checked in which one can be broken or wrong, written losslessly."""

from __future__ import annotations

import zlib
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from extraction import MAX_PIXELS
from geometry import Camera, InputError, Pose, Remark, Sensor, Sheet, no_remark, read_bytes
from workbench.files.atomic import write_bytes
from workbench.files.image_header import ImageHeader, read_header

Image = NDArray[np.uint8] | NDArray[np.uint16]

MAX_FILE_BYTES = 512 * 2**20  # four bytes for each of MAX_PIXELS, and as much again
SUFFIXES = (".png", ".tif", ".tiff", ".bmp")
LOSSY_SUFFIXES = (*SUFFIXES, ".jpg", ".jpeg")
CHUNK_BYTES = 2**20
FEW_LEVELS = 4  # a picture of fewer lit levels, such as a mask, can not tell how it is aligned
_CHANNELS = {"blue": 0, "green": 1, "red": 2}  # as OpenCV orders them


def read_image(path: Path, sensor: Sensor, remark: Remark = no_remark, *, lossy: bool = False) -> Image:
    """A grey image (H, W), uint8 or uint16, its pixels in the order and its levels as the sensor's.

    Parameters
    ----------
    path
        A PNG, TIFF or BMP of the sensor's size and bit depth; of a colour image the sensor's channel.
    sensor
        A sensor with a camera.
    remark
        Told what is doubtful in the file and how it was read.
    lossy
        Whether a JPEG passes too, with a remark; not for measuring.

    Returns
    -------
    Image
        Grey levels, right-aligned. What a file says of turning is not followed: pixels stay as the chip gave them.

    Raises
    ------
    InputError
        Where the file is missing, damaged, cut short, holds several pages, is packed or compressed in a way that does
        not come out as stored, or does not fit the sensor.

    """
    camera = sensor.require_camera()
    data = read_bytes(path, MAX_FILE_BYTES, "image file")
    header = read_header(path, data, lossy=lossy)
    if header.width * header.height > MAX_PIXELS:
        raise InputError(
            f"{path}: {header.width} × {header.height} px is larger than the {MAX_PIXELS // 2**20} Mpx that are read"
        )
    _check_size(path, (header.width, header.height), camera)
    if header.kind == "JPEG":
        remark(f"{path}: is a JPEG, whose compression moves edges and spots; save PNG or TIFF for measuring")
    if header.orientation != 1:
        remark(f"{path}: says that it is to be turned ({header.orientation}); its pixels are taken as they are stored")
    image = _grey(path, _decode(path, data, header), camera, remark)
    _check_size(path, image.shape[::-1], camera)
    return _check_levels(path, image, header, camera, remark)


def sensor_of_picture(path: Path, channel: str | None = None) -> Sensor:
    """A sensor whose images are like this file, where no sensor is known.

    Parameters
    ----------
    path
        An image file.
    channel
        Of colour images; the largest where None.

    Returns
    -------
    sensor
        Its size and bits are the file's; its camera's pose and focal length stand for nothing.

    Raises
    ------
    InputError
        Where the file can not be read.
    """
    header = read_header(path, read_bytes(path, MAX_FILE_BYTES, "image file"), lossy=True)
    depth = header.significant_bits or header.bits
    camera = Camera(
        width_px=header.width,
        height_px=header.height,
        bit_depth=depth if depth in (8, 10, 12, 14, 16) else 16,
        fx_px=float(header.width),
        fy_px=float(header.width),
        cx_px=(header.width - 1) / 2,
        cy_px=(header.height - 1) / 2,
        T_sensor_camera=Pose(np.array([[0.0, 0, -1], [1, 0, 0], [0, -1, 0]]), np.array([100.0, 0, 0])),
        channel=channel,
    )
    return Sensor(Sheet(), camera)


def is_whole(path: Path) -> bool:
    """Whether a file is there and not empty, and an image not cut or damaged as far as its checksums tell."""
    try:
        data = read_bytes(path, MAX_FILE_BYTES)
        return path.suffix.lower() not in SUFFIXES or read_header(path, data, lossy=False).width > 0
    except InputError:
        return False


def _check_size(path: Path, size: tuple[int, ...], camera: Camera) -> None:
    if size != (camera.width_px, camera.height_px):
        raise InputError(
            f"{path}: is {size[0]} × {size[1]} px, the sensor's image is {camera.width_px} × {camera.height_px} px"
        )


def _decode(path: Path, data: bytes, header: ImageHeader) -> NDArray[np.generic]:
    _check_sums(path, data, header)
    if header.strips:
        return _unpacked(path, data, header)
    for at, value in header.patches:
        data = data[:at] + value + data[at + len(value) :]
    import cv2  # a tenth of a second, and profiles need none of it

    spoken = cv2.utils.logging.getLogLevel()
    cv2.utils.logging.setLogLevel(cv2.utils.logging.LOG_LEVEL_SILENT)  # the sentence below is enough
    try:
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error:
        image = None
    finally:
        cv2.utils.logging.setLogLevel(spoken)
    if image is None:
        raise InputError(f"{path}: the image can not be decoded, the file is damaged")
    if np.issubdtype(image.dtype, np.signedinteger):
        if image.min() < 0:
            raise InputError(f"{path}: holds grey levels below 0 (signed numbers); levels from 0 on are needed")
        image = image.astype(np.uint8 if image.itemsize == 1 else np.uint16)
    if image.dtype not in (np.uint8, np.uint16):
        raise InputError(f"{path}: its grey levels are {image.dtype} numbers; 8 or 16 bits are needed")
    return np.asarray(image)


def _check_sums(path: Path, data: bytes, header: ImageHeader) -> None:
    """Every deflated piece of a TIFF comes out whole; OpenCV gives what it has where a checksum is wrong."""
    room = 4 * MAX_PIXELS
    for start, count in header.deflated:
        piece, left = zlib.decompressobj(), data[start : start + count]
        try:
            while left and not piece.eof and room > 0:
                room -= len(piece.decompress(left, CHUNK_BYTES))
                left = piece.unconsumed_tail
        except zlib.error:
            raise InputError(f"{path}: the TIFF is damaged: a checksum of its pixels is wrong") from None
        if not piece.eof:
            raise InputError(f"{path}: the TIFF is damaged or cut short")


def _unpacked(path: Path, data: bytes, header: ImageHeader) -> NDArray[np.uint16]:
    """Levels of 10, 12 or 14 bits, packed without gaps within a row; OpenCV would shift them into the high bits."""
    if header.channels != 1:
        raise InputError(f"{path}: is a colour image of {header.bits} packed bits; grey levels are needed")
    row_bytes = (header.width * header.bits + 7) // 8
    rows = []
    left = header.height
    for start, count in header.strips:
        here = min(header.rows_per_strip, left)
        raw = data[start : start + count]
        if header.compression != 1:
            try:
                raw = zlib.decompressobj().decompress(raw, here * row_bytes + 1)
            except zlib.error:
                raise InputError(f"{path}: the TIFF is damaged") from None
        if here <= 0 or len(raw) < here * row_bytes:
            raise InputError(f"{path}: the TIFF is damaged or cut short")
        rows.append(np.frombuffer(raw[: here * row_bytes], np.uint8).reshape(here, row_bytes))
        left -= here
    if left:
        raise InputError(f"{path}: the TIFF is damaged or cut short")
    return _joined_bits(np.concatenate(rows), header)


def _joined_bits(rows: NDArray[np.uint8], header: ImageHeader) -> NDArray[np.uint16]:
    """Each level lies in up to three bytes that follow one another, highest bit first."""
    first = np.arange(header.width) * header.bits
    at, shift = first // 8, (24 - first % 8 - header.bits).astype(np.uint32)
    levels = np.empty((header.height, header.width), np.uint16)
    for row, raw in enumerate(rows):
        wide = np.pad(raw, (0, 2)).astype(np.uint32)
        window = wide[at] << 16 | wide[at + 1] << 8 | wide[at + 2]
        levels[row] = (window >> shift) & (2**header.bits - 1)
    return levels


def _grey(path: Path, image: NDArray[np.generic], camera: Camera, remark: Remark) -> NDArray[np.generic]:
    """The channel that the sensor's file names, else the largest of the channels; grey stays grey."""
    if image.ndim == 2:
        return image
    if image.shape[2] == 2:  # grey and alpha
        return image[..., 0]
    colour = image[..., :3]
    if np.array_equal(colour[..., 0], colour[..., 1]) and np.array_equal(colour[..., 1], colour[..., 2]):
        return colour[..., 0]
    if camera.channel in _CHANNELS:
        return colour[..., _CHANNELS[camera.channel]]
    if camera.channel == "grey":
        import cv2

        return np.asarray(cv2.cvtColor(np.ascontiguousarray(colour), cv2.COLOR_BGR2GRAY))
    if camera.channel is None:
        remark(f"{path}: is a colour image, the largest of its channels is taken; [image] channel says another")
    return np.asarray(colour.max(axis=2))


def _check_levels(path: Path, image: NDArray[np.generic], header: ImageHeader, camera: Camera, remark: Remark) -> Image:
    """Of the container and within the grey levels that the sensor's bit depth says, right-aligned."""
    wanted = np.dtype(np.uint8 if camera.bit_depth == 8 else np.uint16)
    if image.dtype != wanted:
        raise InputError(
            f"{path}: has {header.bits} bits a pixel, bit_depth = {camera.bit_depth} of the sensor needs "
            f"{wanted.itemsize * 8}"
        )
    levels = np.ascontiguousarray(image).astype(wanted, copy=False)
    if header.white_is_zero:
        levels = _inverted(path, levels, header, camera)
    if wanted == np.uint16 and header.bits == 16:
        levels = _right_aligned(path, levels, header, camera, remark)
    highest = int(levels.max())
    if highest > camera.full_scale_dn:
        raise InputError(
            f"{path}: holds the grey level {highest}, above the {camera.full_scale_dn} of "
            f"bit_depth = {camera.bit_depth}; levels must be right-aligned"
        )
    return levels


def _inverted(path: Path, levels: Image, header: ImageHeader, camera: Camera) -> Image:
    """WhiteIsZero: from the container's highest level as TIFF has it, or the camera's as cameras have it."""
    top = 2**header.bits - 1
    if int(levels.max()) <= camera.full_scale_dn < top:
        top = camera.full_scale_dn
    wide = top - levels.astype(np.int32)
    inverted: Image = wide.astype(np.uint8) if levels.dtype == np.uint8 else wide.astype(np.uint16)
    if int(inverted.max()) > camera.full_scale_dn:
        raise InputError(
            f"{path}: is WhiteIsZero, and its levels lie neither within bit_depth = {camera.bit_depth} nor at the end "
            "of the 16 bits"
        )
    return inverted


def _right_aligned(path: Path, levels: Image, header: ImageHeader, camera: Camera, remark: Remark) -> Image:
    """Industrial writers put 12 bits into the high ones of 16: PNG's sBIT tells; without it the file is refused."""
    significant = header.significant_bits or camera.bit_depth
    shift = 16 - significant
    if shift <= 0 or camera.bit_depth == 16:
        return levels
    low = 2**shift - 1
    empty = not int(np.bitwise_or.reduce(levels, axis=None)) & low
    if header.significant_bits is None:
        lit = empty and np.count_nonzero(np.bincount(levels.ravel() >> shift)[1:]) >= FEW_LEVELS
        if lit and int(levels.max()) <= camera.full_scale_dn:
            raise InputError(
                f"{path}: the lowest {shift} bits of every level are 0: the levels are left-aligned or stretched; "
                f"{significant} bits must be right-aligned"
            )
        return levels
    if empty or np.array_equal(levels & low, levels >> significant & low):
        remark(f"{path}: {significant} bits lie in the high bits of 16; they are shifted to the right by {shift}")
        return (levels >> shift).astype(np.uint16)
    return levels


def write_png(path: Path, image: Image, compression: int = 1) -> None:
    """Write an image as PNG, atomically and with the same bytes every time; colour images are in BGR order."""
    import cv2

    done, data = cv2.imencode(".png", image, [cv2.IMWRITE_PNG_COMPRESSION, compression])
    if not done:
        raise InputError(f"{path}: the image can not be written as PNG")
    write_bytes(path, data.tobytes())
