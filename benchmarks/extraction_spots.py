"""Spots against their bound: RMSE over the Cramér–Rao bound, calibration of σ and speed, beside peers on one data.

Windows of 11 × 11 px, one spot at a random phase, pixel-integrated by quadrature, shot and read noise, in electrons.
Bound: `position_bound`, height, background and shape unknown (round: one width, elongated: three). "peak/noise" is
the peak over the standard deviation of a pixel without the spot. Peers: picassosr (gaussmle), photutils, trackpy, sep,
OpenCV; one that is not installed is skipped, saying so. The last table times whole frames of 1280 × 1024.
Run: python benchmarks/extraction_spots.py [spots a point, default 5000]
PEERS_PYTHON=… names an interpreter that has the peers (pip install photutils trackpy sep, and with --no-deps picassosr
beside numba, pandas, h5py, pyyaml, tqdm, matplotlib and scipy: its windows are not needed); this one where absent.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from spot_peers import PEERS

import assets
from extraction import ExtractionConfig, LocaliseConfig, extract
from extraction.spots import TrueSpot, fit_peaks, fit_stack, mean_image, position_bound
from geometry import Camera, Pose, Sensor, Sheet

SIDE, WIDTH_PX = 11, 1.3
ROUND = ((300, 5, 2), (1000, 5, 2), (1000, 50, 2), (10_000, 20, 5), (100_000, 20, 5))  # electrons, background, read
ELONGATED = ((3.0, 0.9, 0.6), (2.2, 1.2, -0.5), (1.6, 0.85, 1.4))  # widths along and across [px], direction [rad]
LIGHT = ((3000, 20, 5), (30_000, 20, 5))
Method = Callable[[np.ndarray, float], np.ndarray]


def windows(rng: np.random.Generator, count: int, light, shape=(WIDTH_PX, WIDTH_PX, 0.0), side: int = SIDE):
    """Noisy images (N, side, side) [e⁻], true centres (N, 2), root mean square bound [px]; 400 random phases."""
    electrons, background, read = light
    bank, bounds, phases = [], [], rng.uniform(-0.5, 0.5, (400, 2))
    for du, dv in phases:
        along, across, angle = shape
        spot = TrueSpot(side // 2 + du, side // 2 + dv, electrons, along, across, angle, background)
        bank.append(mean_image(spot, (side, side)))
        bounds.append(np.trace(position_bound(spot, (side, side), read, round_spot=shape[0] == shape[1])) / 2)
    pick = rng.integers(0, len(bank), count)
    mean = np.array(bank)[pick]
    return (
        rng.poisson(mean) + rng.normal(0, read, mean.shape),
        side // 2 + phases[pick],
        float(np.sqrt(np.mean(bounds))),
    )


def own_ml(images: np.ndarray, read: float) -> np.ndarray:
    """Ours: maximum likelihood."""
    return fit_stack(images, read**2).uv_px


def own_fast(images: np.ndarray, read: float) -> np.ndarray:
    """Ours: matched blur and log-parabola."""
    kernel = cv2.getGaussianKernel(9, WIDTH_PX, cv2.CV_64F)
    n, side = len(images), images.shape[1]
    smooth = np.stack([cv2.sepFilter2D(im.astype(np.float32), cv2.CV_32F, kernel, kernel) for im in images])
    inner = smooth[:, 2:-2, 2:-2].reshape(n, -1).argmax(1)
    peaks = np.column_stack([inner % (side - 4) + 2, inner // (side - 4) + 2 + side * np.arange(n)])
    border = np.concatenate([images[:, 0], images[:, -1], images[:, :, 0], images[:, :, -1]], axis=1).mean(axis=1)
    uv = fit_peaks(smooth.reshape(-1, side), peaks, border, np.full(n, read**2), kernel[:, 0]).uv_px
    return uv - np.column_stack([np.zeros(n), side * np.arange(n)])


def peer_opencv(images: np.ndarray, read: float) -> np.ndarray:
    """cv2.moments of what stands above the border's level and its noise."""
    out = []
    for im in images:
        border = np.concatenate([im[0], im[-1], im[:, 0], im[:, -1]])
        m = cv2.moments(np.where(im > border.mean() + 2 * border.std(), im - border.mean(), 0.0))
        out.append((m["m10"] / m["m00"], m["m01"] / m["m00"]) if m["m00"] > 0 else (np.nan, np.nan))
    return np.array(out)


METHODS: dict[str, Method] = {
    "ours, maximum likelihood": own_ml, "ours, fast": own_fast, "cv2.moments": peer_opencv,
}  # fmt: skip


@dataclass(frozen=True)
class Score:
    """RMSE over the bound, share of failures, spots a second of processor time."""

    ratio: float
    lost: float
    rate: float


def scored(uv: np.ndarray, seconds: float, truth: np.ndarray, bound: float) -> Score:
    """The score of the positions (N, 2) of the first N spots."""
    error = uv - truth[: len(uv)]
    good = np.all(np.abs(error) < 3, axis=1)
    return Score(float(np.sqrt(np.mean(error[good] ** 2)) / bound), float(1 - good.mean()), len(uv) / seconds)


def own_score(method: Method, images: np.ndarray, truth: np.ndarray, bound: float, read: float) -> Score:
    """The score of a method of this process."""
    method(images[:3], read)  # compile
    start = time.process_time()
    uv = method(images, read)
    return scored(uv, time.process_time() - start, truth, bound)


def peer_score(name: str, images: np.ndarray, truth: np.ndarray, bound: float, read: float, width) -> Score:
    """The score of a peer in its own process; ImportError where it is not installed."""
    python = os.environ.get("PEERS_PYTHON", sys.executable)
    with tempfile.TemporaryDirectory() as folder:
        source, result = Path(folder, "in.npz"), Path(folder, "out.npz")
        np.savez(source, images=images, read=read, width=np.array(width))
        script = Path(__file__).with_name("spot_peers.py")
        done = subprocess.run([python, script, name, source, result], capture_output=True, text=True, check=False)  # noqa: S603
        if done.returncode == 3:
            raise ImportError(done.stderr.strip().splitlines()[-1])
        done.check_returncode()
        with np.load(result) as found:
            return scored(found["uv"], float(found["seconds"]), truth, bound)


def table(title: str, cases, count: int) -> None:
    """One table: a row per method, a column per case."""
    print(f"\n{title}\n{'':26}" + "".join(f"{name:>22}" for name, *_ in cases) + f"{'spots/s':>12}")
    data = [windows(np.random.default_rng(7), count, light, shape) for _, light, shape in cases]
    peaks = [light[0] / (2 * np.pi * s[0] * s[1]) / np.sqrt(light[1] + light[2] ** 2) for _, light, s in cases]
    print(f"{'peak/noise':26}" + "".join(f"{p:22.1f}" for p in peaks))
    print(f"{'bound [px]':26}" + "".join(f"{bound:22.4f}" for *_, bound in data))
    for name in (*METHODS, *PEERS):
        try:
            found = [
                own_score(METHODS[name], *d, read=case[1][2])
                if name in METHODS
                else peer_score(name, *d, read=case[1][2], width=case[2][:2])
                for d, case in zip(data, cases, strict=True)
            ]
        except ImportError as error:
            print(f"{name:26}skipped: {error}")
            continue
        lost = [f"{f.ratio:.3f}" + (f" ({100 * f.lost:.1f}% lost)" if f.lost else "") for f in found]
        print(f"{name:26}" + "".join(f"{text:>22}" for text in lost) + f"{np.median([f.rate for f in found]):12,.0f}")


def calibration(count: int) -> None:
    """Reported σ over empirical scatter, of the maximum-likelihood fit."""
    print("\nreported σ / empirical scatter (0.95 … 1.05 wanted)")
    for light in ROUND:
        images, truth, _ = windows(np.random.default_rng(8), count, light)
        fit = fit_stack(images, light[2] ** 2)
        sigma = np.sqrt(np.mean(np.trace(fit.cov_uv_px2, axis1=1, axis2=2)) / 2)
        print(f"  {light!s:22}{sigma / np.std(fit.uv_px - truth):.3f}")


def frame_sensor() -> Sensor:
    """A sensor of 1280 × 1024 px that looks at the sheet from the side."""
    camera = np.array([[0, -0.924016832, -0.382351793], [1, 0, 0], [0, -0.382351793, 0.924016832]])
    u, _, vt = np.linalg.svd(camera)
    return Sensor(Sheet(), Camera(1280, 1024, 2300.0, 2300.0, 639.5, 511.5, Pose(u @ vt, np.array([120.0, 0, 0]))))


def frames() -> None:
    """Whole frames: image in memory → surface points with covariance, on one core."""
    cv2.setNumThreads(1)
    rng, sensor = np.random.default_rng(3), frame_sensor()
    print("\nstring frame 1280 × 1024 → surface points with covariance, one core")
    images = {"five spots, noise 0.6 DN": synthetic_frame(rng)}
    recorded = sorted((assets.path("samples", "cell_a") / "images").glob("*.png"))
    for path in recorded[:4]:
        images[f"cell_a {path.name}"] = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    for name, image in images.items():
        for method in ("ml", "fast"):
            config = ExtractionConfig(localise=LocaliseConfig(method=method))
            found, cpu = len(extract(image, sensor, config)), []
            for _ in range(30):
                start = time.process_time()
                extract(image, sensor, config)
                cpu.append(time.process_time() - start)
            print(
                f"  {name:26}{method:5}{found:3} spots   median {1e3 * np.median(cpu):6.2f} ms, "
                f"least {1e3 * min(cpu):6.2f} ms"
            )


def synthetic_frame(rng: np.random.Generator) -> np.ndarray:
    """Five elongated spots on a dark, noisy frame of 8 bits."""
    mean = np.full((1024, 1280), 10.0)
    for u, v in ((160, 440), (358, 535), (634, 672), (739, 497), (809, 381)):
        spot = TrueSpot(20 + rng.uniform(), 20 + rng.uniform(), 900.0, 1.6, 0.85, 1.4)
        mean[v - 20 : v + 21, u - 20 : u + 21] += mean_image(spot, (41, 41))
    return (rng.poisson(mean * 40) / 40 + rng.normal(0, 0.3, mean.shape)).round().clip(0, 255).astype(np.uint8)


def main() -> None:
    """Print all tables."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 5000
    cases = [("/".join(map(str, light)), light, (WIDTH_PX, WIDTH_PX, 0.0)) for light in ROUND]
    table("RMSE / bound, round spots σ 1.3 px (electrons/background/read)", cases, count)
    cases = [(f"{a} × {c}, {light[0]} e⁻", light, (a, c, d)) for a, c, d in ELONGATED for light in LIGHT]
    table("RMSE / bound, elongated spots (along × across px)", cases, count)
    calibration(count)
    frames()


if __name__ == "__main__":
    main()
