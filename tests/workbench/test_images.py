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

from geometry import InputError, Sensor
from tests.workbench.image_files import H, W, levels_of, packed_rows, png_with, sensor_of, tiff
from workbench.files import read_image, sensor_of_picture


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
    levels = levels_of(bits, top)
    raw = packed_rows(levels, bits)
    data = tiff(zlib.compress(raw) if compression == 8 else raw, bits, order, t259=compression)
    image, said = _read(tmp_path, data, sensor_of(bits))
    np.testing.assert_array_equal(image, levels)
    assert not said


@pytest.mark.parametrize("orientation", range(2, 9))
def test_pixels_stay_as_they_are_stored(tmp_path: Path, orientation: int) -> None:
    levels = levels_of(8)
    image, said = _read(tmp_path, tiff(levels.tobytes(), 8, t274=orientation), sensor_of(8))
    np.testing.assert_array_equal(image, levels)
    assert f"({orientation})" in said[0]
    exif = b"II*\0" + struct.pack("<IHHHIHHI", 8, 1, 274, 3, 1, orientation, 0, 0)
    image, said = _read(tmp_path, png_with(levels, (b"eXIf", exif)), sensor_of(8), "a.png")
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
    levels = levels_of(depth)
    stored = (top - levels.astype(int)).astype(levels.dtype)
    image, _ = _read(tmp_path, tiff(stored.tobytes(), bits, t262=0), sensor_of(depth))
    np.testing.assert_array_equal(image, levels)


def test_white_is_zero_packed(tmp_path: Path) -> None:
    levels = levels_of(12)
    image, _ = _read(tmp_path, tiff(packed_rows(4095 - levels, 12), 12, t262=0), sensor_of(12))
    np.testing.assert_array_equal(image, levels)


def test_signed_levels_from_zero_on(tmp_path: Path) -> None:
    levels = levels_of(12)
    image, _ = _read(tmp_path, tiff(levels.tobytes(), 16, t339=2), sensor_of(12))
    np.testing.assert_array_equal(image, levels)
    with pytest.raises(InputError, match="below 0"):
        _read(tmp_path, tiff((levels.astype(np.int16) - 500).tobytes(), 16, t339=2), sensor_of(12))


@pytest.mark.parametrize("top", [0.05, 1.0])
@pytest.mark.parametrize("fill", ["zeros", "repeated"])
def test_left_aligned_png_with_sbit(tmp_path: Path, top: float, fill: str) -> None:
    levels = levels_of(12, top)
    stored = (levels << 4) | (levels >> 8 if fill == "repeated" else 0)
    image, said = _read(tmp_path, png_with(stored.astype(np.uint16), (b"sBIT", b"\x0c")), sensor_of(12), "a.png")
    np.testing.assert_array_equal(image, levels)
    assert "12 bits" in said[0]


def test_sbit_of_a_right_aligned_png(tmp_path: Path) -> None:
    levels = levels_of(12)
    image, said = _read(tmp_path, png_with(levels, (b"sBIT", b"\x0c")), sensor_of(12), "a.png")
    np.testing.assert_array_equal(image, levels)
    assert not said


def test_left_aligned_without_a_word(tmp_path: Path) -> None:
    """Bright levels lie above the bit depth, dim ones have empty low bits; a mask is taken."""
    bright = levels_of(12)
    with pytest.raises(InputError, match="above the 4095"):
        _read(tmp_path, tiff((bright << 4).tobytes(), 16), sensor_of(12))
    with pytest.raises(InputError, match="lowest 4 bits"):
        _read(tmp_path, tiff((levels_of(12, 0.05) << 4).tobytes(), 16), sensor_of(12))
    mask = (bright > 2000).astype(np.uint16) * 4080
    np.testing.assert_array_equal(_read(tmp_path, tiff(mask.tobytes(), 16), sensor_of(12))[0], mask)


def test_channels(tmp_path: Path) -> None:
    colour = np.random.default_rng(1).integers(0, 256, (H, W, 3), dtype=np.uint8)
    data = png_with(colour)
    for channel, wanted in (("blue", colour[..., 0]), ("green", colour[..., 1]), ("red", colour[..., 2])):
        np.testing.assert_array_equal(_read(tmp_path, data, sensor_of(8, channel), "a.png")[0], wanted)
    image, said = _read(tmp_path, data, sensor_of(8), "a.png")
    np.testing.assert_array_equal(image, colour.max(axis=2))
    assert "colour" in said[0]
    grey, said = _read(tmp_path, png_with(np.repeat(colour[..., :1], 3, axis=2)), sensor_of(8, "red"), "a.png")
    np.testing.assert_array_equal(grey, colour[..., 0])
    assert not said


def test_bmp_and_jpeg(tmp_path: Path) -> None:
    levels = levels_of(8)
    bmp = cv2.imencode(".bmp", levels)[1].tobytes()
    np.testing.assert_array_equal(_read(tmp_path, bmp, sensor_of(8), "a.bmp")[0], levels)
    with pytest.raises(InputError, match="cut short"):
        _read(tmp_path, bmp[:-40], sensor_of(8), "a.bmp")
    jpeg = cv2.imencode(".jpg", levels)[1].tobytes()
    with pytest.raises(InputError, match="JPEG"):
        _read(tmp_path, jpeg, sensor_of(8), "a.jpg")
    said: list[str] = []
    assert read_image(tmp_path / "a.jpg", sensor_of(8), said.append, lossy=True).shape == (H, W)
    assert "JPEG" in said[0]
    (tmp_path / "a.jpg").write_bytes(jpeg[:-9])
    with pytest.raises(InputError, match="cut short"):
        read_image(tmp_path / "a.jpg", sensor_of(8), lossy=True)


def test_no_flipped_bit_of_a_deflated_tiff_passes(tmp_path: Path) -> None:
    """Each piece ends in a checksum, which OpenCV logs and passes over."""
    levels = levels_of(8) // 64
    data = cv2.imencode(".tif", levels, [cv2.IMWRITE_TIFF_COMPRESSION, 8])[1].tobytes()
    for at in range(8, 8 + 300, 7):
        spoilt = bytearray(data)
        spoilt[at] ^= 0x10
        with suppress(InputError):
            np.testing.assert_array_equal(_read(tmp_path, bytes(spoilt), sensor_of(8))[0], levels)
    np.testing.assert_array_equal(_read(tmp_path, data, sensor_of(8))[0], levels)


FLAT = levels_of(8).tobytes()
BAD = {
    "several pages": (tiff(FLAT, 8, pages=2), "several pages"),
    "a width twice": (tiff(FLAT, 8, t256b=W + 1), "twice"),
    "JPEG inside": (tiff(FLAT, 8, t259=7), "JPEG"),
    "unknown compression": (tiff(FLAT, 8, t259=4), "number 4"),
    "lowest bit first": (tiff(FLAT, 8, t266=2), "FillOrder"),
    "floating point": (tiff(FLAT * 4, 32, t339=3), "32 bits"),
    "a mosaic": (tiff(FLAT, 8, t262=32803), "mosaic"),
    "a strip beyond": (tiff(FLAT, 8, t279=len(FLAT) + 999), "cut short"),
    "packed and cut": (tiff(packed_rows(levels_of(12), 12)[:-30], 12), "cut short"),
    "packed and damaged": (tiff(b"no zlib at all", 12, t259=8), "damaged"),
    "packed by LZW": (tiff(FLAT, 12, t259=5), "packed"),
    "another size": (tiff(FLAT, 8, t257=H - 1, t278=H - 1), f"{W} × {H - 1}"),
    "animated": (png_with(levels_of(8), (b"acTL", b"\0" * 8)), "animated"),
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
            read_image(path, sensor_of(depth))
        assert str(path) in str(error.value)
        assert words in str(error.value) or depth == 12


def test_a_thumbnail_behind_the_image_is_no_second_page(tmp_path: Path) -> None:
    data = bytearray(tiff(FLAT, 8, pages=2, t254=0))
    second = data.rfind(struct.pack("<HHI", 254, 3, 1))
    data[second + 8] = 1
    np.testing.assert_array_equal(_read(tmp_path, bytes(data), sensor_of(8))[0], levels_of(8))


def test_no_bytes_end_in_anything_but_a_sentence(tmp_path: Path) -> None:
    """Seeded damage of every kind of file; the benchmark of bad files does it by the hundred thousand."""
    rng = np.random.default_rng(5)
    seeds = [tiff(FLAT, 8), tiff(packed_rows(levels_of(12), 12), 12), png_with(levels_of(8)), tiff(FLAT, 8, pages=2)]
    seeds += [cv2.imencode(".bmp", levels_of(8))[1].tobytes(), cv2.imencode(".jpg", levels_of(8))[1].tobytes()]
    path = tmp_path / "a.img"
    for data in seeds:
        for _ in range(60):
            broken = bytearray(data)
            for at in rng.integers(0, min(len(data), 300), 3):
                broken[at] = rng.integers(256)
            path.write_bytes(bytes(broken[: rng.integers(1, len(data) + 1)]) if rng.random() < 0.3 else bytes(broken))
            with suppress(InputError):
                assert read_image(path, sensor_of(8), lossy=True).shape == (H, W)
