"""What the residuals say of the noise: over the stated σ, along a stripe, and of whole views."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.engine import Result
from calib.sensor.bundle import SensorBundle
from calib.sensor.condensed import condensed_stripes
from calib.sensor.left_out import BOARD_FREEDOM
from calib.sensor.terms import StripeNoise
from geometry import State

Array = NDArray[np.float64]

_LINE_FREEDOM = 2
_FEWEST_PAIRS = 20  # of points at a lag, over all views
_CHANCE = 2.0  # standard deviations that whole stripes may scatter beyond their own noise before it counts
_QUIET = 0.1  # correlation that is as good as none


def with_noise(bundle: SensorBundle, result: Result, offsets: bool = True) -> SensorBundle:
    """The bundle with the noise that the residuals of a solution show; χ² per degree of freedom is then near 1."""
    white = bundle.corner_term.independent_rows(result.state).residual
    dof = white.size - BOARD_FREEDOM * len(bundle.views) - int(result.unknowns.free.sum())
    scale = bundle.corner_scale * float(np.sqrt(np.sum(white**2) / max(dof, 1)))
    bundle = replace(bundle, corner_scale=max(scale, 1e-6))
    if not bundle.has_plane:
        return bundle
    noise = _along_stripes(bundle, result.state)
    bundle = replace(bundle, stripe_noise=noise)
    if not offsets:
        return bundle
    offset = condensed_stripes(bundle, result).common_error(by_chance=_CHANCE)
    return replace(bundle, stripe_noise=replace(noise, offset_px=offset))


def first_noise(bundle: SensorBundle, boards: Result) -> SensorBundle:
    """The bundle with the noise of a solution by corners alone, before stripes and corners are weighed together.

    boards: that solution, a plane through its stripes' points in its state.
    """
    alone = with_noise(bundle.without_stripes(), boards)
    noise = _along_stripes(bundle, boards.state)
    rows, member = bundle.stripe_term.errors(boards.state), bundle.views.view_of_stripe
    count = np.bincount(member, minlength=len(bundle.views))
    means = np.bincount(member, rows.residual, len(bundle.views))[count > 0] / count[count > 0]
    offset = float(np.sqrt(np.mean(means**2)))
    return replace(bundle, corner_scale=alone.corner_scale, stripe_noise=replace(noise, offset_px=offset))


def _along_stripes(bundle: SensorBundle, state: State) -> StripeNoise:
    """Scale and length of likeness within the views, each freed of a straight line.

    The length is the sum of the correlations up to where they vanish: a board's bend and speckle are in it alike.
    """
    rows = bundle.stripe_term.errors(state)
    uv, member = bundle.views.stripe.uv_px, bundle.views.view_of_stripe
    products, pairs = np.zeros(0), np.zeros(0)
    variance = np.full(len(bundle.views), np.nan)
    for v in range(len(bundle.views)):
        mine = member == v
        if mine.sum() <= 3 * _LINE_FREEDOM:
            continue
        along = np.linalg.norm(uv[mine] - uv[mine][0], axis=1)
        sigma = bundle.views.stripe.sigma_px[mine]
        basis = np.stack([np.ones_like(along), along], 1) / sigma[:, None]
        z = rows.residual[mine] / sigma
        z = z - basis @ np.linalg.lstsq(basis, z, rcond=None)[0]
        product, pair = _lagged(np.round(along).astype(int), z)
        variance[v] = product[0] / (pair[0] - _LINE_FREEDOM)
        products, pairs = _sum(products, product / variance[v]), _sum(pairs, pair)
    if not len(pairs):
        return bundle.stripe_noise
    usual = float(np.nanmedian(variance))
    return StripeNoise(np.sqrt(np.where(np.isnan(variance), usual, variance)), _length(products, pairs))


def _length(products: Array, pairs: Array) -> float:
    """The sum of the correlations [px] beyond the point itself, up to where they vanish; lags without pairs bridged."""
    lags = np.flatnonzero(pairs >= _FEWEST_PAIRS)
    alike = products[lags] / pairs[lags] / max(products[0] / pairs[0], 1e-300)
    end = int(np.argmax(alike < _QUIET)) if np.any(alike < _QUIET) else len(alike)
    if end <= 1:
        return 0.0
    between = np.sum(np.diff(lags[:end]) * (alike[1:end] + alike[: end - 1]) / 2)
    return float(between + (lags[min(end, len(lags) - 1)] - lags[end - 1]) * alike[end - 1] / 2 - 0.5)


def _lagged(at_px: NDArray[np.intp], z: Array) -> tuple[Array, Array]:
    """Sums of products of values that many pixels apart, and their numbers, by lag up to half the stripe's length."""
    length = int(at_px.max()) + 1
    series, present = np.zeros(2 * length), np.zeros(2 * length)
    series[at_px], present[at_px] = z, 1.0
    sums = [np.fft.irfft(np.abs(np.fft.rfft(x)) ** 2)[: length // 2 + 1] for x in (series, present)]
    return sums[0], np.round(sums[1])


def _sum(a: Array, b: Array) -> Array:
    out = np.zeros(max(len(a), len(b)))
    out[: len(a)] += a
    out[: len(b)] += b
    return out
