"""The Cramér-Rao bound of a spot's position under the camera's noise, from its noise-free image."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from perceptron_emu import EmulatorConfig, Scene, gain_dn_per_e, render

Array = NDArray[np.float64]

HALF_WINDOW_PX = 14  # some ten σ of a spot: what lies beyond tells nothing of it
DERIVATIVE = np.array([-1, 9, -45, 0, 45, -9, 1]) / 60  # central differences, exact to the sixth order


def noise_free_electrons(scene: Scene, config: EmulatorConfig) -> Array:
    """Mean photo-electrons (H, W) of a scene without noise and speckle, read out with 16 bits."""
    sensor = scene.sensor.with_camera(bit_depth=16, black_level=0.0, stated_saturation_dn=None)
    quiet = config.off("noise", "speckle")
    quiet = quiet.model_copy(update={"noise": quiet.noise.model_copy(update={"gain_dn_per_e": None})})
    image = render(replace(scene, sensor=sensor), quiet).image
    return image.astype(float) / gain_dn_per_e(quiet.noise, sensor)


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
