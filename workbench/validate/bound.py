"""What the camera's noise allows, of a noise-free image: how well a spot is placed, and whether it can be seen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from perceptron_emu import EmulatorConfig, Scene, gain_dn_per_e, render

Array = NDArray[np.float64]

# An ideal detector, a filter of the spot's own shape, sees a spot of signal-to-noise ratio d with the probability
# Φ(d - z), where z bounds its false alarms. One false spot in 100 images of some 100,000 places apart asks z = 5.2, and
# 999 of 1,000 spots seen ask 3.1 more: nobody can be asked to find what is fainter.
DETECTABLE_SNR = 8.3
HALF_SPOT_PX = 6  # some four σ of a spot: little of a neighbour lies within
HALF_WINDOW_PX = 14  # some ten σ of a spot: what lies beyond tells nothing of it
DERIVATIVE = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60  # central differences, exact to the sixth order


def noise_free_electrons(scene: Scene, config: EmulatorConfig) -> Array:
    """Mean photo-electrons (H, W) of a scene without noise and speckle, read out with 16 bits."""
    sensor = scene.sensor.with_camera(bit_depth=16, black_level=0.0, stated_saturation_dn=None)
    quiet = config.off("noise", "speckle")
    quiet = quiet.model_copy(update={"noise": quiet.noise.model_copy(update={"gain_dn_per_e": None})})
    image = render(replace(scene, sensor=sensor), quiet).image
    return image.astype(float) / gain_dn_per_e(quiet.noise, sensor)


def best_snr(electrons: Array, uv_px: Array, config: EmulatorConfig, scene: Scene) -> float:
    """Signal-to-noise ratio of a spot at (u, v) behind a filter of its own shape, the best that any detector has.

    d² = Σ s² / (b + r² + q²/12) with the light s above the background b [e⁻]. NaN beyond the image.
    """
    u, v = (round(float(x)) for x in uv_px)
    h, w = HALF_SPOT_PX, HALF_WINDOW_PX
    around = electrons[max(v - w, 0) : max(v + w + 1, 0), max(u - w, 0) : max(u + w + 1, 0)]
    patch = electrons[max(v - h, 0) : max(v + h + 1, 0), max(u - h, 0) : max(u + h + 1, 0)]
    if not patch.size:
        return float("nan")
    background = float(np.median(around))
    gain = gain_dn_per_e(config.noise, scene.sensor)
    variance = background + config.noise.read_noise_e**2 + 1 / (12 * gain**2)
    return float(np.sqrt(np.sum(np.maximum(patch - background, 0.0) ** 2) / variance))


def position_bound_px(electrons: Array, uv_px: Array, config: EmulatorConfig, scene: Scene) -> float:
    """Root of the mean bound of u and v [px] for a spot at (u, v); NaN where it can not be formed.

    Its shape is taken as known, its strength and background as free. F = Σ ∂μ ∂μᵀ / (μ + r² + q²/12), clipped pixels
    left out; speckle is not in it.
    """
    camera = scene.sensor.require_camera()
    u, v = (round(float(x)) for x in uv_px)
    from scipy.ndimage import correlate1d  # a tenth of a second, and most commands need none of it

    h = HALF_WINDOW_PX
    patch = electrons[max(v - h, 0) : v + h + 1, max(u - h, 0) : u + h + 1]
    if patch.shape != (2 * h + 1, 2 * h + 1):
        return float("nan")
    gain = gain_dn_per_e(config.noise, scene.sensor)
    variance = patch + config.noise.read_noise_e**2 + 1 / (12 * gain**2)
    clipped = patch * gain + camera.black_level >= camera.saturation_dn - 0.5
    background = float(np.median(patch))
    du, dv = correlate1d(patch, DERIVATIVE, axis=1), correlate1d(patch, DERIVATIVE, axis=0)
    columns = np.stack([du, dv, patch - background, np.ones_like(patch)], -1).reshape(-1, 4)
    weight = np.where(clipped, 0.0, 1 / variance).reshape(-1, 1)
    information = columns.T @ (weight * columns)
    if not np.all(np.isfinite(information)) or np.linalg.cond(information) > 1e14:
        return float("nan")
    return float(np.sqrt(np.trace(np.linalg.inv(information)[:2, :2]) / 2))
