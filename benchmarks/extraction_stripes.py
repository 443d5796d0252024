"""Stripes against their bound: RMSE over the per-column Cramér–Rao bound, calibration of σ and speed, beside peers.

Frames 1280 × 1024, 8 bits, a gently curved stripe; mean integrated over the pixel, shot and read noise, rounding. The
bound is F = Σ ∂μ ∂μᵀ / (g·μ + r² + 1/12) with free centre, amplitude, width and background. Nothing is told to the
extraction: noise and width are its own estimates. "found" counts columns; RMSE is over points within 3 px of the truth.
Run: python benchmarks/extraction_stripes.py [frames]   (RIDGE_PYTHON=… names an interpreter with ridge-detector)
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path

import cv2
import numpy as np
from scipy.special import ndtr

from extraction.stripe import detect_stripe

HEIGHT, WIDTH, BACKGROUND_DN = 1024, 1280, 10.0
CASES = ((150, 2.0), (40, 2.0), (15, 2.0), (150, 1.0), (40, 1.0), (15, 1.0))  # peak DN, σ px
CAMERAS = ((0.025, 1.0), (0.1, 2.0))  # DN per electron, read noise DN
Points = tuple[np.ndarray, np.ndarray]  # column, row


def truth(rng: np.random.Generator) -> np.ndarray:
    """Row of the stripe in every column."""
    u = np.arange(WIDTH)
    return 400 + rng.uniform(0, 200) + 20 * np.sin(u / 200 + rng.uniform(0, 6)) + rng.uniform(-0.05, 0.05) * u


def mean_section(row: np.ndarray, centre: np.ndarray, peak: float, sigma: float) -> np.ndarray:
    """Mean grey level, integrated over the pixel; ``peak`` is that of the unintegrated Gaussian."""
    area = peak * sigma * np.sqrt(2 * np.pi)
    return area * (ndtr((row + 0.5 - centre) / sigma) - ndtr((row - 0.5 - centre) / sigma)) + BACKGROUND_DN


def bound_px(peak: float, sigma: float, gain: float, read: float) -> float:
    """Root mean square Cramér–Rao bound of the centre over sub-pixel phases."""
    row, variances = np.arange(-40, 41.0), []
    for phase in np.arange(0, 1, 0.1):
        p = np.array([phase, peak, sigma])
        mean = mean_section(row, *p)
        slopes = [(mean_section(row, *(p + h)) - mean_section(row, *(p - h))) / 2e-5 for h in 1e-5 * np.eye(3)]
        j = np.column_stack([*slopes, np.ones_like(row)])
        variances.append(np.linalg.inv(j.T @ (j / (gain * mean + read**2 + 1 / 12)[:, None]))[0, 0])
    return float(np.sqrt(np.mean(variances)))


def frame(rng: np.random.Generator, centre: np.ndarray, peak: float, sigma: float, gain: float, read: float):
    """A noisy 8-bit frame."""
    mean = mean_section(np.arange(HEIGHT)[:, None], centre, peak, sigma)
    noisy = gain * rng.poisson(mean / gain) + rng.normal(0, read, mean.shape)
    return noisy.round().clip(0, 255).astype(np.uint8)


def column_maximum(image: np.ndarray) -> Points:
    """OpenCV alone: the brightest pixel of each column of the blurred frame, whole pixels."""
    blurred = cv2.GaussianBlur(image, (5, 5), 1.3)
    return np.arange(image.shape[1]), np.argmax(blurred, axis=0).astype(float)


def centre_of_mass(image: np.ndarray) -> Points:
    """Centre of mass of what stands above the column's median, 7 px around the maximum."""
    u, v = column_maximum(image)
    return u, _window_mean(image, v.astype(int), 7)


def _window_mean(image: np.ndarray, v: np.ndarray, half: int) -> np.ndarray:
    rows = np.clip(v + np.arange(-half, half + 1)[:, None], 0, len(image) - 1)
    grey = image[rows, np.arange(image.shape[1])].astype(float)
    weight = np.maximum(grey - np.median(image[::8]), 0)
    return np.sum(weight * rows, 0) / np.maximum(np.sum(weight, 0), 1e-9)


def _three_points(image: np.ndarray, transform: Callable[[np.ndarray], np.ndarray]) -> Points:
    u, v = np.arange(image.shape[1]), np.clip(np.argmax(image, axis=0), 1, len(image) - 2)
    a, b, c = (transform(image[v + k, u].astype(float)) for k in (-1, 0, 1))
    bend = a - 2 * b + c
    return u, v + np.where(bend < 0, 0.5 * (a - c) / np.where(bend < 0, bend, 1), 0.0)


def parabola(image: np.ndarray) -> Points:
    """Parabola through the three highest raw pixels."""
    return _three_points(image, lambda grey: grey)


def blur_log_parabola(image: np.ndarray, sigma: float) -> Points:
    """Matched blur along the column, then a parabola through the logarithms above the background."""
    blurred = cv2.GaussianBlur(image.astype(np.float32), (1, 2 * int(3 * sigma) + 1), sigma)
    level = float(np.median(blurred[::16]))
    return _three_points(blurred, lambda grey: np.log(np.maximum(grey - level, 1e-3)))


def ours(image: np.ndarray) -> Points:
    """The product, defaults."""
    peaks = detect_stripe(image)
    return peaks.uv_px[:, 0], peaks.uv_px[:, 1]


RIDGE = """
import sys, time, numpy as np
from ridge_detector import RidgeDetector
images = np.load(sys.argv[1]); out = []; start = time.perf_counter()
for image in images:
    d = RidgeDetector(line_widths=[int(sys.argv[3])], low_contrast=int(sys.argv[4]), high_contrast=2 * int(sys.argv[4]),
                      min_len=20, dark_line=False, estimate_width=False)
    d.detect_lines(image)
    for line in d.contours:
        out.append(np.column_stack([line.col, line.row]))
np.savez(sys.argv[2], seconds=time.perf_counter() - start, points=np.concatenate(out) if out else np.zeros((0, 2)))
"""


def ridge_detector(image: np.ndarray, sigma: float, peak: float) -> tuple[Points, float] | None:
    """ridge-detector's line points in an environment of its own; None where that is not given."""
    python = os.environ.get("RIDGE_PYTHON")
    if not python:
        return None
    with tempfile.TemporaryDirectory() as folder:
        source, result = Path(folder, "in.npy"), Path(folder, "out.npz")
        np.save(source, image[None])
        width, contrast = str(max(2, round(2.5 * sigma))), str(max(2, round(0.3 * peak)))
        subprocess.run([python, "-c", RIDGE, source, result, width, contrast], check=True, capture_output=True)  # noqa: S603
        found = np.load(result)
        return (found["points"][:, 0], found["points"][:, 1]), float(found["seconds"])


def score(points: Points, centre: np.ndarray) -> tuple[float, int]:
    """Sum of squared errors and number of points within 3 px of the truth."""
    u, v = points
    error = v - np.interp(u, np.arange(WIDTH), centre)
    near = np.abs(error) < 3
    return float(np.sum(error[near] ** 2)), int(near.sum())


def rates(methods: Sequence[Callable[[], object]], rounds: int = 15) -> list[float]:
    """Mpx/s of one core by the median CPU time of each method; they take turns, as clocks wander."""
    times = np.empty((rounds, len(methods)))
    for k in range(rounds):
        for n, method in enumerate(methods):
            start = time.thread_time()
            method()
            times[k, n] = time.thread_time() - start
    return list(HEIGHT * WIDTH / np.median(times, axis=0) / 1e6)


def run_case(peak: float, sigma: float, gain: float, read: float, frames: int) -> None:
    """Print one line per method."""
    rng = np.random.default_rng(int(peak * 10 + sigma))
    bound = bound_px(peak, sigma, gain, read)
    methods: dict[str, Callable[[np.ndarray], Points]] = {
        "perceptron-emu": ours,
        "blur + log-parabola": lambda image: blur_log_parabola(image, sigma),
        "centre of mass": centre_of_mass,
        "parabola": parabola,
        "column maximum": column_maximum,
    }
    sums, nees = {name: np.zeros(2) for name in methods}, []
    for _ in range(frames):
        centre = truth(rng)
        image = frame(rng, centre, peak, sigma, gain, read)
        for name, method in methods.items():
            sums[name] += score(method(image), centre)
        peaks = detect_stripe(image)
        nees.append((peaks.uv_px[:, 1] - centre[peaks.section]) / peaks.sigma_px)
    print(f"\npeak {peak:g} DN, σ {sigma:g} px, gain {gain:g} DN/e, read {read:g} DN: bound {bound:.4f} px")
    speeds = rates([lambda m=method: m(image) for method in methods.values()])
    for name, speed in zip(methods, speeds, strict=True):
        total, count = sums[name]
        line = f"  {name:22s} RMSE/CRLB {np.sqrt(total / count) / bound:6.3f}   found {count / frames / WIDTH:6.1%}"
        line += f"   {speed:6.0f} Mpx/s"
        print(line + (f"   scatter/σ {np.std(np.concatenate(nees)):.3f}" if name == "perceptron-emu" else ""))
    ridge = ridge_detector(image, sigma, peak)
    if ridge is not None:
        total, count = score(ridge[0], centre)
        ratio = np.sqrt(total / max(count, 1)) / bound
        speed = HEIGHT * WIDTH / ridge[1] / 1e6
        print(f"  {'ridge-detector':22s} RMSE/CRLB {ratio:6.3f}   found {count / WIDTH:6.1%}   {speed:6.1f} Mpx/s")


def main() -> None:
    """Print all cases."""
    cv2.setNumThreads(1)
    frames = int(sys.argv[1]) if len(sys.argv) > 1 else 8
    for gain, read in CAMERAS:
        for peak, sigma in CASES:
            run_case(peak, sigma, gain, read, frames)


if __name__ == "__main__":
    main()
