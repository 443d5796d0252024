"""How far string spots depart from the fitted Gaussian: shape left in the residuals, shift of the position.

Shape: contrast of the residuals of frames without noise and speckle, weighed as if there were. Shift: every pose is
rendered several times with fresh noise and speckle; what the mean of a spot's errors keeps is systematic. It is given
in pixels, along and across the light, and as the share of the height that independent errors in every pixel would need
for it. "noise/within": σ of camera and speckle over the scatter of one pose. `speckle.SHAPE_CONTRAST` and
`errors.MODEL_SHARE` of `extraction/spots` come from here.
Run: python benchmarks/extraction_model_error.py [--poses 60] [--times 12] [--first 21] [--diameters 0.3 ...]
"""

from __future__ import annotations

import argparse
from collections import defaultdict
from dataclasses import replace

import cv2
import numpy as np
from rendered_strings import Emulated, budgets, matches, optics, scene

from extraction import ExtractionConfig, SpotNoiseConfig, extract, learn_speckle
from extraction.spots import correlation
from perceptron_emu import Scene, render

DIAMETERS = (0.1, 0.2, 0.3, 0.5, 1.0)
FINE = 65535 / 255  # grey levels of 16 bits in one of 8
QUIET_READ_DN = 0.5  # of 8 bits


def shape_contrast(seen_by: Emulated, scenes: list[Scene]) -> float:
    """Contrast of the residuals without noise and speckle."""
    sensor = seen_by.sensor.with_camera(bit_depth=16, black_level=seen_by.sensor.camera.black_level * FINE)
    emulator = seen_by.emulator.off("noise", "speckle")
    noise = SpotNoiseConfig(read_noise_dn=QUIET_READ_DN * FINE, speckle_contrast=0.3, speckle_grain_px=0.5)
    config, left, light = ExtractionConfig(noise=noise), 0.0, 0.0
    for one in scenes:
        frame = render(replace(one, sensor=sensor), emulator)
        points = extract(frame.image, sensor, config)
        uv, about = budgets(frame.image, sensor, config)
        for _, k in matches(frame, points):
            i = int(np.argmin(np.linalg.norm(uv - points.uv_px[k], axis=1)))
            if about is not None:
                left += about.variance[i] + about.variance_camera[i]
                light += about.variance_speckle[i, 0]
    return float(np.sqrt(left / light))


def shifts(seen_by: Emulated, scenes: list[Scene], times: int, rng: np.random.Generator) -> str:
    """Systematic error, its share of the height, and the noise's σ over the scatter of one pose."""
    config = learn_speckle([render(s, seen_by.emulator, rng).image for s in scenes], seen_by.sensor)
    rho = config.noise.speckle_contrast**2 * correlation(config.noise.speckle_grain_px)
    rows = defaultdict(list)
    for number, one in enumerate(scenes):
        for _ in range(times):
            frame = render(one, seen_by.emulator, rng)
            points = extract(frame.image, seen_by.sensor, config)
            uv, about = budgets(frame.image, seen_by.sensor, config)
            for n, k in matches(frame, points):
                i = int(np.argmin(np.linalg.norm(uv - points.uv_px[k], axis=1)))
                noise = about.camera[i, :2, :2] + about.speckle[i, :2, :2] @ rho
                error = points.uv_px[k] - frame.truth.strings[n].image_px
                rows[number, n].append((error, points.axis_rad[k], noise, about.white[i, :2, :2]))
    return summary([group for group in rows.values() if len(group) > times // 2])


def summary(groups: list) -> str:
    """The line of one case from the errors, axes, noise and white covariances of every spot's repetitions."""
    within, systematic, noise, white = (np.zeros((len(groups), 2)) for _ in range(4))
    for g, group in enumerate(groups):
        errors, axes, covariances, plain = (np.array(column) for column in zip(*group, strict=True))
        axis = 0.5 * np.angle(np.mean(np.exp(2j * axes)))
        turn = np.array([[np.cos(axis), np.sin(axis)], [-np.sin(axis), np.cos(axis)]])
        errors = errors @ turn.T
        within[g] = errors.var(axis=0, ddof=1)
        systematic[g] = errors.mean(axis=0) ** 2 - within[g] / len(errors)
        noise[g], white[g] = (np.diag(turn @ c.mean(axis=0) @ turn.T) for c in (covariances, plain))
    shift = np.sqrt(np.maximum(systematic.mean(axis=0), 0))
    share, ratio = shift / np.sqrt(white.mean(axis=0)), np.sqrt(noise.mean(axis=0) / within.mean(axis=0))
    return (
        f"{len(groups):5d} spots  shift {shift[0]:.4f} {shift[1]:.4f} px  share {share[0]:.4f} {share[1]:.4f}  "
        f"noise/within {ratio[0]:.2f} {ratio[1]:.2f}"
    )


def main() -> None:
    """Print a line per string and speckle."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--poses", type=int, default=60)
    parser.add_argument("--times", type=int, default=12, help="renderings of a pose")
    parser.add_argument("--first", type=int, default=21, help="seed")
    parser.add_argument("--optics", default="nominal")
    parser.add_argument("--diameters", nargs="+", type=float, default=DIAMETERS, help="mm")
    given = parser.parse_args()
    cv2.setNumThreads(1)
    for diameter in given.diameters:
        rng = np.random.default_rng(given.first)
        seen_by = optics(given.optics)
        scenes = [scene(seen_by, diameter, rng) for _ in range(given.poses)]
        print(f"{diameter:.1f} mm  shape contrast {shape_contrast(seen_by, scenes):.4f}")
        for name, one in (("speckle", seen_by), ("none", seen_by.plain())):
            print(f"        {name:8} {shifts(one, scenes, given.times, rng)}", flush=True)


if __name__ == "__main__":
    main()
