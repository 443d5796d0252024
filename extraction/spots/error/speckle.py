"""Contrast and grain of the speckle, as the residuals of fitted spots show them."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import j1

from extraction.config import MAX_GRAIN_PX
from extraction.spots.error.budget import ErrorBudget
from extraction.spots.error.influence import CLASSES, LAGS
from extraction.spots.noise import PRIOR_CONTRAST
from geometry import Camera, Sensor

Array = NDArray[np.float64]

# what is expected where an image does not tell, with its spread (ln). Contrast: unpolarised light's, over a pixel, of
# the grain of F/4 and pixels of 5.5 µm (Goodman 2007, section 4.6); grain: λF#(1 + m) of red light by F/3 to F/8 and
# pixels of 5 µm. 30 spots outweigh the contrast's, six frames of five just the grain's (docs/spots.md)
PRIOR_CONTRAST_LN = 0.3
PRIOR_GRAIN_PX, PRIOR_GRAIN_LN = 0.7, 0.5
NO_SPECKLE = 0.01  # probability before looking that an image has none, or any other contrast
CONTRASTS = np.geomspace(0.003, 1.0, 300)  # nodes of the posterior, 2 % apart
GRAINS_PX = np.geomspace(0.2, MAX_GRAIN_PX, 40)  # nodes, 6 % apart; finer ones are averaged out within a pixel
VARIANCES = CONTRASTS**2
USUAL_CONTRAST = np.exp(-0.5 * (np.log(CONTRASTS / PRIOR_CONTRAST) / PRIOR_CONTRAST_LN) ** 2) + NO_SPECKLE
UNUSUAL_GRAIN = (np.log(GRAINS_PX / PRIOR_GRAIN_PX) / PRIOR_GRAIN_LN) ** 2
NODES = 20  # of a pixel's side
# contrast that strings' departure from a Gaussian leaves in the residuals without any speckle or noise: 0.006 for
# strings of 0.3 mm, 0.02 of 0.5 mm, 0.06 of 1 mm (benchmarks/extraction_model_error.py)
SHAPE_CONTRAST = 0.02
JUST_HALF = 0.5 - 1e-9  # of equal halves the lower one holds the median
OUTLYING = 5.0  # times the median variance
FREEDOM = 1.5  # independent residuals per unit of Σ signal² over the height's square
MAX_CONTRAST = 1.0  # fully developed; larger residuals are those of something that is no Gaussian spot


@dataclass(frozen=True)
class Speckle:
    """Speckle of a pixel: its standard deviation over the signal, and the grain λF#(1 + m) on the chip [px]."""

    contrast: float
    grain_px: float

    @property
    def variances(self) -> Array:
        """Contrast² · ρ for the classes of distance of `influence` (CLASSES,)."""
        return np.asarray(self.contrast**2 * correlation(self.grain_px))


def optical_grain_px(sensor: Sensor) -> float | None:
    """The grain λF#(1 + m) on the chip that a sensor's stated optics give.

    Parameters
    ----------
    sensor : Sensor
        With a camera. Its magnification m is that at the stated distance in focus, else where its axis meets the sheet.

    Returns
    -------
    float or None
        Grain [px], no coarser than pixels can tell; None where wavelength, pixel pitch or F-number are not stated.

    References
    ----------
    Goodman, Speckle Phenomena in Optics (2007), section 4.5; Dorsch, Häusler & Herrmann (1994).
    """
    optics = sensor.optics
    if optics is None or optics.wavelength_nm is None or optics.pixel_um is None or optics.f_number is None:
        return None
    camera = sensor.require_camera()
    principal_mm = (camera.fx_px + camera.fy_px) / 2 * optics.pixel_um * 1e-3
    magnification = principal_mm / (optics.focus_distance_mm or _sheet_on_axis_mm(camera))
    grain = optics.wavelength_nm * 1e-3 * optics.f_number * (1 + magnification) / optics.pixel_um
    return min(grain, MAX_GRAIN_PX)


def _sheet_on_axis_mm(camera: Camera) -> float:
    """Distance from the camera's centre along its axis to the sheet [mm]; infinite where they do not meet."""
    towards = float(camera.T_sensor_camera.R[0, 2])
    distance = -float(camera.centre_mm[0]) / towards if towards else math.inf
    return distance if distance > 0 else math.inf


def _pupil_correlations() -> Array:
    """ρ (grains, CLASSES) of two pixels: that of a round pupil's speckle, (2 J₁(x)/x)² with x = π r/grain, over both.

    Two pixels at a lag are uniform points whose difference has a triangle's distribution in u and in v. Source:
    Goodman, Speckle Phenomena in Optics (2007), sections 4.4 and 4.6.
    """
    t = (np.arange(-NODES, NODES) + 0.5) / NODES
    triangle = (1.0 - np.abs(t)) / NODES
    lags = np.array([LAGS[LAGS[:, 0] == k][-1, 1:] for k in range(CLASSES)])
    r = np.hypot(lags[:, 0, None, None] + t[:, None], lags[:, 1, None, None] + t)
    x = np.pi * r / GRAINS_PX[:, None, None, None]
    covariance = np.einsum("gkij,i,j->gk", (2.0 * j1(x) / x) ** 2, triangle, triangle)
    return np.asarray(covariance / covariance[:, :1])


GRAIN_CORRELATIONS = _pupil_correlations()


def correlation(grain_px: float) -> Array:
    """Correlation of the speckle of two pixels by the classes of their distance.

    Parameters
    ----------
    grain_px
        λF#(1 + m) on the chip; grains outside 0.2 to 1.7 px are taken as these ends.

    Returns
    -------
    rho
        (CLASSES,), 1 for a pixel with itself.

    References
    ----------
    Goodman, Speckle Phenomena in Optics (2007), sections 4.4 and 4.6: a round pupil's, integrated over both pixels.
    """
    place = float(np.interp(grain_px, GRAINS_PX, np.arange(len(GRAINS_PX))))
    low = min(int(place), len(GRAINS_PX) - 2)
    return np.asarray(GRAIN_CORRELATIONS[low] + (place - low) * (GRAIN_CORRELATIONS[low + 1] - GRAIN_CORRELATIONS[low]))


def estimate_speckle(
    budget: ErrorBudget, good: NDArray[np.bool_], contrast: float | None = None, grain_px: float | None = None
) -> Speckle:
    """Speckle from the error budgets of the fitted spots ``good`` (N,); what is given is kept.

    Moments: the residuals' variance over the signal's square gives the contrast, the product of neighbours the grain;
    both under a prior, as a spot or two tell little: `learn_speckle` asks many images.
    """
    good = good & _alike(budget, good)
    if grain_px is None:
        grain_px = _grain(budget, good)
    if contrast is None:
        contrast = _contrast(budget, good, grain_px)
    return Speckle(contrast, grain_px)


def _alike(budget: ErrorBudget, good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The spots whose residuals are like most light's: what is no Gaussian does not speak for them."""
    expected = budget.variance_speckle @ correlation(PRIOR_GRAIN_PX)
    usable = good & np.isfinite(budget.variance) & (expected > 0)
    if not np.any(usable):
        return usable
    share = np.where(usable, budget.variance / np.where(usable, expected, 1.0), np.inf)
    order = np.argsort(share[usable], kind="stable")
    weight = np.cumsum(expected[usable][order])
    median = share[usable][order][np.searchsorted(weight, JUST_HALF * weight[-1])]
    return np.asarray(usable & (share < MAX_CONTRAST**2) & (share <= max(OUTLYING * median, PRIOR_CONTRAST**2)))


def _contrast(budget: ErrorBudget, good: NDArray[np.bool_], grain_px: float) -> float:
    """Root mean square of the posterior: the residuals' variance is Gamma distributed about camera and speckle."""
    pixels = float(budget.variance_speckle[good].sum(axis=0) @ correlation(grain_px))
    if pixels <= 0:
        return PRIOR_CONTRAST
    camera = max(float(budget.variance_camera[good].sum()) / pixels, 1e-9)
    observed = max(float(budget.variance[good].sum()) / pixels + camera, 0.0)
    variance = VARIANCES + (camera + SHAPE_CONTRAST**2)
    cost = FREEDOM * pixels * (np.log(variance) + observed / variance)
    likely = np.exp(-0.5 * (cost - cost.min())) * USUAL_CONTRAST
    return math.sqrt(float(likely @ VARIANCES) / float(np.sum(likely)))


def _grain(budget: ErrorBudget, good: NDArray[np.bool_]) -> float:
    """Mean of the posterior of the grain, from the product of neighbours: unsure where that may be the spots' shape."""
    variance = float(budget.variance[good].sum())
    if variance <= 0:
        return PRIOR_GRAIN_PX
    observed = float(budget.neighbour[good].sum()) / variance
    rho = GRAIN_CORRELATIONS
    ratio = (rho @ budget.neighbour_speckle[good].sum(axis=0)) / (rho @ budget.variance_speckle[good].sum(axis=0))
    pixels = float(budget.variance_speckle[good, 0].sum())
    error2 = 1.0 / (FREEDOM * pixels) + (SHAPE_CONTRAST**2 * pixels / variance) ** 2
    cost = (observed - ratio) ** 2 / error2 + UNUSUAL_GRAIN
    likely = np.exp(-0.5 * (cost - cost.min()))
    return float(np.sum(likely * GRAINS_PX) / np.sum(likely))
