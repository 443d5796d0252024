"""Overlays of stripes in real images, as docs/real_images.md shows them; green: a point; blue: one with a flag;
orange: an ambiguous one.

Run: python benchmarks/docs_real_images.py FOLDER [folder for the overlays]; FOLDER holds the recordings that
docs/real_images.md names, as etna, ciclop and floor_blocks.
"""

from __future__ import annotations

import sys
from pathlib import Path

import cv2
import numpy as np

from extraction import StripePeaks, detect_stripe, flag_names

REPOSITORY = Path(__file__).parents[1]
GREEN, ORANGE, BLUE = (0, 255, 0), (0, 165, 255), (255, 120, 0)
BUST, PATTERN = "ciclop/3.1. Laser segmentation", "ciclop/3.2. Laser segmentation in pattern"
FLOOR = "floor_blocks/Red Lasers (Plane)/test"


def overlay(image: np.ndarray, peaks: StripePeaks, width_px: int) -> np.ndarray:
    """The points on the dimmed image, scaled to a width."""
    scale = width_px / image.shape[1]
    out = cv2.resize((0.75 * image).astype(np.uint8), None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    out = cv2.cvtColor(out, cv2.COLOR_GRAY2BGR) if out.ndim == 2 else out
    for (u, v), flag in zip(scale * (peaks.uv_px + 0.5) - 0.5, peaks.flag, strict=True):
        centre = (round(float(u) * 16), round(float(v) * 16))
        doubt = ORANGE if "ambiguous" in flag_names(int(flag)) else BLUE
        cv2.circle(out, centre, 14, doubt if flag else GREEN, -1, cv2.LINE_AA, 4)
    return out


def red(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Colour image and its red channel."""
    image = cv2.imread(str(path))
    return image, np.ascontiguousarray(image[:, :, 2])


def difference(real: Path, folder: str, on: str, off: str) -> tuple[np.ndarray, StripePeaks]:
    """Laser-on frame and its stripe against the laser-off frame."""
    image, lit = red(real / folder / on)
    return image, detect_stripe(lit, laser_off=red(real / folder / off)[1])


def main() -> None:
    """Write the overlays and print how many points each has."""
    if len(sys.argv) < 2:
        sys.exit("name the folder of real images")
    real = Path(sys.argv[1])
    target = Path(sys.argv[2]) if len(sys.argv) > 2 else REPOSITORY / "docs/pictures"
    if not real.is_dir():
        sys.exit(f"{real} is not there: name the folder of real images")
    board = cv2.imread(str(real / "etna/data/frame0005.png"), cv2.IMREAD_GRAYSCALE)
    rough = cv2.imread(str(real / "etna/data/calib2/frame0009.png"), cv2.IMREAD_GRAYSCALE)
    floor, floor_red = red(sorted((real / FLOOR).glob("*.jpg"))[7])
    pattern = ("laser-0-255-255-8.png", "laser-background-0-255-255-8.png")
    pictures = {
        "real_etna": (board, detect_stripe(board), 560),
        "real_etna_calib2": (rough, detect_stripe(rough), 560),
        "real_ciclop": (*difference(real, BUST, "laser.png", "laser_background.png"), 420),
        "real_ciclop_pattern": (*difference(real, PATTERN, *pattern), 420),
        "real_floor": (floor, detect_stripe(floor_red), 560),
    }
    for name, (image, peaks, width) in pictures.items():
        path = target / f"{name}.jpg"
        cv2.imwrite(str(path), overlay(image, peaks, width), [cv2.IMWRITE_JPEG_QUALITY, 80])
        flagged = int(np.sum(peaks.flag > 0))
        print(f"{path.name}: {len(peaks)} points, {flagged} flagged, {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
