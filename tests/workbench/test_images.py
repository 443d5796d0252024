"""Images as cameras and tools write them: the levels come out as they were, or a sentence names what is in the way.

The files are made by writers of their own (struct, zlib, OpenCV), not by the reader's counterpart. What every camera
maker writes is not proven.
"""

from __future__ import annotations

import struct
import zlib
from contextlib import suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

from geometry import Camera, InputError, Pose, Sensor, Sheet
from workbench.files import read_image, sensor_of_picture

W, H = 37, 23  # rows of packed levels do not end on whole bytes


def _sensor(bit_depth: int, channel: str | None = None) -> Sensor:
    camera = Camera(
        width_px=W,
        height_px=H,
        fx_px=100.0,
        fy_px=100.0,
        cx_px=18.0,
        cy_px=11.0,
        T_sensor_camera=Pose(np.array([[0, -0.8, -0.6], [1, 0, 0], [0, -0.6, 0.8]]), np.array([120.0, 0.0, 0.0])),
        bit_depth=bit_depth,
        channel=channel,
    )
    return Sensor(Sheet(np.zeros(3), 0.8), camera)


def _levels(bits: int, top: float = 1.0) -> np.ndarray:
    levels = np.random.default_rng(bits).integers(0, int(2**bits * top), (H, W))
    return levels.astype(np.uint8 if bits == 8 else np.uint16)


def _packed(levels: np.ndarray, bits: int) -> bytes:
    rows = []
    for row in levels:
        text = "".join(f"{int(v):0{bits}b}" for v in row)
        text += "0" * (-len(text) % 8)
        rows.append(bytes(int(text[i : i + 8], 2) for i in range(0, len(text), 8)))
    return b"".join(rows)


def _tiff(pixels: bytes, bits: int, order: str = "<", pages: int = 1, **tags: int) -> bytes:
    """A TIFF of one strip a page; ``t274=3`` sets a tag, further ``t256b`` adds a second one."""
    known = {256: W, 257: H, 258: bits, 259: 1, 262: 1, 273: 8, 277: 1, 278: H, 279: len(pixels)}
    known.update({int(k[1:]): v for k, v in tags.items() if not k.endswith("b")})
    entries = sorted([*known.items(), *((int(k[1:-1]), v) for k, v in tags.items() if k.endswith("b"))])
    out = (b"II*\0" if order == "<" else b"MM\0*") + struct.pack(order + "I", 8 + len(pixels)) + pixels
    for page in range(pages):
        out += struct.pack(order + "H", len(entries))
        for tag, value in entries:
            long = tag in (273, 278, 279)
            body = struct.pack(order + "I", value) if long else struct.pack(order + "HH", value, 0)
            out += struct.pack(order + "HHI", tag, 4 if long else 3, 1) + body
        after = len(out) + 4
        out += struct.pack(order + "I", after if page + 1 < pages else 0)
    return out


def _png(levels: np.ndarray, *chunks: tuple[bytes, bytes]) -> bytes:
    """OpenCV's PNG with chunks put behind the header."""
    data = cv2.imencode(".png", levels)[1].tobytes()
    more = b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in chunks
    )
    return data[:33] + more + data[33:]


def _read(tmp_path: Path, data: bytes, sensor: Sensor, name: str = "a.tif") -> tuple[np.ndarray, list[str]]:
    path = tmp_path / name
    path.write_bytes(data)
    said: list[str] = []
    return read_image(path, sensor, said.append), said


@pytest.mark.parametrize("order", ["<", ">"])
@pytest.mark.parametrize("bits", [10, 12, 14])
@pytest.mark.parametrize("compression", [1, 8])
@pytest.mark.parametrize("top", [0.05, 1.0])
def test_packed_levels_come_out_as_they_are(
    tmp_path: Path, order: str, bits: int, compression: int, top: float
) -> None:
    levels = _levels(bits, top)
    raw = _packed(levels, bits)
    data = _tiff(zlib.compress(raw) if compression == 8 else raw, bits, order, t259=compression)
    image, said = _read(tmp_path, data, _sensor(bits))
    np.testing.assert_array_equal(image, levels)
    assert not said


@pytest.mark.parametrize("orientation", range(2, 9))
def test_pixels_stay_as_they_are_stored(tmp_path: Path, orientation: int) -> None:
    levels = _levels(8)
    image, said = _read(tmp_path, _tiff(levels.tobytes(), 8, t274=orientation), _sensor(8))
    np.testing.assert_array_equal(image, levels)
    assert f"({orientation})" in said[0]
    exif = b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, orientation, 0, 0)
    image, said = _read(tmp_path, _png(levels, (b"eXIf", exif)), _sensor(8), "a.png")
    np.testing.assert_array_equal(image, levels)
    assert f"({orientation})" in said[0]


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_a_turned_jpeg_is_taken_as_it_is_stored(tmp_path: Path, orientation: int) -> None:
    ramp = np.tile(np.linspace(0, 250, 48), (32, 1)).astype(np.uint8)
    ramp[:8] = 255
    plain = cv2.imencode(".jpg", ramp)[1].tobytes()
    exif = b"Exif\0\0II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, orientation, 0, 0)
    path = tmp_path / "a.jpg"
    path.write_bytes(plain[:2] + struct.pack(">HH", 0xFFE1, len(exif) + 2) + exif + plain[2:])
    said: list[str] = []
    image = read_image(path, sensor_of_picture(path), said.append, lossy=True)
    assert np.abs(image.astype(int) - ramp).max() < 20
    turned = [s for s in said if "to be turned" in s]
    assert len(turned) == (orientation != 1)
    assert all("as they are stored" in s and f"({orientation})" in s for s in turned)


@pytest.mark.parametrize(("bits", "top", "depth"), [(8, 255, 8), (16, 65535, 16), (16, 65535, 12), (16, 4095, 12)])
def test_white_is_zero(tmp_path: Path, bits: int, top: int, depth: int) -> None:
    """From the container's highest level or the camera's, whichever the levels fit."""
    levels = _levels(depth)
    stored = (top - levels.astype(int)).astype(levels.dtype)
    image, _ = _read(tmp_path, _tiff(stored.tobytes(), bits, t262=0), _sensor(depth))
    np.testing.assert_array_equal(image, levels)


def test_white_is_zero_packed(tmp_path: Path) -> None:
    levels = _levels(12)
    image, _ = _read(tmp_path, _tiff(_packed(4095 - levels, 12), 12, t262=0), _sensor(12))
    np.testing.assert_array_equal(image, levels)


def test_signed_levels_from_zero_on(tmp_path: Path) -> None:
    levels = _levels(12)
    image, _ = _read(tmp_path, _tiff(levels.tobytes(), 16, t339=2), _sensor(12))
    np.testing.assert_array_equal(image, levels)
    with pytest.raises(InputError, match="below 0"):
        _read(tmp_path, _tiff((levels.astype(np.int16) - 500).tobytes(), 16, t339=2), _sensor(12))


@pytest.mark.parametrize("top", [0.05, 1.0])
@pytest.mark.parametrize("fill", ["zeros", "repeated"])
def test_left_aligned_png_with_sbit(tmp_path: Path, top: float, fill: str) -> None:
    levels = _levels(12, top)
    stored = (levels << 4) | (levels >> 8 if fill == "repeated" else 0)
    image, said = _read(tmp_path, _png(stored.astype(np.uint16), (b"sBIT", b"\x0c")), _sensor(12), "a.png")
    np.testing.assert_array_equal(image, levels)
    assert "12 bits" in said[0]


def test_sbit_of_a_right_aligned_png(tmp_path: Path) -> None:
    levels = _levels(12)
    image, said = _read(tmp_path, _png(levels, (b"sBIT", b"\x0c")), _sensor(12), "a.png")
    np.testing.assert_array_equal(image, levels)
    assert not said


def test_left_aligned_without_a_word(tmp_path: Path) -> None:
    """Bright levels lie above the bit depth, dim ones have empty low bits; a mask is taken."""
    bright = _levels(12)
    with pytest.raises(InputError, match="above the 4095"):
        _read(tmp_path, _tiff((bright << 4).tobytes(), 16), _sensor(12))
    with pytest.raises(InputError, match="lowest 4 bits"):
        _read(tmp_path, _tiff((_levels(12, 0.05) << 4).tobytes(), 16), _sensor(12))
    mask = (bright > 2000).astype(np.uint16) * 4080
    np.testing.assert_array_equal(_read(tmp_path, _tiff(mask.tobytes(), 16), _sensor(12))[0], mask)


def test_channels(tmp_path: Path) -> None:
    colour = np.random.default_rng(1).integers(0, 256, (H, W, 3), dtype=np.uint8)
    data = _png(colour)
    for channel, wanted in (("blue", colour[..., 0]), ("green", colour[..., 1]), ("red", colour[..., 2])):
        np.testing.assert_array_equal(_read(tmp_path, data, _sensor(8, channel), "a.png")[0], wanted)
    image, said = _read(tmp_path, data, _sensor(8), "a.png")
    np.testing.assert_array_equal(image, colour.max(axis=2))
    assert "colour" in said[0]
    grey, said = _read(tmp_path, _png(np.repeat(colour[..., :1], 3, axis=2)), _sensor(8, "red"), "a.png")
    np.testing.assert_array_equal(grey, colour[..., 0])
    assert not said


def test_bmp_and_jpeg(tmp_path: Path) -> None:
    levels = _levels(8)
    bmp = cv2.imencode(".bmp", levels)[1].tobytes()
    np.testing.assert_array_equal(_read(tmp_path, bmp, _sensor(8), "a.bmp")[0], levels)
    with pytest.raises(InputError, match="cut short"):
        _read(tmp_path, bmp[:-40], _sensor(8), "a.bmp")
    jpeg = cv2.imencode(".jpg", levels)[1].tobytes()
    with pytest.raises(InputError, match="JPEG"):
        _read(tmp_path, jpeg, _sensor(8), "a.jpg")
    said: list[str] = []
    assert read_image(tmp_path / "a.jpg", _sensor(8), said.append, lossy=True).shape == (H, W)
    assert "JPEG" in said[0]
    (tmp_path / "a.jpg").write_bytes(jpeg[:-9])
    with pytest.raises(InputError, match="cut short"):
        read_image(tmp_path / "a.jpg", _sensor(8), lossy=True)


FLAT = _levels(8).tobytes()
BAD = {
    "several pages": (_tiff(FLAT, 8, pages=2), "several pages"),
    "a width twice": (_tiff(FLAT, 8, t256b=W + 1), "twice"),
    "JPEG inside": (_tiff(FLAT, 8, t259=7), "JPEG"),
    "unknown compression": (_tiff(FLAT, 8, t259=4), "number 4"),
    "lowest bit first": (_tiff(FLAT, 8, t266=2), "FillOrder"),
    "floating point": (_tiff(FLAT * 4, 32, t339=3), "32 bits"),
    "a mosaic": (_tiff(FLAT, 8, t262=32803), "mosaic"),
    "a strip beyond": (_tiff(FLAT, 8, t279=len(FLAT) + 999), "cut short"),
    "packed and cut": (_tiff(_packed(_levels(12), 12)[:-30], 12), "cut short"),
    "packed and damaged": (_tiff(b"no zlib at all", 12, t259=8), "damaged"),
    "packed by LZW": (_tiff(FLAT, 12, t259=5), "packed"),
    "another size": (_tiff(FLAT, 8, t257=H - 1, t278=H - 1), f"{W} × {H - 1}"),
    "animated": (_png(_levels(8), (b"acTL", b"\0" * 8)), "animated"),
    "BigTIFF": (b"II+\0" + b"\0" * 60, "BigTIFF"),
    "no tags": (b"II*\0\x08\0\0\0\0\0", "damaged"),
    "text": (b"frame,image", "neither"),
}


@pytest.mark.parametrize("case", BAD)
def test_one_sentence_by_name(tmp_path: Path, case: str) -> None:
    data, words = BAD[case]
    path = tmp_path / "a.tif"
    path.write_bytes(data)
    for depth in (8, 12):
        with pytest.raises(InputError) as error:
            read_image(path, _sensor(depth))
        assert str(path) in str(error.value)
        assert words in str(error.value) or depth == 12


def test_a_thumbnail_behind_the_image_is_no_second_page(tmp_path: Path) -> None:
    data = bytearray(_tiff(FLAT, 8, pages=2, t254=0))
    second = data.rfind(struct.pack("<HHI", 254, 3, 1))
    data[second + 8] = 1
    np.testing.assert_array_equal(_read(tmp_path, bytes(data), _sensor(8))[0], _levels(8))


def test_no_bytes_end_in_anything_but_a_sentence(tmp_path: Path) -> None:
    """Seeded damage of every kind of file; the benchmark of bad files does it by the hundred thousand."""
    rng = np.random.default_rng(5)
    seeds = [_tiff(FLAT, 8), _tiff(_packed(_levels(12), 12), 12), _png(_levels(8)), _tiff(FLAT, 8, pages=2)]
    seeds += [cv2.imencode(".bmp", _levels(8))[1].tobytes(), cv2.imencode(".jpg", _levels(8))[1].tobytes()]
    path = tmp_path / "a.img"
    for data in seeds:
        for _ in range(60):
            broken = bytearray(data)
            for at in rng.integers(0, min(len(data), 300), 3):
                broken[at] = rng.integers(256)
            path.write_bytes(bytes(broken[: rng.integers(1, len(data) + 1)]) if rng.random() < 0.3 else bytes(broken))
            with suppress(InputError):
                assert read_image(path, _sensor(8), lossy=True).shape == (H, W)
