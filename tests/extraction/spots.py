"""What the tests of spot extraction share: a sensor, and frames of true spots."""

from __future__ import annotations

import cv2
import numpy as np

from extraction.spots import TrueSpot, mean_image
from geometry import Camera, Pose, Sensor, Sheet

CAMERA_ROTATION = np.array([[0, -0.924016832, -0.382351793], [1, 0, 0], [0, -0.382351793, 0.924016832]])


def make_sensor(width: int = 640, height: int = 512, **more: object) -> Sensor:
    """A sensor that looks at the sheet from 120 mm beside the emitter."""
    u, _, vt = np.linalg.svd(CAMERA_ROTATION)
    values: dict[str, object] = {
        "width_px": width, "height_px": height, "fx_px": 2300.0, "fy_px": 2300.0, "cx_px": (width - 1) / 2,
        "cy_px": (height - 1) / 2, "T_sensor_camera": Pose(u @ vt, np.array([120.0, 0, 0])),
    }  # fmt: skip
    return Sensor(Sheet(), Camera(**(values | more)))  # type: ignore[arg-type]


def mean_frame(spots: list[TrueSpot], width: int = 640, height: int = 512, background: float = 10.0) -> np.ndarray:
    """Noise-free frame (height, width) of spots given in whole-image coordinates, `electrons` read as grey levels."""
    mean = np.full((height, width), background)
    for s in spots:
        i, j = round(s.u_px), round(s.v_px)
        half = 20
        left, top = max(0, i - half), max(0, j - half)
        right, bottom = min(width, i + half + 1), min(height, j + half + 1)
        local = TrueSpot(s.u_px - left, s.v_px - top, s.electrons, s.along_px, s.across_px, s.axis_rad)
        mean[top:bottom, left:right] += mean_image(local, (bottom - top, right - left))
    return mean


def camera(
    mean: np.ndarray, rng: np.random.Generator, gain: float = 0.025, read: float = 0.5, bits: int = 8
) -> np.ndarray:
    """Shot and read noise, quantised."""
    noisy = rng.poisson(np.maximum(mean, 0) / gain) * gain + rng.normal(0, read, mean.shape)
    return noisy.round().clip(0, 2**bits - 1).astype(np.uint8 if bits == 8 else np.uint16)


def some_spots(rng: np.random.Generator, count: int = 8, width: int = 640, height: int = 512) -> list[TrueSpot]:
    """Spots as strings give them, apart from one another."""
    spots: list[TrueSpot] = []
    while len(spots) < count:
        u, v = rng.uniform([30, 30], [width - 30, height - 30])
        if all(np.hypot(s.u_px - u, s.v_px - v) > 45 for s in spots):
            spots.append(
                TrueSpot(
                    u, v, rng.uniform(350, 2000), rng.uniform(1.3, 2.6), rng.uniform(0.75, 1.0), rng.uniform(-1.5, 1.5)
                )
            )
    return spots


def dot_grid(side: int, pitch_px: float, rng: np.random.Generator, size: int = 512) -> tuple[np.ndarray, np.ndarray]:
    """A noisy image (size, size) of side × side blurred discs drawn by OpenCV, and their centres (side², 2)."""
    fine, bits = 4, 8
    first = (size - 1 - (side - 1) * pitch_px) / 2
    centres = first + pitch_px * np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    centres += rng.uniform(-0.5, 0.5, centres.shape)
    canvas = np.zeros((size * fine, size * fine), np.uint8)
    for at in np.rint((centres * fine + (fine - 1) / 2) * 2**bits).astype(int):
        cv2.circle(canvas, at.tolist(), fine * 2**bits, 255, cv2.FILLED, cv2.LINE_AA, bits)
    light = cv2.resize(canvas.astype(np.float32), (size, size), interpolation=cv2.INTER_AREA)
    light = cv2.GaussianBlur(light, (0, 0), 1.2)
    return rng.normal(10.0 + 120.0 / light.max() * light, 1.0).round().clip(0, 255).astype(np.uint8), centres
