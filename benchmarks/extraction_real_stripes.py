"""A real stripe on a flat board is straight after undistortion: residuals of our points beside those of others.

Frames of openlmd/etna (BSD): a checkerboard, 7 × 6 inner corners of 10 mm, and a laser stripe in each, mostly clipped.
The camera is calibrated from the boards of a set by OpenCV; each method's points are undistorted and a line is fitted
to those within 3 px of a robust line. "rms" is the perpendicular residual, "short" that between neighbouring sections
(second differences), which no bent board and no lens model can cause.
Run: python benchmarks/extraction_real_stripes.py [folder of etna]   (RIDGE_PYTHON=… names one with ridge-detector)
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2
import numpy as np

from extraction import StripeConfig, detect_stripe

CORNERS, SQUARE_MM, NEAR_PX = (7, 6), 10.0, 3.0


def calibrate(images: list[np.ndarray]) -> tuple[np.ndarray, np.ndarray, float]:
    """Camera matrix, distortion (k1 k2 p1 p2) and reprojection rms [px] from the boards that are found."""
    board = np.zeros((CORNERS[0] * CORNERS[1], 3), np.float32)
    board[:, :2] = SQUARE_MM * np.mgrid[: CORNERS[0], : CORNERS[1]].T.reshape(-1, 2)
    corners = []
    for image in images:
        dimmed = np.minimum(image, 80)  # the clipped stripe would set the detector's threshold
        ok, seen = cv2.findChessboardCorners(dimmed, CORNERS)
        if ok:
            stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 50, 1e-4)
            corners.append(cv2.cornerSubPix(dimmed, seen, (7, 7), (-1, -1), stop))
    size = images[0].shape[::-1]
    flags = cv2.CALIB_FIX_K3 | cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST
    rms, K, k, _, _ = cv2.calibrateCamera([board] * len(corners), corners, size, None, None, flags=flags)
    return K, k, rms


def ours(image: np.ndarray) -> np.ndarray:
    """The product along rows, the most continuous chain, told that the stripe is up to 25 px wide."""
    wide = StripeConfig(direction="rows")
    return detect_stripe(image, wide).uv_px


def row_maximum(image: np.ndarray) -> np.ndarray:
    """The brightest pixel of each row of the blurred image."""
    blurred = cv2.GaussianBlur(image, (5, 5), 1.3)
    u = np.argmax(blurred, axis=1)
    keep = blurred[np.arange(len(u)), u] > 100
    return np.column_stack([u, np.arange(len(u))])[keep].astype(float)


def centre_of_mass(image: np.ndarray) -> np.ndarray:
    """Centre of mass of each row, 15 px around its maximum."""
    points = row_maximum(image)
    v = points[:, 1].astype(int)
    columns = np.clip(points[:, 0].astype(int)[:, None] + np.arange(-15, 16), 0, image.shape[1] - 1)
    grey = image[v[:, None], columns].astype(float)
    weight = np.maximum(grey - np.median(grey[:, [0, 1, -2, -1]], axis=1)[:, None], 0)
    return np.column_stack([np.sum(weight * columns, 1) / np.sum(weight, 1), v])


RIDGE = """
import sys, numpy as np
from ridge_detector import RidgeDetector
d = RidgeDetector(line_widths=[8, 12, 16], low_contrast=40, high_contrast=100, min_len=100, dark_line=False)
d.detect_lines(np.load(sys.argv[1]))
np.save(sys.argv[2], np.concatenate([np.column_stack([c.col, c.row]) for c in d.contours] or [np.zeros((0, 2))]))
"""


def ridge_detector(image: np.ndarray) -> np.ndarray | None:
    """Ridge-detector's points, in an environment of its own; None where that is not given."""
    python = os.environ.get("RIDGE_PYTHON")
    if not python:
        return None
    with tempfile.TemporaryDirectory() as folder:
        source, result = Path(folder, "in.npy"), Path(folder, "out.npy")
        np.save(source, image)
        subprocess.run([python, "-c", RIDGE, source, result], check=True, capture_output=True)  # noqa: S603
        return np.load(result)


def straightness(points: np.ndarray, K: np.ndarray, k: np.ndarray) -> tuple[float, float, int]:
    """Perpendicular rms, short-range rms [px] and number of the points near their line."""
    flat = cv2.undistortPoints(points[:, None].astype(float), K, k, P=K)[:, 0]
    flat = flat[np.argsort(flat[:, 1], kind="stable")]
    slope = np.polyfit(flat[:, 1], flat[:, 0], 1)
    for _ in range(20):
        off = flat[:, 0] - np.polyval(slope, flat[:, 1])
        near = np.abs(off - np.median(off)) < max(NEAR_PX, 2 * float(np.median(np.abs(off - np.median(off)))))
        slope = np.polyfit(flat[near, 1], flat[near, 0], 1)
    off = (flat[:, 0] - np.polyval(slope, flat[:, 1])) / np.hypot(1, slope[0])
    off = off[np.abs(off) < NEAR_PX]
    short = np.diff(off, 2) / np.sqrt(6)
    return float(np.sqrt(np.mean(off**2))), float(np.sqrt(np.mean(short**2))), len(off)


def main() -> None:
    """Print a table per set of frames."""
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "etna")
    if not folder.is_dir():
        sys.exit(f"{folder} is not there: name the folder of etna")
    methods = {
        "perceptron-emu": ours,
        "row maximum (OpenCV)": row_maximum,
        "centre of mass": centre_of_mass,
        "ridge-detector": ridge_detector,
    }
    for name in ("data", "data/calib2"):
        files = sorted((folder / name).glob("frame*.png"))
        images = [cv2.imread(str(file), cv2.IMREAD_GRAYSCALE) for file in files]
        K, k, rms = calibrate(images)
        print(f"\n{name}: {len(files)} frames, f = {K[0, 0]:.0f} px, k1 = {k.ravel()[0]:.3f}, boards to {rms:.2f} px")
        for label, method in methods.items():
            few = images[:2] if method is ridge_detector else images  # it takes half a minute a frame
            found = [points for image in few if (points := method(image)) is not None and len(points) > 50]
            if not found:
                continue
            table = np.array([straightness(points, K, k) for points in found])
            rms_px, short_px, count = np.median(table, axis=0)
            spread = f"rms {rms_px:.3f} px (worst {table[:, 0].max():.3f})   short {short_px:.3f} px"
            print(f"  {label:22s} {spread}   {count:.0f} points, {len(found)} frames")


if __name__ == "__main__":
    main()
