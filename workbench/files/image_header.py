"""What an image file says of itself before anything is decoded: a bounded reading of PNG, TIFF, BMP and JPEG."""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

from geometry import InputError

PNG, BMP, JPEG = b"\x89PNG\r\n\x1a\n", b"BM", b"\xff\xd8"
_APP1, _EXIF = 0xE1, b"Exif\0\0"  # of a JPEG: the segment that holds a camera's tags, and how it begins
TIFF, BIG_TIFF = (b"II*\x00", b"MM\x00*"), (b"II+\x00", b"MM\x00+")
MAX_TAGS = 4096  # of a directory; cameras write some twenty
MAX_STRIPS = 2**20
LOSSLESS = {1: "none", 5: "LZW", 8: "deflate", 32946: "deflate", 32773: "PackBits"}
LOSSY = {6: "JPEG", 7: "JPEG", 34712: "JPEG 2000", 34933: "PNG or JPEG XR", 50001: "WebP", 34892: "lossy JPEG"}
_SIZES = {1: 1, 2: 1, 3: 2, 4: 4, 5: 8, 6: 1, 7: 1, 8: 2, 9: 4, 10: 8, 11: 4, 12: 8, 13: 4}
_CODES = {3: "H", 4: "I", 8: "h", 9: "i", 13: "I"}
_SUBFILE, _WIDTH, _HEIGHT, _BITS, _COMPRESSION, _PHOTOMETRIC, _FILL = 254, 256, 257, 258, 259, 262, 266
_STARTS, _ORIENTATION, _SAMPLES, _ROWS, _COUNTS, _PREDICTOR, _FORMAT = 273, 274, 277, 278, 279, 317, 339
_TILE_STARTS, _TILE_COUNTS = 324, 325


@dataclass(frozen=True)
class ImageHeader:
    """The header of an image file.

    significant_bits: of a sample, where the file says how many of the container's hold light. orientation: 1 is as
    stored. strips: of a TIFF of packed bits, where its rows lie. deflated: a TIFF's pieces that end in a checksum.
    patches: bytes of the file that make a decoder give the pixels as they are stored, with what to put there.
    """

    kind: Literal["PNG", "TIFF", "BMP", "JPEG"]
    width: int
    height: int
    bits: int
    channels: int = 1
    significant_bits: int | None = None
    orientation: int = 1
    white_is_zero: bool = False
    compression: int = 1
    strips: tuple[tuple[int, int], ...] = ()
    deflated: tuple[tuple[int, int], ...] = ()
    rows_per_strip: int = 0
    patches: tuple[tuple[int, bytes], ...] = field(default=(), repr=False)


def read_header(path: Path, data: bytes, *, lossy: bool) -> ImageHeader:
    """The header of a PNG, TIFF or BMP, with ``lossy`` of a JPEG too; InputError names what can not be read right."""
    if data.startswith(PNG):
        return _png(path, data)
    if data.startswith(TIFF):
        return _tiff(path, data)
    if data.startswith(BMP):
        return _bmp(path, data)
    if data.startswith(JPEG) and lossy:
        return _jpeg(path, data)
    kind = "neither PNG nor TIFF nor BMP"
    if data.startswith(JPEG):
        kind = "a JPEG, whose compression moves spots"
    elif data.startswith(BIG_TIFF):
        kind = "a BigTIFF, which no image of a sensor needs"
    raise InputError(f"{path}: is {kind}; images must be PNG, TIFF or BMP")


def _png(path: Path, data: bytes) -> ImageHeader:
    """Walks the chunks: OpenCV decodes a cut or damaged PNG to a partly grey picture without a word."""
    position, ended, heads = len(PNG), False, 0
    significant, orientation = None, 1
    while not ended:
        head = data[position : position + 8]
        length = struct.unpack(">I", head[:4])[0] if len(head) == 8 else len(data)
        body = data[position + 4 : position + 8 + length]
        check = data[position + 8 + length : position + 12 + length]
        if len(check) < 4:
            raise InputError(f"{path}: the PNG is cut short")
        if zlib.crc32(body) != struct.unpack(">I", check)[0]:
            raise InputError(f"{path}: the PNG is damaged (checksum of a chunk)")
        position, name = position + 12 + length, head[4:]
        ended, heads = name == b"IEND", heads + (name == b"IHDR")
        if name == b"acTL":
            raise InputError(f"{path}: is an animated PNG; one image a file is right")
        if name == b"sBIT" and length:
            significant = max(body[4:])
        if name == b"eXIf":
            orientation = _exif_orientation(body[4:])
    if data[12:16] != b"IHDR" or len(data) < 33 or heads != 1:
        raise InputError(f"{path}: the PNG has no header, or several")
    width, height, bits, colour = struct.unpack(">IIBB", data[16:26])
    if bits < 8:
        raise InputError(f"{path}: has {bits} bit{'s' * (bits > 1)} a pixel; 8 or 16 are read")
    channels = {0: 1, 2: 3, 3: 3, 4: 1, 6: 3}.get(colour, 1)
    return ImageHeader("PNG", width, height, bits, channels, significant, orientation)


def _exif_orientation(body: bytes) -> int:
    try:
        return _Directory(body, "the eXIf chunk").value(_ORIENTATION, 1) if body.startswith(TIFF) else 1
    except InputError:
        return 1


class _Directory:
    """A directory of a TIFF: its tags, and the offset of the next one."""

    def __init__(self, data: bytes, where: object, offset: int | None = None) -> None:
        """At ``offset``, else where the file's first bytes say."""
        self._data, self._where = data, where
        self._order = "<" if data[:2] == b"II" else ">"
        self._places: dict[int, tuple[int, int, int]] = {}
        offset = self._unpack("I", 4) if offset is None else offset
        count = self._unpack("H", offset)
        if not 1 <= count <= MAX_TAGS:
            raise self._damaged()
        for i in range(count):
            at = offset + 2 + 12 * i
            tag, kind, n = self._unpack("H", at), self._unpack("H", at + 2), self._unpack("I", at + 4)
            if tag in self._places:
                raise InputError(f"{where}: the TIFF is damaged, its tag {tag} stands there twice")
            inline = n * _SIZES.get(kind, 1) <= 4
            self._places[tag] = kind, n, at + 8 if inline else self._unpack("I", at + 8)
        self.next = self._unpack("I", offset + 2 + 12 * count)

    def _unpack(self, code: str, at: int) -> int:
        try:
            return int(struct.unpack_from(self._order + code, self._data, at)[0])
        except struct.error:
            raise self._damaged() from None

    def _damaged(self) -> InputError:
        return InputError(f"{self._where}: the TIFF is damaged or cut short")

    def values(self, tag: int) -> tuple[int, ...]:
        """The whole numbers of a tag; none where it is absent."""
        if tag not in self._places:
            return ()
        kind, count, at = self._places[tag]
        if kind not in _CODES or count > MAX_STRIPS:
            raise self._damaged()
        try:
            return struct.unpack_from(f"{self._order}{count}{_CODES[kind]}", self._data, at)
        except struct.error:
            raise self._damaged() from None

    def value(self, tag: int, default: int | None = None) -> int:
        """A tag's first number."""
        found = self.values(tag)
        if not found and default is None:
            raise self._damaged()
        return found[0] if found else int(default or 0)

    def patch(self, tag: int, value: int) -> tuple[tuple[int, bytes], ...]:
        """The bytes to change that make the tag ``value``; none where it is absent."""
        if tag not in self._places:
            return ()
        kind, _, at = self._places[tag]
        return ((at, struct.pack(self._order + _CODES[kind], value)),)


def _tiff(path: Path, data: bytes) -> ImageHeader:
    """Only what is sure to come out as stored passes; its strips or tiles must lie inside the file."""
    tags = _Directory(data, path)
    _check_pages(path, data, tags)
    compression, photometric = tags.value(_COMPRESSION, 1), tags.value(_PHOTOMETRIC, 1)
    if compression not in LOSSLESS:
        kind = LOSSY.get(compression)
        why = f"with {kind}, which moves spots" if kind else f"in a way that is not read (number {compression})"
        raise InputError(f"{path}: the TIFF is compressed {why}; none, LZW, deflate and PackBits are right")
    if photometric not in (0, 1, 2, 3):
        kind = {32803: "a raw mosaic of colours", 34892: "a raw image", 6: "in YCbCr"}.get(photometric, "no grey image")
        raise InputError(
            f"{path}: the TIFF is {kind} (photometric interpretation {photometric}); grey levels are needed"
        )
    bits, forms = tags.values(_BITS) or (1,), tags.values(_FORMAT) or (1,)
    if len(set(bits)) > 1 or bits[0] not in (8, 10, 12, 14, 16):
        raise InputError(f"{path}: has {bits[0]} bits a pixel; 8, 10, 12, 14 or 16 are read")
    if any(form not in (1, 2) for form in forms):
        kind = "floating point" if 3 in forms else "complex or undefined"
        raise InputError(f"{path}: its grey levels are {kind} numbers; whole numbers are needed")
    if tags.value(_FILL, 1) != 1:
        raise InputError(f"{path}: the TIFF fills its bytes from the lowest bit (FillOrder 2), which is not read")
    starts = tags.values(_STARTS) or tags.values(_TILE_STARTS)
    counts = tags.values(_COUNTS) or tags.values(_TILE_COUNTS)
    if not starts or len(starts) != len(counts) or max(map(sum, zip(starts, counts, strict=True))) > len(data):
        raise InputError(f"{path}: the TIFF is damaged or cut short")
    header = ImageHeader(
        "TIFF",
        tags.value(_WIDTH),
        tags.value(_HEIGHT),
        bits[0],
        tags.value(_SAMPLES, 1),
        orientation=tags.value(_ORIENTATION, 1),
        white_is_zero=photometric == 0,
        compression=compression,
        rows_per_strip=tags.value(_ROWS, 2**32 - 1),
        deflated=tuple(zip(starts, counts, strict=True)) if LOSSLESS[compression] == "deflate" else (),
        patches=(*tags.patch(_ORIENTATION, 1), *(tags.patch(_PHOTOMETRIC, 1) if photometric == 0 else ())),
    )
    if header.bits in (8, 16):
        return header
    if tags.value(_PREDICTOR, 1) != 1 or header.compression not in (1, 8, 32946) or tags.values(_TILE_STARTS):
        raise InputError(
            f"{path}: {header.bits} bits a pixel are packed in tiles or compressed in a way that is not read; "
            "none and deflate are"
        )
    return replace(header, strips=tuple(zip(starts, counts, strict=True)))


def _check_pages(path: Path, data: bytes, first: _Directory) -> None:
    """One page; thumbnails and masks, which say that they are, do not count."""
    if first.value(_SUBFILE, 0) & 5:
        raise InputError(f"{path}: the first page of the TIFF is a thumbnail or a mask")
    page, seen = first, 0
    while page.next:
        seen += 1
        if seen > 64:
            raise InputError(f"{path}: the TIFF holds more than 64 pages; one image a file is right")
        page = _Directory(data, path, page.next)
        if not page.value(_SUBFILE, 0) & 5:
            raise InputError(f"{path}: the TIFF holds several pages; one image a file is right")


def _bmp(path: Path, data: bytes) -> ImageHeader:
    try:
        start, size = struct.unpack_from("<II", data, 10)
        if size == 12:
            width, height, _, bits = struct.unpack_from("<HHHH", data, 18)
            compression = 0
        else:
            width, height, _, bits, compression = struct.unpack_from("<iiHHI", data, 18)
    except struct.error:
        raise InputError(f"{path}: the BMP is cut short") from None
    if compression not in (0, 1, 3):
        raise InputError(f"{path}: the BMP is compressed in a way that is not read (number {compression})")
    if bits not in (8, 24, 32):
        raise InputError(f"{path}: the BMP has {bits} bits a pixel; 8, 24 or 32 are read")
    height = abs(height)
    if compression != 1 and start + (width * bits + 31) // 32 * 4 * height > len(data):
        raise InputError(f"{path}: the BMP is cut short")
    return ImageHeader("BMP", width, height, 8, 1 if bits == 8 else 3)


def _jpeg(path: Path, data: bytes) -> ImageHeader:
    at, orientation = 2, 1
    while at + 9 < len(data) and data[at] == 0xFF:
        marker, length = data[at + 1], struct.unpack_from(">H", data, at + 2)[0]
        if marker == 0xFF:
            at += 1
        elif 0xC0 <= marker <= 0xCF and marker not in (0xC4, 0xC8, 0xCC):
            bits, height, width, channels = struct.unpack_from(">BHHB", data, at + 4)
            if data.rstrip(b"\x00\r\n")[-2:] != b"\xff\xd9":
                raise InputError(f"{path}: the JPEG is cut short")
            return ImageHeader("JPEG", width, height, bits, channels, orientation=orientation)
        else:
            body = data[at + 4 : at + 2 + length]
            if marker == _APP1 and body.startswith(_EXIF):
                orientation = _exif_orientation(body[len(_EXIF) :])
            at += 2 + length
    raise InputError(f"{path}: the JPEG is damaged or cut short")
