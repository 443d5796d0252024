"""Pictures of what was detected: the brightened image with spots and labels, and each string magnified."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from geometry import Frame, Sensor
from workbench.files import Image, write_png

Colour = tuple[int, int, int]  # blue, green, red, as OpenCV draws
Picture = NDArray[Any]  # uint8 (H, W) or (H, W, 3); OpenCV's own types say no more

LABELLED: Colour = (90, 230, 90)
FLAGGED: Colour = (60, 190, 255)
UNLABELLED: Colour = (200, 130, 110)
ELLIPSE: Colour = (255, 120, 255)
ELLIPSE_95 = 2.4477  # radius of the 95 % ellipse of a plane normal distribution in σ
ZOOM, TILE = 10, 190  # the magnified tiles: pixels a pixel, side
GAMMA = 0.5  # lifts spots of a twentieth of the range to a fifth
SHIFT = 4  # OpenCV draws at 1 / 2^SHIFT px


def overlay(image: Image, sensor: Sensor, frame: Frame) -> Picture:
    """The picture (H, W + tiles, 3) of one frame; tiles show the labelled spots magnified with their 95 % ellipses."""
    grey = brighten(image, sensor)
    picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    taken = {int(spot): i for i, spot in enumerate(frame.axis.spot) if spot >= 0}
    for spot in range(len(frame.points)):
        _draw_spot(picture, frame, spot, taken.get(spot))
    write(picture, (12, 30), _title(frame), (240, 240, 240), 0.7)
    return np.hstack([picture, _tiles(grey, frame, taken)])


def save_overlays(folder: Path, image: Image, sensor: Sensor, frame: Frame) -> Path:
    """Write one frame's overlay and return its path."""
    path = folder / f"{frame.number:03d}.png"
    write_png(path, overlay(image, sensor, frame), compression=3)
    return path


def brighten(image: NDArray[Any], sensor: Sensor) -> Picture:
    """8 bits with dark levels lifted, so that dim spots can be seen."""
    dark = float(np.median(image[::4, ::4]))
    level = (image.astype(np.float32) - dark) / max(sensor.require_camera().saturation_dn - dark, 1.0)
    return np.asarray(255 * np.clip(level, 0, 1) ** GAMMA).astype(np.uint8)


def _title(frame: Frame) -> str:
    text = f"frame {frame.number}  {frame.image}  {len(frame.axis)} labelled of {len(frame.points)} spots"
    return text + (f"  ({frame.reason})" if frame.reason else "")


def _draw_spot(picture: Picture, frame: Frame, spot: int, axis: int | None) -> None:
    points = frame.points
    flag = points.flag[spot]
    if axis is not None and axis < len(frame.axis.flag):
        flag = frame.axis.flag[axis] or flag
    colour = UNLABELLED if axis is None else FLAGGED if flag else LABELLED
    u, v = points.uv_px[spot]
    if not np.isfinite([u, v]).all():
        return
    size = np.maximum(3 * points.sigma_px[spot], 5) if np.isfinite(points.sigma_px[spot]).all() else np.array([8, 8])
    angle = float(np.rad2deg(points.axis_rad[spot])) if np.isfinite(points.axis_rad[spot]) else 0.0
    _ellipse(picture, (u, v), size + 4, angle, colour)
    name = (frame.axis.label[axis] if axis is not None else "") + (f" {flag}" if flag else "")
    write(picture, (int(u) + 12, int(v) - 10), name.strip(), colour, 0.6)


def _tiles(grey: Picture, frame: Frame, taken: dict[int, int]) -> Picture:
    """A column of magnified spots in the order of the labels."""
    column = np.full((grey.shape[0], TILE, 3), 24, np.uint8)
    for place, (spot, axis) in enumerate(sorted(taken.items(), key=lambda item: item[1])):
        top = place * (TILE + 4)
        if top + TILE > grey.shape[0]:
            break
        column[top : top + TILE] = _tile(grey, frame, spot, axis)
    return column


def _tile(grey: Picture, frame: Frame, spot: int, axis: int) -> Picture:
    u, v = frame.points.uv_px[spot]
    # pixel p of the picture lies at ZOOM · (p - centre) + (TILE - 1) / 2 of the tile
    offset = (TILE - 1) / 2
    matrix = np.array([[ZOOM, 0, offset - ZOOM * u], [0, ZOOM, offset - ZOOM * v]])
    tile = cv2.warpAffine(grey, matrix, (TILE, TILE), flags=cv2.INTER_NEAREST)
    picture = cv2.cvtColor(tile, cv2.COLOR_GRAY2BGR)
    values, vectors = np.linalg.eigh(frame.points.cov_uv_px2[spot])
    radii = ELLIPSE_95 * np.sqrt(np.maximum(values, 0)) * ZOOM
    angle = float(np.rad2deg(np.arctan2(vectors[1, 1], vectors[0, 1])))
    _ellipse(picture, (offset, offset), np.maximum(radii[::-1], 0.5), angle, ELLIPSE)
    write(picture, (6, 20), frame.axis.label[axis], LABELLED, 0.6)
    return np.asarray(picture, dtype=np.uint8)


def _ellipse(
    picture: Picture, centre: tuple[float, float], radii: NDArray[np.float64], angle: float, colour: Colour
) -> None:
    scale = 2**SHIFT
    point = (round(centre[0] * scale), round(centre[1] * scale))
    axes = (round(float(radii[0]) * scale), round(float(radii[1]) * scale))
    cv2.ellipse(picture, point, axes, angle, 0, 360, colour, 1, cv2.LINE_AA, SHIFT)


def mark(picture: Picture, centre: tuple[float, float], radius: float, colour: Colour) -> None:
    """Draw a circle at a pixel position."""
    _ellipse(picture, centre, np.array([radius, radius]), 0.0, colour)


def write(picture: Picture, place: tuple[int, int], text: str, colour: Colour, size: float) -> None:
    """Write text with a dark rim; what is not ASCII shows as ?."""
    ascii_text = text.encode("ascii", "replace").decode()
    cv2.putText(picture, ascii_text, place, cv2.FONT_HERSHEY_SIMPLEX, size, (0, 0, 0), 3, cv2.LINE_AA)
    cv2.putText(picture, ascii_text, place, cv2.FONT_HERSHEY_SIMPLEX, size, colour, 1, cv2.LINE_AA)
