"""Image files by writers of their own (struct, zlib, OpenCV), not by the reader's counterpart."""

from __future__ import annotations

import struct
import zlib

import cv2
import numpy as np

from geometry import Camera, Pose, Sensor, Sheet

W, H = 37, 23  # rows of packed levels do not end on whole bytes


def sensor_of(bit_depth: int, channel: str | None = None) -> Sensor:
    """A sensor of the images' size."""
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


def levels_of(bits: int, top: float = 1.0) -> np.ndarray:
    """Random levels up to a share of the highest."""
    levels = np.random.default_rng(bits).integers(0, int(2**bits * top), (H, W))
    return levels.astype(np.uint8 if bits == 8 else np.uint16)


def packed_rows(levels: np.ndarray, bits: int) -> bytes:
    """Levels bit by bit, each row up to a whole byte."""
    rows = []
    for row in levels:
        text = "".join(f"{int(v):0{bits}b}" for v in row)
        text += "0" * (-len(text) % 8)
        rows.append(bytes(int(text[i : i + 8], 2) for i in range(0, len(text), 8)))
    return b"".join(rows)


def tiff(pixels: bytes, bits: int, order: str = "<", pages: int = 1, **tags: int) -> bytes:
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


def png_with(levels: np.ndarray, *chunks: tuple[bytes, bytes]) -> bytes:
    """OpenCV's PNG with chunks put behind the header."""
    data = cv2.imencode(".png", levels)[1].tobytes()
    more = b"".join(
        struct.pack(">I", len(body)) + name + body + struct.pack(">I", zlib.crc32(name + body)) for name, body in chunks
    )
    return data[:33] + more + data[33:]
