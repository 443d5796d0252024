"""Twins of emulated sensors: do they find the keys, and do their σ hold?

    python benchmarks/twin_recovery.py [--sensors 100] [--first 1] [--images 4]

Every sensor has keys drawn at random and records tilted plates; its twin starts from the defaults and knows the
geometry alone. Printed are the pulls (found − true) / σ; power, gain, read noise and waist in logarithms.
"""

from __future__ import annotations

import argparse

import numpy as np
from numpy.typing import NDArray

from geometry import Camera, Pose, Sensor, Sheet, nearest_rotation
from perceptron_emu import EmulatorConfig, Material, Scene, panel, render
from workbench.twin import Twin, fit_twin

CLIPPED = 1e-4  # of an image's pixels


def main() -> None:
    """Print every sensor's pulls, and their rms by key."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--sensors", type=int, default=100)
    parser.add_argument("--first", type=int, default=1, help="seed of the first")
    parser.add_argument("--images", type=int, default=4)
    options = parser.parse_args()
    rows = []
    for seed in range(options.first, options.first + options.sensors):
        truth, twin = one(seed, options.images)
        pulls = [pull(k.value, k.sigma, truth[k.name]) for k in twin.keys]
        rows.append(pulls)
        print(f"sensor {seed}: chi2 {twin.chi2_per_dof:.2f}, pulls", " ".join(f"{p:+.1f}" for p in pulls), flush=True)
    names = [k.name for k in twin.keys]
    rms = np.sqrt(np.mean(np.square(rows), 0))
    within = np.mean(np.abs(rows) < 2, 0)
    for name, value, share in zip(names, rms, within, strict=True):
        print(f"  {name:22s} rms pull {value:.2f}, within 2 σ {100 * share:.0f} %")


def pull(value: float, sigma: float, true: float) -> float:
    """(found − true) / σ, of the logarithm."""
    return float((np.log(max(value, 1e-9)) - np.log(true)) / (sigma / max(value, 1e-9)))


def one(seed: int, images: int) -> tuple[dict[str, float], Twin]:
    """A sensor's true keys and its twin."""
    rng = np.random.default_rng(seed)
    truth = {
        "power_mw": rng.uniform(2, 8), "waist_um": rng.uniform(150, 300), "edge_fraction": rng.uniform(0.5, 0.95),
        "blur_px": rng.uniform(0.6, 1.5), "f_number": rng.uniform(4, 11), "contrast": rng.uniform(0.2, 0.8),
        "gain_dn_per_e": rng.uniform(0.015, 0.04), "read_noise_e": rng.uniform(8, 40),
        "irradiance_mw_m2_nm": rng.uniform(3, 40), "black_level": rng.uniform(4, 20),
    }  # fmt: skip
    truth = {name: float(value) for name, value in truth.items()}
    tables = {
        "laser": ("power_mw", "waist_um", "edge_fraction"), "optics": ("blur_px", "f_number"), "speckle": ("contrast",),
        "noise": ("gain_dn_per_e", "read_noise_e"), "ambient": ("irradiance_mw_m2_nm",),
    }  # fmt: skip
    recorded = _recorded(truth, tables, images, seed)
    while max(np.mean(image == 255) for _, image in recorded) > CLIPPED:  # as a user sets the exposure
        truth["power_mw"] /= 1.5
        recorded = _recorded(truth, tables, images, seed)
    return truth, fit_twin(recorded, small_sensor(0.0), EmulatorConfig(), 1, lambda done, total: None)


def _recorded(
    truth: dict[str, float], tables: dict[str, tuple[str, ...]], images: int, seed: int
) -> list[tuple[str, NDArray[np.uint8] | NDArray[np.uint16]]]:
    keys = {table: {name: truth[name] for name in names} for table, names in tables.items()}
    keys["noise"]["full_well_e"] = 1.03 * (255 - truth["black_level"]) / truth["gain_dn_per_e"]
    config, sensor = EmulatorConfig.model_validate(keys), small_sensor(truth["black_level"])
    rng, recorded = np.random.default_rng([seed, 1]), []
    for k in range(images):
        tilts = [rng.uniform(-20, 20), rng.uniform(-20, 20), 90]
        plate = panel(140, 60, Pose.from_fixed_xyz_deg(tilts, [0, 0, rng.uniform(280, 330)]), Material(0.6))
        recorded.append((f"{k}.png", render(Scene(sensor, solids=(plate,)), config, rng).image))
    return recorded


def small_sensor(black_level: float) -> Sensor:
    """640 × 512 pixels, 300 mm away."""
    tilt = np.deg2rad(22.5)
    rotation = nearest_rotation([[0, -np.cos(tilt), -np.sin(tilt)], [1, 0, 0], [0, -np.sin(tilt), np.cos(tilt)]])
    pose = Pose(rotation, np.array([120.0, 0, 0]))
    camera = Camera(640, 512, 1150.0, 1150.0, 319.5, 255.5, pose, black_level=black_level)
    return Sensor(Sheet(fan_rad=float(np.deg2rad(44))), camera)


if __name__ == "__main__":
    main()
