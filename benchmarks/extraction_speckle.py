"""Is the covariance by speckle true? Gaussian spots times a speckle field, without the renderer.

Frames of many oriented Gaussian spots, each times its own speckle of a round pupil (two independent patterns:
contrast 1/√2), integrated over pixels on a grid eight times finer, with shot and read noise, rounded to 8 bits.
σ/scatter along and across: with contrast and grain as learnt from the frames, and with those of the field itself, as
measured on its pixels (there without the Gaussian's own error, which these spots do not have).
Run: python benchmarks/extraction_speckle.py [frames a case, default 10]
"""

from __future__ import annotations

import sys

import cv2
import numpy as np
import scipy.fft
from numpy.typing import NDArray
from rendered_strings import along_across, budgets

from extraction import ExtractionConfig, LocaliseConfig, extract, learn_speckle
from extraction.spots import correlation
from extraction.spots.error.influence import CLASSES, DISTANCES2, REACH
from geometry import Camera, Pose, Sensor, Sheet

Array = NDArray[np.float64]

SIDE, ROWS, COLUMNS, OVER = 45, 10, 12, 8  # pixels of a spot's field, fields, samples a pixel
BLACK_DN, GAIN, READ_DN, PATTERNS = 4.0, 0.0251, 0.4, 2
# widths along and across [px], height [DN], grain λF#(1 + m) [px]
CASES = (
    (1.3, 0.9, 15, 0.5), (1.3, 0.9, 40, 0.5), (1.35, 1.05, 30, 0.5), (1.35, 1.05, 80, 0.5), (2.1, 1.3, 60, 0.5),
    (3.0, 1.0, 80, 0.5), (1.35, 1.05, 80, 0.3), (1.35, 1.05, 60, 0.8), (2.1, 1.6, 60, 0.8), (2.1, 1.6, 50, 1.2),
)  # fmt: skip


def sensor() -> Sensor:
    """A sensor of the frames' size that looks at the sheet from the side."""
    turn = np.linalg.svd(np.array([[0, -0.924, -0.382], [1, 0, 0], [0, -0.382, 0.924]]))
    pose, width, height = Pose(turn[0] @ turn[2], np.array([120.0, 0, 0])), COLUMNS * SIDE, ROWS * SIDE
    centre = (width - 1) / 2, (height - 1) / 2
    return Sensor(Sheet(), Camera(width, height, 2300.0, 2300.0, *centre, pose, black_level=BLACK_DN))


def field(count: int, grain_px: float, rng: np.random.Generator) -> Array:
    """Speckle intensity (count, S, S) of mean 1, S samples a side: noise seen through a round pupil, squared."""
    side = SIDE * OVER
    f = np.fft.fftfreq(side) * OVER
    pupil = (np.hypot(f[:, None], f) < 0.5 / grain_px).astype(np.float32)
    pupil /= np.sqrt(np.mean(pupil**2))
    total = np.zeros((count, side, side), np.float32)
    for _ in range(PATTERNS):
        noise = rng.standard_normal((2, count, side, side), np.float32) * np.float32(np.sqrt(0.5))
        amplitude = scipy.fft.ifft2(scipy.fft.fft2(noise[0] + 1j * noise[1]) * pupil)
        total += np.abs(amplitude) ** 2
    return total / PATTERNS


def law(light: Array) -> Array:
    """Covariance (CLASSES,) of the field's pixels by class of distance."""
    pixels, out = binned(light) - 1.0, np.zeros(CLASSES)
    lags = [(b, a) for b in range(REACH + 1) for a in range(REACH + 1)]
    for k, d2 in enumerate(DISTANCES2):
        same = [pixels[:, : SIDE - b, : SIDE - a] * pixels[:, b:, a:] for b, a in lags if a * a + b * b == d2]
        out[k] = np.mean([np.mean(product) for product in same])
    return out


def binned(values: Array) -> Array:
    """Means over pixels (N, SIDE, SIDE)."""
    return np.asarray(values.reshape(len(values), SIDE, OVER, SIDE, OVER).mean(axis=(2, 4)))


def frame(along: float, across: float, height: float, grain_px: float, rng: np.random.Generator):
    """Image, true centres (N, 2), directions (N,), and the law of its speckle (CLASSES,)."""
    count = ROWS * COLUMNS
    shift, angle = rng.uniform(-0.5, 0.5, (count, 2)), rng.uniform(-np.pi / 2, np.pi / 2, count)
    at = (np.arange(SIDE * OVER) + 0.5) / OVER - 0.5 - SIDE // 2
    x, y = at - shift[:, 0, None, None], at[:, None] - shift[:, 1, None, None]
    c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    light = field(count, grain_px, rng)
    spots = light * np.exp(-0.5 * (((c * x + s * y) / along) ** 2 + ((c * y - s * x) / across) ** 2)) * height
    mean = binned(spots).reshape(ROWS, COLUMNS, SIDE, SIDE).transpose(0, 2, 1, 3).reshape(ROWS * SIDE, COLUMNS * SIDE)
    noisy = rng.poisson(mean / GAIN) * GAIN + rng.normal(0, READ_DN, mean.shape) + BLACK_DN
    row, column = np.divmod(np.arange(count), COLUMNS)
    centres = np.column_stack([column, row]) * SIDE + SIDE // 2 + shift
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8), centres, angle, law(light)


def case(along: float, across: float, height: float, grain_px: float, count: int, rng: np.random.Generator) -> str:
    """One line of the table."""
    made, seen_by = [frame(along, across, height, grain_px, rng) for _ in range(count)], sensor()
    plain = ExtractionConfig(localise=LocaliseConfig(max_spots=2 * ROWS * COLUMNS))
    config, true = learn_speckle([m[0] for m in made], seen_by, plain), np.mean([m[3] for m in made], axis=0)
    rows = []
    for image, centres, angle, _ in made:
        points, (uv, about) = extract(image, seen_by, config), budgets(image, seen_by, config)
        for k in range(len(points)):
            spot = int(np.argmin(np.linalg.norm(centres - points.uv_px[k], axis=1)))
            i = int(np.argmin(np.linalg.norm(uv - points.uv_px[k], axis=1)))
            error = points.uv_px[k] - centres[spot]
            if points.flag[k] or np.linalg.norm(error) > 3 or about is None:
                continue
            turn = along_across(angle[spot])
            known = about.camera[i, :2, :2] + about.speckle[i, :2, :2] @ true
            rows.append([turn @ error, *(np.diag(turn @ c @ turn.T) for c in (points.cov_uv_px2[k], known))])
    errors, learnt, known = np.array(rows).transpose(1, 0, 2)
    ratios = [np.sqrt(v.mean(axis=0)) / errors.std(axis=0) for v in (learnt, known)]
    noise = config.noise
    return (
        f"{along:5.2f} {across:5.2f} {height:6.0f} {grain_px:6.2f} {len(rows):7d}   {np.sqrt(true[0]):.3f} "
        f"{true[1] / true[0]:.3f}   {noise.speckle_contrast:.3f} {correlation(noise.speckle_grain_px)[1]:.3f}   "
        + "   ".join(f"{a:.2f} {b:.2f}" for a, b in ratios)
    )


def main() -> None:
    """Print the table."""
    cv2.setNumThreads(1)
    count, rng = int(sys.argv[1]) if len(sys.argv) > 1 else 10, np.random.default_rng(12)
    print("along across height  grain   spots   field, learnt: contrast ρ₁   σ/scatter   with the field's law")
    for values in CASES:
        print(case(*values, count, rng), flush=True)


if __name__ == "__main__":
    main()
