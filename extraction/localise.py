"""Positions of the candidates: maximum likelihood of an oriented Gaussian, or the parabola through the blurred peak."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.candidates import Candidates
from extraction.config import ExtractionConfig
from extraction.gaussian_fit import PIXEL_VARIANCE_PX2, fit_window
from extraction.preprocess import Prepared
from geometry import SensorModel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Spots:
    """Localised spots of one image.

    uv_px (N, 2), cov_uv_px2 (N, 2, 2): position. amplitude_dn (N,): peak above the background.
    shape_px2 (N, 2, 2): covariance of the spot's light, the pixel's own share taken off. chi2_per_pixel (N,).
    saturated (N,): number of pixels left out as clipped. converged (N,). candidate (N,): index into the candidates.
    """

    uv_px: Array
    cov_uv_px2: Array
    amplitude_dn: Array
    shape_px2: Array
    chi2_per_pixel: Array
    saturated: NDArray[np.intp]
    crowded: Mask
    converged: Mask
    candidate: NDArray[np.intp]

    def __len__(self) -> int:
        """The number of spots."""
        return len(self.candidate)


@dataclass(frozen=True)
class NoiseModel:
    """Noise of a pixel: V = variance around the spot + gain · signal + speckle² · signal² [DN²]."""

    least_variance_dn2: float
    gain_dn_per_e: float
    speckle_contrast: float


def noise_model(prepared: Prepared, sensor: SensorModel, config: ExtractionConfig) -> NoiseModel:
    """The frame's noise: the least variance of a raw pixel, shot gain and speckle contrast."""
    gain = sensor.saturation_dn / config.noise.full_well_e
    if config.noise.read_noise_dn is not None:
        least = config.noise.read_noise_dn**2
    else:
        attenuation = float(np.sum(prepared.kernel**2))
        least = (float(np.median(prepared.noise)) / attenuation) ** 2
    return NoiseModel(max(least, 1.0 / 12.0), gain, config.noise.speckle_contrast)


def localise(
    prepared: Prepared, candidates: Candidates, sensor: SensorModel, noise: NoiseModel, config: ExtractionConfig
) -> Spots:
    """Localise every candidate that was not refused."""
    index = np.flatnonzero([reason == "" for reason in candidates.reason])
    fits = [_fit(prepared, candidates, int(k), sensor, noise, config) for k in index]
    table = np.array([f[0] for f in fits]).reshape(-1, 18)
    shape = np.linalg.inv(table[:, [3, 4, 4, 5]].reshape(-1, 2, 2)) - PIXEL_VARIANCE_PX2 * np.eye(2)
    return Spots(
        table[:, :2], table[:, [9, 10, 10, 11]].reshape(-1, 2, 2), table[:, 2], shape,
        table[:, 12] / np.maximum(table[:, 16], 1.0), table[:, 15].astype(np.intp), table[:, 17] > 0, table[:, 14] > 0,
        index,
    )  # fmt: skip


def _start_shape(candidates: Candidates, k: int, config: ExtractionConfig) -> Array:
    """Covariance (2, 2) of the spot on the raw image from the region's moments on the blurred one."""
    level = config.detect.region_level
    t = np.log(1.0 / level)
    # second moment of a Gaussian's part above `level`, weighted by what stands above, as a share of its variance
    share = (1.0 - (1.0 + t) * level - 0.5 * level * t * t) / (1.0 - level - level * t)
    blurred = candidates.cov_uv_px2[k] / share
    values, vectors = np.linalg.eigh(blurred - config.detect.blur_sigma_px**2 * np.eye(2))
    return np.asarray((vectors * np.maximum(values, 0.3)) @ vectors.T)


def _fit(
    prepared: Prepared, candidates: Candidates, k: int, sensor: SensorModel, noise: NoiseModel, config: ExtractionConfig
) -> tuple[Array]:
    shape = _start_shape(candidates, k, config)
    u, v = candidates.mean_uv_px[k]
    half = np.ceil(config.localise.window_sigma * np.sqrt(np.diag(shape)) + 2.0)
    half = np.clip(half, 4, config.localise.max_half_window_px).astype(int)
    rows, columns = prepared.image.shape
    left, right = max(0, round(u) - half[0]), min(columns, round(u) + half[0] + 1)
    top, bottom = max(0, round(v) - half[1]), min(rows, round(v) + half[1] + 1)
    data = prepared.image[top:bottom, left:right].astype(np.float64)
    owner = candidates.owner[top:bottom, left:right]
    clipped = data >= sensor.saturation_dn
    other = (owner >= 0) & (owner != k)
    precision = np.linalg.inv(shape)
    start = np.zeros(9)
    # the blur lowered the peak by √(det Σ / det (Σ + blur))
    blurred = shape + config.detect.blur_sigma_px**2 * np.eye(2)
    height = candidates.height_dn[k] * np.sqrt(np.linalg.det(blurred) / np.linalg.det(shape))
    start[:7] = u - left, v - top, height, precision[0, 0], precision[0, 1], precision[1, 1], candidates.ring_dn[k]
    ring_variance = (candidates.ring_noise_dn[k] / np.sum(prepared.kernel**2)) ** 2
    v0 = max(noise.least_variance_dn2, min(ring_variance, 25 * noise.least_variance_dn2))
    model = np.array([v0, noise.gain_dn_per_e, candidates.ring_dn[k], noise.speckle_contrast**2])
    terms = 9 if candidates.uneven_dn[k] > 4.0 * candidates.ring_noise_dn[k] else 7
    out = np.zeros(18)
    out[14] = fit_window(data, ~(clipped | other), start, terms, model, config.localise.max_iterations, out)
    out[0] += left
    out[1] += top
    out[15], out[16], out[17] = np.sum(clipped), np.sum(~(clipped | other)) - terms, np.any(other)
    return (out,)
