"""Gap, flush and radii of rendered panels beside their truth: bias, scatter, honest σ, with and without speckle.

Panels as `random_panels` draws them, before the nominal sensor.
Run: python benchmarks/gapflush_panels.py [count] [matte|satin] [plain|speckle]
"""

from __future__ import annotations

import sys
import time

import numpy as np

from assets import path as asset
from extraction import Profile, extract_profile, measure_gap_flush
from geometry import PerceptronEmuError, Sensor
from perceptron_emu import EmulatorConfig, Material, Scene, render
from perceptron_emu.solids import PanelPair, random_panels
from workbench.files import read_sensor

SURFACES = {"matte": Material(0.6), "satin": Material(0.4, 0.05, 0.35)}
EXPOSURE_MS = {"matte": 0.3, "satin": 0.15}
NAMES = ("gap", "flush", "radius left", "radius right")


def profile_of(sensor: Sensor, surface: str, speckle: bool, seed: int) -> tuple[PanelPair, Profile]:
    """Panels and the profile that is extracted from their image."""
    rng = np.random.default_rng([7, seed])
    panels, pose = random_panels(rng)
    config = EmulatorConfig.model_validate(
        {"exposure": {"time_ms": EXPOSURE_MS[surface]}, "speckle": {"enabled": speckle}}
    )
    image = render(Scene(sensor, None, solids=panels.solids(pose, SURFACES[surface])), config, rng).image
    return panels, extract_profile(image, sensor)


def measure(sensor: Sensor, surface: str, speckle: bool, count: int) -> tuple[np.ndarray, np.ndarray, int, float]:
    """Errors and σ (n, 4) of unflagged answers, how many were flagged or refused, seconds each."""
    rows, doubtful, seconds = [], 0, 0.0
    for seed in range(count):
        panels, profile = profile_of(sensor, surface, speckle, seed)
        start = time.process_time()
        try:
            g = measure_gap_flush(profile)
        except PerceptronEmuError:
            doubtful += 1
            continue
        seconds += time.process_time() - start
        if g.flag:
            doubtful += 1
            continue
        error = [g.gap_mm - panels.gap_mm, g.flush_mm - panels.flush_mm, *(g.radius_mm - panels.radii_mm)]
        rows.append([error, [g.sigma_gap_mm, g.sigma_flush_mm, *g.sigma_radius_mm]])
    table = np.array(rows)
    return table[:, 0], table[:, 1], doubtful, seconds / max(len(rows), 1)


def main() -> None:
    """Print a table per surface."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    surfaces = [name for name in SURFACES if name in sys.argv] or list(SURFACES)
    kinds = [k for k in ("plain", "speckle") if k in sys.argv] or ["plain", "speckle"]
    sensor = read_sensor(asset("sensors", "nominal"))
    for surface in surfaces:
        for kind in kinds:
            error, sigma, doubtful, seconds = measure(sensor, surface, kind == "speckle", count)
            print(f"\n{surface}, {kind}: {count} panels, {doubtful} flagged or refused, {1e3 * seconds:.0f} ms each")
            print("              bias ± its error     rms    median σ   rms(error/σ)  within 1.96 σ")
            for k, name in enumerate(NAMES):
                e, z = error[:, k], error[:, k] / sigma[:, k]
                bias = f"{e.mean():+.4f} ± {e.std() / np.sqrt(len(e)):.4f}"
                inside = 100 * np.mean(np.abs(z) < 1.96)
                rest = f"{np.sqrt(np.mean(e**2)):.4f}   {np.median(sigma[:, k]):.4f}   {np.sqrt(np.mean(z**2)):8.2f}"
                print(f"  {name:13s} {bias} mm   {rest}   {inside:10.1f} %", flush=True)


if __name__ == "__main__":
    main()
