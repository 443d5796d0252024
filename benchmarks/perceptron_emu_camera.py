"""The chip and the speckle against theory: photon transfer on rendered flats, contrast and grain on a rendered plate.

Run: python benchmarks/perceptron_emu_camera.py. Peers: EMVA 1288's linear model and Goodman's statistics, both exact.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.special import j1

from geometry import Camera, Pose, Sensor, Sheet, nearest_rotation
from perceptron_emu import EmulatorConfig, Material, Scene, mean_electrons, panel, render
from perceptron_emu.image import grain_px, speckle_contrast

READ_E, DSNU_E, PRNU, WELL_E, GAIN = 12.0, 6.0, 0.012, 9000.0, 0.35
FRAMES = 16


def main() -> None:
    """Print every figure beside its truth."""
    print("photon transfer (EMVA 1288) on flats of room light, 1280 x 1024, 12 bits")
    for name, found, true in photon_transfer():
        print(f"  {name:24s} {found:9.4f}  true {true:9.4f}  {100 * (found / true - 1):+.2f} %")
    print("speckle on a plate lit by a wide sheet, depolarising and polarised surface")
    for polarised in (False, True):
        for name, found, true in speckle(polarised):
            print(f"  {name:24s} {found:9.4f}  theory {true:9.4f}  {100 * (found / true - 1):+.2f} %")


def sensor_12bit() -> Sensor:
    """A sensor with the converter of a measuring camera."""
    tilt = np.deg2rad(22.5)
    rotation = nearest_rotation([[0, -np.cos(tilt), -np.sin(tilt)], [1, 0, 0], [0, -np.sin(tilt), np.cos(tilt)]])
    pose = Pose(rotation, np.array([120.0, 0, 0]))
    camera = Camera(1280, 1024, 2300.0, 2300.0, 639.5, 511.5, pose, bit_depth=12, black_level=64.0)
    return Sensor(Sheet(fan_rad=0.9), camera)


def flat(irradiance: float, seed: int, frames: int) -> tuple[np.ndarray, float]:
    """Frames (n, H, W) of a grey panel that faces the camera, and the mean electrons that it brings."""
    sensor = sensor_12bit()
    axis = sensor.camera.T_sensor_camera.R[:, 2]
    wall = panel(900, 900, Pose(sensor.camera.T_sensor_camera.R, sensor.camera.centre_mm + 330 * axis), Material(0.5))
    tables = {
        "ambient": {"irradiance_mw_m2_nm": irradiance, "direction": axis.tolist()},
        "exposure": {"laser_on": False, "time_ms": 10.0},
        "optics": {"vignetting": False},
        "noise": {"read_noise_e": READ_E, "dsnu_e": DSNU_E, "prnu": PRNU, "full_well_e": WELL_E, "gain_dn_per_e": GAIN,
                  "dark_current_e_s": 0.0},
    }  # fmt: skip
    config, scene = EmulatorConfig.model_validate(tables), Scene(sensor, solids=(wall,))
    rng = np.random.default_rng(seed)
    images = np.stack([render(scene, config, rng).image for _ in range(frames)]).astype(np.float32)
    return images, float(mean_electrons(scene, config).mean())


def photon_transfer() -> list[tuple[str, float, float]]:
    """Gain, read noise, DSNU, PRNU and full well as a photon-transfer measurement finds them, beside the truth."""
    dark, _ = flat(0.0, 1, FRAMES)
    temporal = np.mean(np.var(dark, axis=0, ddof=1))
    points = [flat(e, 10 + k, FRAMES // 2)[0] for k, e in enumerate((2.0, 6.0, 10.0, 14.0))]
    signal = np.array([p.mean() for p in points]) - dark.mean()
    variance = np.array([np.mean(np.var(p, axis=0, ddof=1)) for p in points]) - temporal
    gain = float(signal @ variance / (signal @ signal))
    read = np.sqrt(np.mean([np.var(b - a) / 2 for a, b in pairwise(dark)]) - 1 / 12) / gain
    dsnu = np.sqrt(np.var(dark.mean(0)) - temporal / FRAMES) / gain
    half, _ = flat(10.0, 3, FRAMES)
    spatial = np.var(half.mean(0)) - np.mean(np.var(half, axis=0, ddof=1)) / FRAMES - (dsnu * gain) ** 2
    prnu = np.sqrt(spatial) / (half.mean() - dark.mean())
    bright, _ = flat(200.0, 4, 1)
    well = (bright.mean() - dark.mean()) / gain
    return [
        ("gain [DN/e-]", gain, GAIN),
        ("read noise [e-]", float(read), READ_E),
        ("DSNU [e-]", float(dsnu), DSNU_E),
        ("PRNU", float(prnu), PRNU),
        ("full well [e-]", float(well), WELL_E),
    ]


def speckle(polarised: bool) -> list[tuple[str, float, float]]:
    """Contrast and grain of a plate's speckle at f/32 (grain some four pixels), beside Goodman's theory."""
    sensor = sensor_12bit()
    plate = panel(400, 400, Pose(np.eye(3), np.array([0.0, 0, 300])))
    tables = {
        "optics": {"f_number": 32.0, "diffraction": False},
        "laser": {"waist_um": 6000.0, "divergence": False, "bandwidth_nm": 0.01},
        "speckle": {"polarised": polarised},
        "ambient": {"enabled": False},
    }
    config, scene = EmulatorConfig.model_validate(tables), Scene(sensor, solids=(plate,))
    smooth = mean_electrons(scene, config.off("speckle"))
    window = np.s_[int(np.argmax(smooth.sum(1))) - 15 : int(np.argmax(smooth.sum(1))) + 16, 100:1180]
    fields = [mean_electrons(scene, config, key)[window] / smooth[window] for key in range(24)]
    measured = np.mean([covariance(f) for f in fields], 0)
    grain, strength = grain_px(config, sensor), speckle_contrast(config)
    expected = pixel_covariance(grain)
    # the grain: the pattern's correlation area is 4 grain²/π (Goodman 2007, eq. 4-63); the pixel leaves it as it is
    area, lags = measured[:6, :6], np.r_[1, 2 * np.ones(5)]
    of_theory = float(lags @ expected[:6, :6] @ lags)
    found = grain * np.sqrt(float(lags @ area @ lags) / measured[0, 0] / (of_theory / expected[0, 0]))
    return [
        (
            f"contrast, {'one' if polarised else 'two'} pattern(s)",
            float(np.sqrt(measured[0, 0] / expected[0, 0])),
            strength,
        ),
        ("grain [px]", float(found), grain),
    ]


def covariance(field: np.ndarray, reach: int = 8) -> np.ndarray:
    """Covariance (reach, reach) of a field by lag in v and u, averaged over the signs."""
    d = field.astype(float) - 1
    rows, columns = d.shape
    out = np.zeros((reach, reach))
    for i in range(reach):
        for j in range(reach):
            straight = d[: rows - i, : columns - j] * d[i:, j:]
            crossed = d[: rows - i, j:] * d[i:, : columns - j]
            out[i, j] = (straight.mean() + crossed.mean()) / 2
    return out


def pixel_covariance(grain: float, reach: int = 8, fine: int = 20) -> np.ndarray:
    """Covariance of a pattern of unit contrast averaged over square pixels: |2 J1(πr/g)/(πr/g)|² against the pixel's
    triangle.
    """
    t = (np.arange(-fine + 1, fine)) / fine
    weight = (1 - np.abs(t)) / fine
    out = np.zeros((reach, reach))
    for i in range(reach):
        for j in range(reach):
            r = np.pi * np.hypot(i + t[:, None], j + t) / grain
            airy = np.where(r > 0, 2 * j1(np.maximum(r, 1e-9)) / np.maximum(r, 1e-9), 1.0)
            out[i, j] = weight @ airy**2 @ weight
    return out


if __name__ == "__main__":
    main()
