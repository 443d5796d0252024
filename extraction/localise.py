"""Positions of the candidates by maximum likelihood of an oriented Gaussian, with their covariance."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from extraction.candidates import Candidates
from extraction.config import ExtractionConfig
from extraction.fast import fit_peaks
from extraction.fit_frame import CLIPPED, COLUMNS, CONVERGED, FOREIGN, fit_frame
from extraction.gaussian_fit import PIXEL_VARIANCE_PX2
from extraction.noise import NoiseModel
from extraction.preprocess import Prepared
from extraction.speckle import PRIOR_CONTRAST

Array = NDArray[np.float64]

MIN_START_VARIANCE_PX2 = 0.3
SLOPE_SIGMA = 4.0  # surroundings that differ by more across the spot are fitted with a slope
MAX_RING_VARIANCE = 25.0  # of the frame's noise: an uneven ring is not noise


@dataclass(frozen=True, eq=False)
class Fits:
    """What a fit saw: windows data (N, R, C) [DN], pixels in use; parameters (N, 9) from each window's first pixel,
    terms (N,), noises (N, 5) as in `gaussian_fit.fit_window`; size (N, 2): columns and rows that a window fills.
    """

    data: Array
    use: NDArray[np.bool_]
    parameters: Array
    terms: NDArray[np.int64]
    noises: Array
    size: NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class Spots:
    """Localised spots of one image.

    uv_px (N, 2): position. amplitude_dn (N,): peak above the background.
    shape_px2 (N, 2, 2): covariance of the spot's light, the pixel's own share taken off.
    clipped, foreign (N,): pixels left out as saturated, and as part of something else.
    converged (N,). candidate (N,): index into the candidates.
    fits: for the errors; without it (the fast method) cov_uv_px2 (N, 2, 2) holds them.
    """

    uv_px: Array
    amplitude_dn: Array
    shape_px2: Array
    clipped: NDArray[np.intp]
    foreign: NDArray[np.intp]
    converged: NDArray[np.bool_]
    candidate: NDArray[np.intp]
    fits: Fits | None = None
    cov_uv_px2: Array | None = None

    def __len__(self) -> int:
        """The number of spots."""
        return len(self.candidate)

    @cached_property
    def variances_px2(self) -> Array:
        """Variances of the light across and along each spot (N, 2): the eigenvalues of its shape."""
        uu, uv, vv = self.shape_px2[:, 0, 0], self.shape_px2[:, 0, 1], self.shape_px2[:, 1, 1]
        middle, half = 0.5 * (uu + vv), np.hypot(0.5 * (uu - vv), uv)
        return np.stack([middle - half, middle + half], axis=1)

    @cached_property
    def axis_rad(self) -> Array:
        """Direction of each spot's long axis (N,), from the columns to the rows, in (-π/2, π/2]."""
        uu, uv, vv = self.shape_px2[:, 0, 0], self.shape_px2[:, 0, 1], self.shape_px2[:, 1, 1]
        return np.asarray(0.5 * np.arctan2(2.0 * uv, uu - vv))


def localise(prepared: Prepared, candidates: Candidates, noise: NoiseModel, config: ExtractionConfig) -> Spots:
    """Localise every candidate that was not refused."""
    index = np.flatnonzero(candidates.refusal == 0)
    if config.localise.method == "fast":
        return _fast(prepared, candidates, index, noise)
    if not len(index):
        return _no_spots()
    shapes = _start_shapes(candidates.cov_uv_px2[index], config)
    windows = _windows(candidates.mean_uv_px[index], shapes, prepared, config)
    return _fit(prepared, candidates, index, shapes, windows, noise, config)


def _fit(
    prepared: Prepared,
    candidates: Candidates,
    index: NDArray[np.intp],
    shapes: Array,
    windows: NDArray[np.int64],
    noise: NoiseModel,
    config: ExtractionConfig,
) -> Spots:
    starts = _starts(candidates, index, shapes, config)
    starts[:, :2] -= windows[:, :2]
    ring = (candidates.ring_noise_dn[index] / np.sum(prepared.kernel**2)) ** 2
    variance = np.clip(ring, noise.variance_dn2, MAX_RING_VARIANCE * noise.variance_dn2)
    gain, weight = np.full(len(index), noise.gain_dn_per_e), np.full(len(index), noise.speckle_weight**2)
    wings = (noise.model_error * starts[:, 2]) ** 2
    noises = np.column_stack([variance, gain, candidates.ring_dn[index], weight, wings])
    uneven = candidates.uneven_dn[index] > SLOPE_SIGMA * candidates.ring_noise_dn[index]
    terms = np.where(uneven, 9, 7)
    size = (len(index), int(windows[:, 3].max()), int(windows[:, 2].max()))
    data, use, table = np.zeros(size), np.zeros(size, dtype=np.bool_), np.zeros((len(index), COLUMNS))
    fit_frame(
        prepared.image, candidates.owner, candidates.height_dn, index, windows, starts, noises, terms,
        noise.saturation_dn, config.localise.max_iterations, data, use, table,
    )  # fmt: skip
    shape = np.linalg.inv(table[:, [3, 4, 4, 5]].reshape(-1, 2, 2)) - PIXEL_VARIANCE_PX2 * np.eye(2)
    return Spots(
        table[:, :2] + windows[:, :2], table[:, 2], shape, table[:, CLIPPED].astype(np.intp),
        table[:, FOREIGN].astype(np.intp), table[:, CONVERGED] > 0, index,
        Fits(data, use, table[:, :9], terms, noises, windows[:, 2:]),
    )  # fmt: skip


def _fast(prepared: Prepared, candidates: Candidates, index: NDArray[np.intp], noise: NoiseModel) -> Spots:
    """The fast method: no window is cut, clipped and foreign pixels are only looked for beside the peak."""
    peaks = candidates.peak_uv_px[index].astype(np.intp)
    signal = np.maximum(candidates.height_dn[index], 0.0)
    # speckle moves a peak as white noise of that contrast would
    contrast = PRIOR_CONTRAST if noise.speckle_contrast is None else noise.speckle_contrast
    variance = noise.variance_dn2 + noise.gain_dn_per_e * signal + (contrast * signal) ** 2
    fit = fit_peaks(prepared.smooth, peaks, candidates.ring_dn[index], variance, prepared.kernel)
    rows, columns = prepared.image.shape
    around = np.arange(-1, 2)
    v = np.clip(peaks[:, 1, None, None] + around[:, None], 0, rows - 1)
    u = np.clip(peaks[:, 0, None, None] + around, 0, columns - 1)
    clipped = np.sum(prepared.image[v, u] >= noise.saturation_dn, axis=(1, 2))
    none = np.zeros(len(index), dtype=np.intp)
    return Spots(
        fit.uv_px, fit.height_dn, fit.shape_px2, clipped, none, fit.converged, index, cov_uv_px2=fit.cov_uv_px2
    )


def _no_spots() -> Spots:
    zero, none = np.zeros(0), np.zeros(0, dtype=np.intp)
    matrix = np.zeros((0, 2, 2))
    return Spots(np.zeros((0, 2)), zero, matrix, none, none, np.zeros(0, dtype=np.bool_), none, cov_uv_px2=matrix)


def _start_shapes(region_cov: Array, config: ExtractionConfig) -> Array:
    """Covariances (N, 2, 2) of the spots on the raw image from their regions' moments on the blurred one."""
    level = config.detect.region_level
    t = np.log(1.0 / level)
    # second moment of a Gaussian's part above `level`, weighted by what stands above, as a share of its variance
    share = (1.0 - (1.0 + t) * level - 0.5 * level * t * t) / (1.0 - level - level * t)
    values, vectors = np.linalg.eigh(region_cov / share - config.detect.blur_sigma_px**2 * np.eye(2))
    values = np.maximum(values, MIN_START_VARIANCE_PX2)
    return np.asarray(np.einsum("nij,nj,nkj->nik", vectors, values, vectors))


def _windows(centre: Array, shapes: Array, prepared: Prepared, config: ExtractionConfig) -> NDArray[np.int64]:
    """Left, top, columns, rows (N, 4) around the spots, inside the image."""
    rows, columns = prepared.image.shape
    half = np.ceil(config.localise.window_sigma * np.sqrt(np.diagonal(shapes, axis1=1, axis2=2)) + 2.0)
    half = np.clip(half, 4, config.localise.max_half_window_px)
    low, high = np.rint(centre) - half, np.rint(centre) + half + 1
    low, high = np.maximum(low, 0), np.minimum(high, [columns, rows])
    return np.hstack([low, high - low]).astype(np.int64)


def _starts(candidates: Candidates, index: NDArray[np.intp], shapes: Array, config: ExtractionConfig) -> Array:
    """Start parameters (N, 9) of the fits, in image pixels."""
    starts = np.zeros((len(index), 9))
    blurred = shapes + config.detect.blur_sigma_px**2 * np.eye(2)
    # the blur lowered the peak by √(det Σ / det (Σ + blur))
    height = candidates.height_dn[index] * np.sqrt(np.linalg.det(blurred) / np.linalg.det(shapes))
    precision = np.linalg.inv(shapes)
    starts[:, :2], starts[:, 2], starts[:, 6] = candidates.mean_uv_px[index], height, candidates.ring_dn[index]
    starts[:, 3], starts[:, 4], starts[:, 5] = precision[:, 0, 0], precision[:, 0, 1], precision[:, 1, 1]
    return starts
