"""Positions of the candidates by maximum likelihood of an oriented Gaussian, with their covariance."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from extraction.config import ExtractionConfig
from extraction.noise import NOISE
from extraction.spots.detect import Candidates, PreparedImage
from extraction.spots.fast import fit_peaks
from extraction.spots.fit import FIT, PLACE, FittedSpots, Windows
from extraction.spots.frame import Fits, SpotImage, Tasks, fit_frame
from extraction.spots.model import FLAT, SLOPED, SPOT, shapes_px2
from extraction.spots.noise import PRIOR_CONTRAST, FrameNoise
from extraction.spots.start import Regions, StartRule, start_fits

Array = NDArray[np.float64]

SLOPE_SIGMA = 4.0  # surroundings that differ by more across the spot are fitted with a slope
MAX_RING_VARIANCE = 25.0  # of the frame's noise: an uneven ring is not noise


@dataclass(frozen=True, eq=False)
class JointErrors:
    """One spot's part of a joint fit's errors, as of `ErrorBudget`: camera, white (2, 2), speckle (2, 2, K)."""

    camera: Array
    speckle: Array
    white: Array


@dataclass(frozen=True, eq=False)
class LocalisedSpots:
    """Localised spots of one image.

    uv_px (N, 2): position. amplitude_dn (N,): peak above the background.
    shape_px2 (N, 2, 2): covariance of the spot's light, the pixel's own share taken off.
    clipped, foreign (N,): pixels left out as saturated, and as part of something else.
    converged (N,). candidate (N,): index into the candidates.
    fits: for the errors; without it (the fast method) cov_uv_px2 (N, 2, 2) holds them.
    merged (N,): two spots too near to be taken apart; None where it was not looked at. joint: by index, the errors of
    spots that were fitted jointly with another.
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
    merged: NDArray[np.bool_] | None = None
    joint: Mapping[int, JointErrors] = field(default_factory=dict)

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


def localise(
    prepared: PreparedImage, candidates: Candidates, noise: FrameNoise, config: ExtractionConfig
) -> LocalisedSpots:
    """Localise every candidate that was not refused."""
    index = np.flatnonzero(candidates.refusal == 0)
    if config.localise.method == "fast":
        return _fast(prepared, candidates, index, noise)
    if not len(index):
        return _no_spots()
    return _fit(prepared, candidates, index, noise, config)


def _fit(
    prepared: PreparedImage,
    candidates: Candidates,
    index: NDArray[np.intp],
    noise: FrameNoise,
    config: ExtractionConfig,
) -> LocalisedSpots:
    n, detect, rule = len(index), config.detect, config.localise
    ring_noise, ring, height = candidates.ring_noise_dn[index], candidates.ring_dn[index], candidates.height_dn[index]
    tasks = Tasks(np.zeros(n, PLACE), np.zeros(n, SPOT), np.zeros(n, NOISE))
    start_fits(
        Regions(candidates.mean_uv_px[index], candidates.cov_uv_px2[index], height, ring),
        StartRule(
            _region_share(detect.region_level), detect.blur_sigma_px, rule.window_sigma, float(rule.max_half_window_px),
            *prepared.image.shape,
        ),
        tasks.place, tasks.start,
    )  # fmt: skip
    tasks.place["candidate"] = index
    tasks.place["terms"] = np.where(candidates.uneven_dn[index] > SLOPE_SIGMA * ring_noise, SLOPED, FLAT)
    variance = (ring_noise / np.sum(prepared.kernel**2)) ** 2
    floor = np.minimum(np.maximum(variance, noise.variance_dn2), MAX_RING_VARIANCE * noise.variance_dn2)
    tasks.noise["floor"], tasks.noise["dark"], tasks.noise["gain"] = floor, ring, noise.gain_dn_per_e
    tasks.noise["speckle2"] = noise.speckle_weight**2
    tasks.noise["model2"] = (noise.model_error * tasks.start["height"]) ** 2
    size = (n, int(tasks.place["rows"].max()), int(tasks.place["columns"].max()))
    windows, found = (
        Windows(np.zeros(size), np.zeros(size, dtype=np.bool_)),
        FittedSpots(np.zeros(n, SPOT), np.zeros(n, FIT)),
    )
    view = SpotImage(prepared.image, candidates.owner, candidates.height_dn, noise.saturation_dn)
    fit_frame(view, tasks, rule.max_iterations, windows, found)
    spot, fit = found
    return LocalisedSpots(
        uv_px=np.stack([spot["u"] + tasks.place["left"], spot["v"] + tasks.place["top"]], axis=1),
        amplitude_dn=spot["height"],
        shape_px2=shapes_px2(spot),
        clipped=fit["clipped"],
        foreign=fit["foreign"],
        converged=fit["converged"],
        candidate=index,
        fits=Fits(windows, tasks.place, spot, tasks.noise),
    )


def _fast(
    prepared: PreparedImage, candidates: Candidates, index: NDArray[np.intp], noise: FrameNoise
) -> LocalisedSpots:
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
    return LocalisedSpots(
        fit.uv_px, fit.height_dn, fit.shape_px2, clipped, none, fit.converged, index, cov_uv_px2=fit.cov_uv_px2
    )


def _no_spots() -> LocalisedSpots:
    zero, none = np.zeros(0), np.zeros(0, dtype=np.intp)
    matrix = np.zeros((0, 2, 2))
    return LocalisedSpots(
        np.zeros((0, 2)), zero, matrix, none, none, np.zeros(0, dtype=np.bool_), none, cov_uv_px2=matrix
    )


def _region_share(level: float) -> float:
    """Second moment of a Gaussian's part above ``level``, weighted by what stands above, as a share of its variance."""
    t = math.log(1.0 / level)
    return (1.0 - (1.0 + t) * level - 0.5 * level * t * t) / (1.0 - level - level * t)
