"""Two near spots that were taken for one, or of which the fainter was refused: a joint fit, each with its covariance.

Two bells of one shape on one background, the shape free: strings of one jig are drawn alike. The pair stands where its
residuals are so much smaller than the single spot's that chance (noise, or speckle of any contrast, which scales both)
does not make it, and where the two lie far enough apart to be told from one odd spot.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.config import ExtractionConfig
from extraction.noise import NOISE, PixelNoise, noise_of
from extraction.reasons import Reason
from extraction.spots.detect import Candidates, PreparedImage
from extraction.spots.detect.candidates import REASONS
from extraction.spots.error.influence import CLASSES, LAGS, REACH, WITHIN_PIXEL
from extraction.spots.fit import PLACE, Window, Windows
from extraction.spots.frame import FRAGMENT, Fits
from extraction.spots.localise import JointErrors, LocalisedSpots
from extraction.spots.model import FLAT, SPOT, shapes_px2, spot_of
from extraction.spots.noise import FrameNoise
from extraction.spots.two import (
    FAINTEST,
    FULL_WIDTH,
    HEIGHT,
    LEVEL,
    START_PX2,
    TERMS,
    A,
    NearPeak,
    TwoSpots,
    U,
    V,
    fit_two,
    flat_topped,
    full_widths_apart,
)

Array = NDArray[np.float64]

NEAREST = 1.1  # full widths at half maximum, below which two are reported as one: what 1.2 measure at least
FARTHEST = 4.0  # full widths, beyond which a refused peak is no neighbour: the bells do not overlap
LONGEST_PX = 9.0  # σ along a single fit, beyond which it is a piece of stripe: two of 3 px, 2 full widths apart, have 8
NO_PEAK = NearPeak(0.0, 0.0, 0.0)


class Cut(NamedTuple):
    """A window of the image: its first pixel, and its grey levels with those that are used."""

    left: int
    top: int
    window: Window


def take_apart(
    prepared: PreparedImage, candidates: Candidates, spots: LocalisedSpots, noise: FrameNoise, config: ExtractionConfig
) -> LocalisedSpots:
    """The spots, those that are two replaced by both; `merged` marks what is two but too near to be taken apart."""
    if spots.fits is None or not len(spots):
        return spots
    joined = np.flatnonzero(candidates.refusal == REASONS.index(Reason.PART_OF_BRIGHTER))
    neighbour = _neighbours(candidates, spots, joined)
    flat = np.zeros(len(spots), dtype=np.bool_)
    flat_topped(spots.fits.windows, spots.fits.place, spots.fits.spot, flat)
    merged = np.zeros(len(spots), dtype=np.bool_)
    both: list[tuple[int, int, Cut, TwoSpots]] = []
    for k in range(len(spots)):
        m = neighbour.get(k, -1)
        if m < 0 and not (spots.converged[k] and flat[k]):
            continue
        across, along = spots.variances_px2[k]
        if spots.clipped[k] or not (across > config.localise.min_sigma_px**2 and along < LONGEST_PX**2):
            continue
        cut = _cut(prepared, candidates, spots, k, m, noise)
        pair = _fit(cut, spots, candidates, k, m)
        if pair is None:
            continue
        if full_widths_apart(pair.q) >= NEAREST:
            both.append((k, m, cut, pair))
        else:
            merged[k] = True
    spots = replace(spots, merged=merged)
    return _with_pairs(spots, both) if both else spots


def _neighbours(candidates: Candidates, spots: LocalisedSpots, joined: NDArray[np.intp]) -> dict[int, int]:
    """For each spot the brightest refused peak that runs into it, where there is one."""
    found: dict[int, int] = {}
    for m in joined:  # brightest first
        apart = candidates.peak_uv_px[m] - candidates.peak_uv_px[spots.candidate]
        widths = np.linalg.norm(apart, axis=1) / np.sqrt(np.maximum(spots.variances_px2[:, 1], START_PX2))
        k = int(np.argmin(widths))
        near = widths[k] < FARTHEST * FULL_WIDTH
        if near and candidates.height_dn[m] > FAINTEST * candidates.height_dn[spots.candidate[k]]:
            found.setdefault(k, int(m))
    return found


def _cut(
    prepared: PreparedImage, candidates: Candidates, spots: LocalisedSpots, k: int, m: int, noise: FrameNoise
) -> Cut:
    """The single fit's window, widened to hold the neighbour; clipped and foreign pixels are not used."""
    fits = spots.fits
    if fits is None:
        raise TypeError("a joint fit starts from single ones")
    place, own = fits.place[k], int(spots.candidate[k])
    left, top = int(place["left"]), int(place["top"])
    right, bottom = left + int(place["columns"]), top + int(place["rows"])
    if m >= 0:
        reach_u, reach_v = math.ceil(int(place["columns"]) / 2), math.ceil(int(place["rows"]) / 2)
        u, v = candidates.peak_uv_px[m].astype(int).tolist()
        left, right = max(min(left, u - reach_u), 0), min(max(right, u + reach_u + 1), prepared.image.shape[1])
        top, bottom = max(min(top, v - reach_v), 0), min(max(bottom, v + reach_v + 1), prepared.image.shape[0])
    grey = prepared.image[top:bottom, left:right].astype(float)
    owner = candidates.owner[top:bottom, left:right].astype(int)
    other = (owner > 0) & (owner != own + 1) & (owner != m + 1)
    foreign = other & (candidates.height_dn[np.maximum(owner - 1, 0)] > FRAGMENT * candidates.height_dn[own])
    return Cut(left, top, Window(grey, ~foreign & (grey < noise.saturation_dn)))


def _fit(cut: Cut, spots: LocalisedSpots, candidates: Candidates, k: int, m: int) -> TwoSpots | None:
    """The joint fit, None where one spot explains the window as well."""
    fits = spots.fits
    if fits is None or np.count_nonzero(cut.window.use) <= 2 * TERMS:
        return None
    old, place = spot_of(fits.spot[k]), fits.place[k]
    one = old._replace(
        u=float(old.u + place["left"] - cut.left), v=float(old.v + place["top"] - cut.top), slope_u=0.0, slope_v=0.0
    )
    peak = NO_PEAK
    if m >= 0:
        u, v = candidates.peak_uv_px[m].tolist()
        peak = NearPeak(u - cut.left, v - cut.top, float(candidates.height_dn[m]))
    stands, pair = fit_two(cut.window, one, peak, noise_of(fits.noise[k]))
    return pair if stands else None


def _errors(cut: Cut, pair: TwoSpots, law: PixelNoise) -> tuple[JointErrors, JointErrors]:
    q, (rows, columns) = pair.q, cut.window.grey.shape
    slopes = pair.slopes.reshape(-1, TERMS).T
    weighted = slopes * (cut.window.use / pair.variance).ravel()
    fisher = weighted @ slopes.T
    scale = np.sqrt(np.maximum(np.diag(fisher), 1e-300))
    moves = np.linalg.pinv(fisher / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale) @ weighted
    signal = pair.mean - q[LEVEL]
    fall = [(slopes[U[0]] + slopes[U[1]]).reshape(rows, columns), (slopes[V[0]] + slopes[V[1]]).reshape(rows, columns)]
    grainy = np.sqrt(signal**2 + WITHIN_PIXEL * (fall[0] ** 2 + fall[1] ** 2))
    camera = law.floor + law.gain * np.maximum(pair.mean - law.dark, 0.0)
    out = []
    for k in range(2):
        h = moves[[U[k], V[k]]]
        speckle = np.zeros((2, 2, CLASSES))
        grains = (h * grainy.ravel()).reshape(2, rows, columns)
        padded = np.pad(grains, ((0, 0), (REACH, REACH), (REACH, REACH)))
        for kind, b, a in LAGS:
            other = padded[:, REACH + b : REACH + b + rows, REACH + a : REACH + a + columns]
            speckle[:, :, kind] += np.einsum("aij,bij->ab", grains, other)
        out.append(JointErrors((h * camera.ravel()) @ h.T, speckle, h @ h.T * q[HEIGHT[k]] ** 2))
    return out[0], out[1]


def _with_pairs(spots: LocalisedSpots, both: list[tuple[int, int, Cut, TwoSpots]]) -> LocalisedSpots:
    """The spots with the pairs in place of the single ones; each one's window holds the light less the other's."""
    old = spots.fits
    if old is None:
        raise TypeError("a joint fit starts from single ones")
    keep = np.setdiff1d(np.arange(len(spots)), [k for k, *_ in both])
    n = 2 * len(both)
    rows = max(old.windows.grey.shape[1], *(c.window.grey.shape[0] for _, _, c, _ in both))
    columns = max(old.windows.grey.shape[2], *(c.window.grey.shape[1] for _, _, c, _ in both))
    grey, use = np.zeros((len(keep) + n, rows, columns)), np.zeros((len(keep) + n, rows, columns), dtype=np.bool_)
    size = old.windows.grey.shape[1:]
    grey[: len(keep), : size[0], : size[1]] = old.windows.grey[keep]
    use[: len(keep), : size[0], : size[1]] = old.windows.use[keep]
    place, spot, law = np.zeros(n, PLACE), np.zeros(n, SPOT), np.zeros(n, NOISE)
    clipped, foreign, candidate = (np.zeros(n, dtype=np.intp) for _ in range(3))
    joint: dict[int, JointErrors] = {}
    for pair_number, (k, m, cut, pair) in enumerate(both):
        errors, q = _errors(cut, pair, noise_of(old.noise[k])), pair.q
        for i in range(2):
            at = 2 * pair_number + i
            to = len(keep) + at
            size = cut.window.grey.shape
            other = 1 - i
            grey[to, : size[0], : size[1]] = cut.window.grey - q[HEIGHT[other]] * pair.bells[other]
            use[to, : size[0], : size[1]] = cut.window.use
            # the refused peak's number for the spot that is nearer to it; without one both bear the candidate's
            second = m >= 0 and i == 1
            candidate[at] = m if second else spots.candidate[k]
            place[at] = (candidate[at], cut.left, cut.top, size[1], size[0], FLAT)
            spot[at] = (q[U[i]], q[V[i]], q[HEIGHT[i]], *q[A:LEVEL], q[LEVEL], 0.0, 0.0)
            law[at] = old.noise[k]
            clipped[at] = spots.clipped[k]
            foreign[at] = 1 if full_widths_apart(q) * FULL_WIDTH < 4.0 else 0
            joint[to] = errors[i]
    uv = np.stack([spot["u"] + place["left"], spot["v"] + place["top"]], axis=1)
    return LocalisedSpots(
        uv_px=np.concatenate([spots.uv_px[keep], uv]),
        amplitude_dn=np.concatenate([spots.amplitude_dn[keep], spot["height"]]),
        shape_px2=np.concatenate([spots.shape_px2[keep], shapes_px2(spot)]),
        clipped=np.concatenate([spots.clipped[keep], clipped]),
        foreign=np.concatenate([spots.foreign[keep], foreign]),
        converged=np.concatenate([spots.converged[keep], np.ones(n, dtype=np.bool_)]),
        candidate=np.concatenate([spots.candidate[keep], candidate]),
        fits=Fits(
            Windows(grey, use), np.concatenate([old.place[keep], place]), np.concatenate([old.spot[keep], spot]),
            np.concatenate([old.noise[keep], law]),
        ),
        merged=np.concatenate([spots.merged[keep], np.zeros(n, dtype=np.bool_)]) if spots.merged is not None else None,
        joint=joint,
    )  # fmt: skip
