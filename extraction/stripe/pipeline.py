"""A laser stripe's profile: detect, measure the noise, localise, select, carry into the laser plane."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.image import check_image
from extraction.noise import QUANTISATION_VARIANCE, PixelNoise
from extraction.order import kth_smallest, positions_of
from extraction.sheet import image_to_sheet, propagate, sheet_table
from extraction.stripe.find import Found, find
from extraction.stripe.places import Places
from extraction.stripe.profile import AMBIGUOUS, EDGE, SATURATED, SHAPE, Profile, StripePeaks
from extraction.stripe.sections import (
    NEIGHBOURS,
    SECTION,
    STEP_PX,
    FitLimits,
    Ground,
    Records,
    SectionPlaces,
    SectionPoints,
    SigmaPlaces,
    estimate_noise,
    fit_faint,
    fit_pairs,
    fit_sections,
    ground_slopes,
    learn_ground,
    level_ground,
    localise_along_normal,
    off_course,
    tails_kept,
    true_sigma,
    walk_tails,
)
from extraction.stripe.select import select
from extraction.stripe.view import StripeView, stripe_view
from geometry import Sensor
from geometry.compiled import kernel

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_SAMPLE = 200  # sections that are fitted first, for the noise and the width: some 3,000 pixels for three variances
_SETTLED, _USUAL = 320, 3.0  # sections that settle the noise where nothing of it is stated; times the middle one's χ²
_STEADY = 9  # fits whose median width is expected
_DARK_DN2 = 1.0  # of the dark noise where too few sections say anything
_PIECE_GAP = 3  # sections without a point that end a piece
_NEAR_PX, _NEAR_WIDTHS = 1.5, 1.2  # from its stripe's track, that a section's fit may end: σ of the stripe and pixels
# of a stripe's sections, in which there may be no peak near its track: stripes with a laser have 0.03 at most in 600
# pictures drawn and real, what lamps make of metal, boards and busts 0.15 and more
_NO_PEAK, _SEEN = 0.1, 2.0  # the latter: amplitude over its σ, from which there is one
_WIDTH_ERROR = 0.12  # relative, of the width expected from neighbouring sections; it steadies faint sections only
_TAIL_WIDTH_ERROR = 1.0
_MOST_LOST = 0.5  # of a stripe's sections, to brighter ones
_GROUND_ROUNDS, _STEEP_GROUND = 2, 0.1  # of fits and the ground that they leave: on a steep one, whose slope times σ
# is so much of the amplitude, the first fits are off by a third of σ
_ABOUT_END = 20  # points inside an end, whose σ beside the pixels' own its tail takes


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
        Peaks in the image, their points (y, z) in {P} [mm] and covariance of rank one; beside it what the sensor's own
        calibration leaves unknown. Points whose rays miss the sheet are left out.

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
    light = (laser_off, mask, camera.saturation_dn, camera.black_level)
    first = depth_direction(sensor) if config.direction == "auto" else config.direction
    peaks = _detect(image, config.model_copy(update={"direction": first}), *light, tails=True)
    if len(peaks) == 0 and config.direction == "auto":
        peaks = _detect(image, config, *light, tails=True)
    profile = _in_the_sheet(peaks, sensor)
    return profile if peaks.tails is None else replace(profile, tails=_in_the_sheet(peaks.tails, sensor))


def _in_the_sheet(peaks: StripePeaks, sensor: Sensor) -> Profile:
    yz, jacobian = sheet_table(sensor).lookup(peaks.uv_px)
    seen: Mask = np.asarray(np.isfinite(yz).all(axis=1))
    return Profile(replace(peaks, tails=None), yz, propagate(jacobian, peaks.cov_uv_px2))[seen].with_sensor(sensor)


def depth_direction(sensor: Sensor) -> str:
    """The image axis along which depth moves a point more, at the image's middle.

    Parameters
    ----------
    sensor
        A sensor with a camera.

    Returns
    -------
    direction
        "columns" where it is v, "rows" where it is u: the direction that ``direction = "auto"`` tries first.
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
        Settings; the defaults where None. Direction "auto" means the one along which the image shows more stripe.
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
    return _detect(image, config or StripeConfig(), laser_off, mask, clip_dn, black_dn)


def _detect(
    image: NDArray[np.generic], config: StripeConfig, laser_off: NDArray[np.generic] | None, mask: Mask | None,
    clip_dn: float | None, black_dn: float, tails: bool = False,
) -> StripePeaks:  # fmt: skip
    """`detect_stripe`, with the sections beyond the ends where they are asked for."""
    found = find(stripe_view(image, config, laser_off, mask, clip_dn, black_dn), config)
    return _localise(found, config, tails)


def _localise(found: Found, config: StripeConfig, tails: bool) -> StripePeaks:
    """The stripes that were found, section by section; tails: and what lies beyond their ends."""
    view, places = found.view, found.places
    noise, widths, ground = _look_ahead(view, places, config)
    fits = _fit(view, places, widths, _WIDTH_ERROR, ground, noise, config)
    fits = fit_pairs(view, places, fits, noise, config)
    fits = fit_faint(view, places, fits, config.min_snr)
    near = _near(fits, places.centre_px, places.width_px, config.min_width_px, config.max_width_px)
    lit = np.ones(len(places), np.bool_) if found.lit is None else found.lit
    _doubt_gappy((near & (fits["snr"] >= _SEEN)) | ~lit, places.stripe, places.doubt)
    if found.lit is not None and len(places):
        course = np.array([s.course for s in found.stripes], np.int32)[places.stripe]
        away = off_course(places.section, course, fits, near & lit)
        places.doubt[away | ~lit] = True
        near &= lit | ~away
    high = (fits["amplitude"] >= config.min_amplitude_dn) & (fits["snr"] >= config.min_snr)
    good = np.flatnonzero(near & high & np.isfinite(fits["variance"]))
    refused = dict(found.refused)
    if len(good) < len(places):
        refused["no_fit"] = len(places) - len(good)
        fits = fits[good]
        places, ground = places.take(good), ground.take(good)
    told = (config.read_noise_dn, config.gain_dn_per_e, config.speckle_contrast) != (None,) * 3
    if not told and len(fits) >= _SETTLED:
        scale = _settle(fits, places.ghost, _USUAL)
        noise = PixelNoise(scale * noise.floor, scale * noise.gain, noise.dark, scale * noise.speckle2)
    by_pixels = fits["variance"].copy()
    length = max(
        true_sigma(SigmaPlaces(places.section, places.stripe, places.faint, places.ghost), fits),
        float(NEIGHBOURS) if places.faint.any() else 0.0,
    )
    chosen = select(config, found.stripes, places, fits["centre"].copy(), fits["amplitude"].copy())
    if len(chosen) < len(places):
        if config.select == "stripe":
            _doubt_rests(places.stripe, places.stripe[chosen], places.doubt)
        fits, places, by_pixels = fits[chosen], places.take(chosen), by_pixels[chosen]
        ground = ground.take(chosen)
    peaks = _peaks(view, places, fits, config, length, refused)
    beyond, ground_beyond = None, ground
    if tails and len(peaks):
        beyond, ground_beyond = _tails(view, places, fits, ground, peaks.piece, by_pixels, noise, config)
    if not config.along_normal:
        return peaks if beyond is None else replace(peaks, tails=beyond)
    if beyond is None:
        return localise_along_normal(view, peaks, ground, noise, config)
    whole = peaks.joined(beyond)
    order = np.argsort(whole.section, kind="stable")
    whole = localise_along_normal(view, whole[order], ground.joined(ground_beyond).take(order), noise, config)
    return replace(whole[order < len(peaks)], tails=whole[order >= len(peaks)])


def _tails(
    view: StripeView, places: Places, fits: Records, ground: Ground, piece: NDArray[np.int32], by_pixels: Array,
    noise: PixelNoise, config: StripeConfig,
) -> tuple[StripePeaks, Ground]:  # fmt: skip
    """Beyond the ends of the pieces: the sections that still hold light, and the ground there, which is the end's.

    by_pixels: variances (N,) by noise alone.
    """
    light = fits["amplitude"] * fits["width"]
    points = SectionPoints(places.section, fits["centre"].copy(), fits["width"].copy(), light, piece)
    found = walk_tails(view.grey, points, math.sqrt(max(noise.floor, QUANTISATION_VARIANCE)))
    n, rows = len(found.section), np.full(len(found.section), view.grey.shape[0], np.int32)
    table = np.zeros(n, SECTION)
    limits = FitLimits(view.clip_dn, config.min_width_px, config.max_width_px)
    beyond = ground.take(found.end).about(found.centre)
    asked = SectionPlaces(found.section, found.centre, np.zeros(n, np.int32), rows, found.width, beyond)
    fit_sections(view.pixels, asked, _TAIL_WIDTH_ERROR, limits, noise, table)
    kept = tails_kept(found, table, config.min_snr, config.min_amplitude_dn)
    table, end = table[kept], found.end[kept]
    for last in np.unique(end):
        about = np.flatnonzero((piece == piece[last]) & (np.abs(places.section - places.section[last]) <= _ABOUT_END))
        scatter, noisy = fits["variance"][about], by_pixels[about]
        own, more = table["variance"][end == last], float(np.median(scatter - noisy))
        table["variance"][end == last] = own + more if more > 0 else own * float(np.median(scatter / noisy))
    rows, low, minus = rows[: len(end)], np.zeros(len(end), np.int32), np.full(len(end), -1, np.int32)
    facts = places.stripe[end], minus, places.faint[end], places.ghost[end], places.doubt[end]
    there = Places(found.section[kept], found.centre[kept], low, rows, found.width[kept], *facts)
    return replace(_peaks(view, there, table, config, 0.0, {}), piece=piece[end]), beyond.take(np.flatnonzero(kept))


def _look_ahead(view: StripeView, places: Places, config: StripeConfig) -> tuple[PixelNoise, Array, Ground]:
    """The frame's noise, and the width and ground to be expected at each place, from every n-th of them."""
    usable = (places.partner < 0) & ~places.ghost
    alone = np.flatnonzero(usable if usable.any() else places.partner < 0)
    chosen = alone[:: max(1, len(alone) // _SAMPLE)]
    sample, ground = places.take(chosen), level_ground()
    first = PixelNoise(1.0, 0.0, view.black_dn, 0.0)  # equal weights
    fits = _fit(view, sample, sample.width_px, np.inf, ground, first, config)
    good = _near(fits, sample.centre_px, sample.width_px, config.min_width_px, config.max_width_px)
    if ground_slopes(view.pixels, sample.section[good], sample.stripe[good], fits[good], view.clip_dn):
        ground = _ground(view, places, first, config)
        fits = _fit(view, sample, sample.width_px, np.inf, ground.take(chosen), first, config)
        good = _near(fits, sample.centre_px, sample.width_px, config.min_width_px, config.max_width_px)
    noise = estimate_noise(
        view, sample.section[good], fits[good], ground.take(chosen).take(np.flatnonzero(good)), config, _DARK_DN2
    )
    widths = places.width_px.copy()
    _expect(sample.section[good], sample.stripe[good], fits[good], places.section, places.stripe, widths)
    return noise, widths, ground


def _ground(view: StripeView, places: Places, noise: PixelNoise, config: StripeConfig) -> Ground:
    """The ground under all places (N,), that slopes somewhere."""
    n, rows, ground = len(places), (places.low, places.high), level_ground()
    for _ in range(_GROUND_ROUNDS):
        fits = _fit(view, places, places.width_px, np.inf, ground, noise, config)
        good = _near(fits, places.centre_px, places.width_px, config.min_width_px, config.max_width_px)
        good &= (places.partner < 0) & (fits["dof"] > 0)
        ground = Ground(places.centre_px.copy(), np.ones(n), np.zeros(n), np.zeros(n), np.zeros(n))
        learn_ground(view.pixels, places.section, places.stripe, rows, fits, good, view.clip_dn, ground)
        pull = np.abs(ground.slope[good]) * fits["width"][good] / fits["amplitude"][good]  # a third of the shift over σ
        if not np.any(pull > _STEEP_GROUND):
            break
    return ground


@kernel
def _expect(
    section: NDArray[np.int32], stripe: NDArray[np.int32], fits: Records, all_section: NDArray[np.int32],
    all_stripe: NDArray[np.int32], widths: Array,
) -> None:  # fmt: skip
    """Widths (N,) at all places from those of the sample (M,), stripe by stripe: a running median, then straight
    lines.
    """
    own, steady, some = np.empty(len(section), np.int64), np.empty(len(section)), np.empty(_STEADY)
    stripes = 0
    for k in all_stripe:
        stripes = max(stripes, k + 1)
    for k in range(stripes):
        n = positions_of(stripe, k, own)
        if n == 0:
            continue
        size = min(_STEADY, n)
        for i in range(n):
            for j in range(size):
                some[j] = fits[own[min(max(i - size // 2 + j, 0), n - 1)]].width
            steady[i] = kth_smallest(some[:size], size // 2)
        at = 0
        for i in range(len(all_section)):
            if all_stripe[i] != k:
                continue
            s = all_section[i]
            while at + 1 < n and section[own[at + 1]] <= s:
                at += 1
            a, b = section[own[at]], section[own[min(at + 1, n - 1)]]
            t = min(max((s - a) / (b - a), 0.0), 1.0) if b > a else 0.0
            widths[i] = (1 - t) * steady[at] + t * steady[min(at + 1, n - 1)]


@kernel
def _settle(fits: Records, ghost: Mask, most: float) -> float:
    """How much larger the noise is than was expected, by all sections (N,); 1 where too few say so.

    ``fits`` with it in place. Robust: sections that are no Gaussian peak keep their high χ². most: over the median.
    """
    ratio, n = np.empty(len(fits)), len(fits)
    for i in range(n):
        ratio[i] = fits[i].chi2 / max(fits[i].dof, 1.0)
    usual = most * kth_smallest(ratio, n // 2)
    count, chi2, dof = 0, 0.0, 0.0
    for i in range(n):
        row = fits[i]
        if not ghost[i] and row.dof > 0 and row.chi2 <= usual * row.dof:
            count, chi2, dof = count + 1, chi2 + row.chi2, dof + row.dof
    if count < _SETTLED // 2:
        return 1.0
    for i in range(n):
        fits[i].chi2 /= chi2 / dof
        fits[i].variance *= chi2 / dof
    return chi2 / dof


def _fit(
    view: StripeView, places: Places, widths: Array, width_error: float, ground: Ground, noise: PixelNoise,
    config: StripeConfig,
) -> Records:  # fmt: skip
    """The fits of all places (N,), records of SECTION; widths (N,): expected, with that relative error."""
    table = np.zeros(len(places), SECTION)
    asked = SectionPlaces(places.section, places.centre_px, places.low, places.high, widths, ground)
    limits = FitLimits(view.clip_dn, config.min_width_px, config.max_width_px)
    fit_sections(view.pixels, asked, width_error, limits, noise, table)
    return table


@kernel
def _near(fits: Records, centre: Array, expected: Array, least: float, most: float) -> Mask:
    """Which fits settled on their stripe's track, as wide as a stripe may be. least, most: of the width [px]."""
    out = np.zeros(len(fits), np.bool_)
    for i in range(len(fits)):
        row = fits[i]
        reach = _NEAR_PX + _NEAR_WIDTHS * max(expected[i], row.width)
        out[i] = row.converged and least <= row.width <= 1.5 * most and abs(row.centre - centre[i]) <= reach
    return out


@kernel
def _doubt_gappy(seen: Mask, stripe: NDArray[np.int32], doubt: Mask) -> None:
    """Doubt every point (N,) of a stripe that is no peak near its track in many of its sections.

    A laser draws a peak in each; what a lamp makes of a surface is one here and none there. Where such stripes have
    most of the sections, the picture is doubtful as a whole.
    """
    stripes = 0
    for k in stripe:
        stripes = max(stripes, k + 1)
    total, lost = np.zeros(stripes, np.int64), np.zeros(stripes, np.int64)
    for i in range(len(stripe)):
        total[stripe[i]] += 1
        lost[stripe[i]] += not seen[i]
    gappy = 0
    for i in range(len(stripe)):
        own = lost[stripe[i]] > _NO_PEAK * total[stripe[i]]
        doubt[i], gappy = doubt[i] or own, gappy + own
    if gappy > 0.5 * len(stripe):
        doubt[:] = True


def _doubt_rests(stripe: NDArray[np.int32], chosen: NDArray[np.int32], doubt: Mask) -> None:
    """Doubt what is left of a stripe that lost most of its points (N,) to brighter ones: glare, or a mirror image.

    chosen: the stripe of each point that is given (M,).
    """
    total = np.bincount(stripe)
    kept = np.bincount(chosen, minlength=len(total))
    doubt[(kept < (1 - _MOST_LOST) * total)[stripe]] = True


def _peaks(
    view: StripeView, places: Places, fits: Records, config: StripeConfig, length: float, refused: dict[str, int]
) -> StripePeaks:
    """The fits (N,) as points of the image. length: of the correlation, in sections. refused: ridges by reason."""
    section = places.section
    centre, sigma, chi2, flag = (np.empty(len(section), t) for t in (float, float, float, np.uint8))
    _facts(fits, places.doubt, config.max_chi2_per_dof, centre, sigma, chi2, flag)
    zero = np.zeros(len(section))
    return StripePeaks(
        section=section + np.int32(view.first_section),
        uv_px=view.uv_px(section, centre),
        normal=view.directions(zero, zero + 1),
        sigma_px=sigma,
        amplitude_dn=fits["amplitude"].copy(),
        width_px=fits["width"].copy(),
        background_dn=fits["background"].copy(),
        chi2_per_dof=chi2,
        flag=flag,
        piece=_pieces(section, places.stripe, centre),
        correlation_sections=length,
        refused=refused,
    )


@kernel
def _facts(
    fits: Records, doubt: Mask, most_chi2: float, centre: Array, sigma: Array, chi2: Array, flag: NDArray[np.uint8]
) -> None:
    """Centre, its σ, χ² per degree of freedom and flag of each fit (N,)."""
    for i in range(len(fits)):
        row = fits[i]
        centre[i], sigma[i], chi2[i] = row.centre, math.sqrt(row.variance), row.chi2 / max(row.dof, 1.0)
        clipped, misshapen = SATURATED * (row.clipped > 0), SHAPE * (chi2[i] > most_chi2)
        cut = EDGE * (min(row.centre - row.low, row.high - 1 - row.centre) < 1.5 * row.width)
        flag[i] = clipped + misshapen + cut + AMBIGUOUS * doubt[i]


@kernel
def _pieces(section: NDArray[np.int32], stripe: NDArray[np.int32], centre: Array) -> NDArray[np.int32]:
    """Pieces in the order in which they begin: runs of sections of one stripe without a step (N,)."""
    out = np.zeros(len(section), np.int32)
    stripes = 0
    for k in stripe:
        stripes = max(stripes, k + 1)
    last, number, count = np.full(stripes, -1000), np.zeros(stripes, np.int32), 0
    place = np.zeros(stripes)
    for i in range(len(section)):
        k = stripe[i]
        gap = section[i] - last[k]
        if gap > _PIECE_GAP or abs(centre[i] - place[k]) > STEP_PX * gap:
            number[k] = count
            count += 1
        last[k], place[k] = section[i], centre[i]
        out[i] = number[k]
    return out
