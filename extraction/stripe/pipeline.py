"""A laser stripe's profile: detect, measure the noise, localise, select, carry into the laser plane."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from extraction.config import StripeConfig
from extraction.image import check_image
from extraction.noise import QUANTISATION_VARIANCE, PixelNoise
from extraction.sheet import image_to_sheet, propagate, sheet_table
from extraction.stripe.detect import SectionPeaks, detect
from extraction.stripe.fit import SECTION, SectionPlaces, fit_sections
from extraction.stripe.model import Limits, Records
from extraction.stripe.noise import estimate_noise
from extraction.stripe.normal import localise_along_normal
from extraction.stripe.plateau import join_plateaus
from extraction.stripe.profile import EDGE, SATURATED, SHAPE, Profile, StripePeaks
from extraction.stripe.select import connected, select
from extraction.stripe.view import StripeView, stripe_view
from geometry import Sensor

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SAMPLE = 320  # sections that are fitted first, for the noise and the width: some 3,000 pixels for three variances
_WIDTH_PX = 1.5  # expected before anything is known; the window follows what is found
_WIDTH_ERROR = 0.12  # relative, of the width expected from neighbouring sections; it steadies faint sections only


def extract_profile(
    image: NDArray[np.generic],
    sensor: Sensor,
    config: StripeConfig | None = None,
    laser_off: NDArray[np.generic] | None = None,
    mask: Mask | None = None,
) -> Profile:
    """The stripe of an image as points of the laser plane, section by section.

    Parameters
    ----------
    image
        Grey levels (H, W), uint8 or uint16, of the sensor's size.
    sensor
        A sensor with a camera.
    config
        Settings; the defaults where None.
    laser_off
        The same view without laser, of the same shape and type; subtracted.
    mask
        True where pixels may be used (H, W).

    Returns
    -------
    profile
        Peaks in the image, their points (y, z) in {P} [mm] and covariance of rank one. Points whose rays miss the sheet
        are left out.

    Raises
    ------
    InputError
        Where image, laser-off image, mask or region do not fit the sensor or each other.

    References
    ----------
    docs/stripes.md tells the stages and what they reach.
    """
    camera = sensor.require_camera()
    config = config or StripeConfig()
    image = check_image(image, sensor)
    if config.direction == "auto":
        config = config.model_copy(update={"direction": depth_direction(sensor)})
    peaks = detect_stripe(image, config, laser_off, mask, camera.saturation_dn, camera.black_level)
    yz, jacobian = sheet_table(sensor).lookup(peaks.uv_px)
    seen: Mask = np.asarray(np.isfinite(yz).all(axis=1))
    return Profile(peaks, yz, propagate(jacobian, peaks.cov_uv_px2))[seen]


def depth_direction(sensor: Sensor) -> str:
    """The image axis along which depth moves a point more, at the image's middle.

    Parameters
    ----------
    sensor
        A sensor with a camera.

    Returns
    -------
    direction
        "columns" where it is v, "rows" where it is u: what ``direction = "auto"`` means.
    """
    camera = sensor.require_camera()
    middle = np.array([[(camera.width_px - 1) / 2, (camera.height_px - 1) / 2]])
    jacobian = image_to_sheet(sensor, middle)[1][0]
    if not np.isfinite(jacobian).all():
        return "columns"
    px_per_mm = np.linalg.inv(jacobian)[:, 1]
    return "columns" if abs(px_per_mm[1]) >= abs(px_per_mm[0]) else "rows"


def detect_stripe(
    image: NDArray[np.generic],
    config: StripeConfig | None = None,
    laser_off: NDArray[np.generic] | None = None,
    mask: Mask | None = None,
    clip_dn: float | None = None,
    black_dn: float = 0.0,
) -> StripePeaks:
    """The stripe's peaks in an image, without a sensor.

    Parameters
    ----------
    image
        Grey levels (H, W), uint8 or uint16.
    config
        Settings; the defaults where None. Direction "auto" means columns here.
    laser_off, mask
        As of `extract_profile`.
    clip_dn
        Grey level from which a pixel is clipped; the type's largest where None.
    black_dn
        Grey level without light.

    Returns
    -------
    peaks
        One a section, unless ``select = "all"``, ordered along the stripe [px].

    Raises
    ------
    InputError
        Where the arrays or the region do not fit each other.
    """
    config = config or StripeConfig()
    view = stripe_view(image, config, laser_off, mask, clip_dn, black_dn)
    found = _joined(view, detect(view.grey, config.threshold_sigma, config.surround_px, config.max_peaks))
    noise, widths = _look_ahead(view, found, config)
    fits = _fit(view, found, widths, _WIDTH_ERROR, noise, config)
    good = np.flatnonzero(_acceptable(fits, config))
    good = good[connected(found.section[good], fits["centre"][good], config.min_run)]
    fits, section = fits[good], found.section[good]
    noise = _settle(noise, fits, config)
    chosen = select(config, section, fits["centre"].copy(), fits["amplitude"].copy())
    peaks = _peaks(view, section[chosen], fits[chosen], config)
    return localise_along_normal(view, peaks, noise, config) if config.along_normal else peaks


def _joined(view: StripeView, found: SectionPeaks) -> SectionPeaks:
    """The candidates, one for each clipped run; a run with one candidate is left as it is."""
    if not np.isfinite(view.clip_dn) or len(found) == 0:
        return found
    centre, high = found.centre_px.copy(), found.high.copy()
    keep = join_plateaus(view.grey, found.section, centre, high, view.clip_dn)
    return replace(found, section=found.section[keep], centre_px=centre[keep], low=found.low[keep], high=high[keep])


def _look_ahead(view: StripeView, found: SectionPeaks, config: StripeConfig) -> tuple[PixelNoise, Array]:
    """The frame's noise, and the width to be expected at each candidate, from every n-th of them."""
    some = np.arange(0, len(found), max(1, len(found) // _SAMPLE))
    guess = np.full(len(some), min(max(_WIDTH_PX, config.min_width_px), config.max_width_px))
    first = PixelNoise(max(found.noise_dn**2, QUANTISATION_VARIANCE), 0.0, view.black_dn, 0.0)
    fits = _fit(view, found.take(some), guess, np.inf, first, config)
    good = _acceptable(fits, config)
    section = found.section[some[good]]
    noise = estimate_noise(view, section, fits[good], config, 6 * found.noise_dn**2)
    if not good.any():
        return noise, np.full(len(found), _WIDTH_PX)
    steady = median_filter(fits["width"][good], size=min(9, int(good.sum())), mode="nearest")
    return noise, np.interp(found.section, section, steady)


def _settle(noise: PixelNoise, fits: Records, config: StripeConfig) -> PixelNoise:
    """The noise scaled to what all sections say, ``fits`` with it in place: the few first ones leave some per cent.

    Only where all of the noise is estimated, and robustly: sections that are no Gaussian peak keep their high χ².
    """
    if len(fits) < _SAMPLE or (config.read_noise_dn, config.gain_dn_per_e, config.speckle_contrast) != (None,) * 3:
        return noise
    ratio = fits["chi2"] / np.maximum(fits["dof"], 1)
    usual = (ratio <= 3 * np.median(ratio)) & (fits["dof"] > 0)
    if usual.sum() < _SAMPLE // 2:
        return noise
    scale = float(np.sum(fits["chi2"][usual]) / np.sum(fits["dof"][usual]))
    fits["chi2"] /= scale
    fits["variance"] *= scale
    return PixelNoise(scale * noise.floor, scale * noise.gain, noise.dark, scale * noise.speckle2)


def _fit(
    view: StripeView, found: SectionPeaks, widths: Array, width_error: float, noise: PixelNoise, config: StripeConfig
) -> Records:
    """The fits of all candidates (N,), records of SECTION; widths (N,): expected, with that relative error."""
    table = np.zeros(len(found), SECTION)
    places = SectionPlaces(found.section, found.centre_px, found.low, found.high, widths)
    limits = Limits(view.clip_dn, config.min_width_px, config.max_width_px)
    fit_sections(view.pixels, places, width_error, limits, noise, table)
    return table


def _acceptable(fits: Records, config: StripeConfig) -> Mask:
    """Which fits are a peak of a stripe: converged, high enough, neither too narrow nor too wide."""
    width = fits["width"]
    return np.asarray(
        fits["converged"]
        & (fits["amplitude"] >= config.min_amplitude_dn)
        & (fits["snr"] >= config.min_snr)
        & (width >= config.min_width_px)
        & (width <= config.max_width_px)
        & np.isfinite(fits["variance"])
    )


def _peaks(view: StripeView, section: NDArray[np.int32], fits: Records, config: StripeConfig) -> StripePeaks:
    chi2 = fits["chi2"] / np.maximum(fits["dof"], 1)
    near_border = np.minimum(fits["centre"] - fits["low"], fits["high"] - 1 - fits["centre"])
    flag = (
        SATURATED * (fits["clipped"] > 0)
        + SHAPE * (chi2 > config.max_chi2_per_dof)
        + EDGE * (near_border < 1.5 * fits["width"])
    )
    zero = np.zeros(len(section))
    return StripePeaks(
        section=section + np.int32(view.first_section),
        uv_px=view.uv_px(section.astype(float), fits["centre"]),
        normal=view.directions(zero, zero + 1),
        sigma_px=np.sqrt(fits["variance"]),
        amplitude_dn=fits["amplitude"].copy(),
        width_px=fits["width"].copy(),
        background_dn=fits["background"].copy(),
        chi2_per_dof=chi2,
        flag=flag.astype(np.uint8),
    )
