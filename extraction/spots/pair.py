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
from extraction.spots.error.influence import CLASSES, CORE, LAGS, REACH, WITHIN_PIXEL
from extraction.spots.fit import PLACE, Window, Windows, fit_window
from extraction.spots.frame import FRAGMENT, Fits
from extraction.spots.localise import JointErrors, LocalisedSpots
from extraction.spots.model import (
    FLAT,
    MIN_VARIANCE_PX2,
    PIXEL_VARIANCE_PX2,
    SPOT,
    Spot,
    long_axis,
    shapes_px2,
    spot_of,
)
from extraction.spots.noise import FrameNoise

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FULL_WIDTH = math.sqrt(8.0 * math.log(2.0))  # at half maximum, in σ
NEAREST = 1.1  # full widths at half maximum, below which two are reported as one: what 1.2 measure at least
FARTHEST = 4.0  # full widths, beyond which a refused peak is no neighbour: the bells do not overlap
FAINTEST = 0.15  # height of the fainter over the brighter: less is a grain or a wing
LEAST_F = 20.0  # of the three parameters that a second spot adds; Gaussian noise gets there once in 10^5 and more
LEAST_RESIDUAL = 0.06  # rms of the single fit over its signal: a bent arc of a 1 mm string leaves as much
MOMENTS = 5  # along a spot, from the nought-th to the fourth
EXPLAINED = 0.6  # share of a single fit's residual, in squares, that these must explain where it is two spots
LONGEST_PX = 9.0  # σ along a single fit, beyond which it is a piece of stripe: two of 3 px, 2 full widths apart, have 8
APART = 0.67  # of one spot's variance along an axis: what two, 1.2 full widths apart, make of it by their places
START_PX2 = 0.3  # of a start, as of single fits
STEPS, TOLERANCE, MOST_DAMPING = 25, 1e-3, 1e6
U, V, HEIGHT, SHAPE, LEVEL = (0, 3), (1, 4), (2, 5), slice(6, 9), 9
TERMS = 10


class Cut(NamedTuple):
    """A window of the image: first pixel, grey levels (R, C) [DN] and which are used (R, C)."""

    left: int
    top: int
    grey: Array
    use: Mask


class Pair(NamedTuple):
    """A joint fit: parameters (10,), bells (2, R, C), means and variances (R, C), influence (10, R·C); whether it
    settled.
    """

    q: Array
    bells: Array
    mean: Array
    variance: Array
    moves: Array
    converged: bool


def take_apart(
    prepared: PreparedImage, candidates: Candidates, spots: LocalisedSpots, noise: FrameNoise, config: ExtractionConfig
) -> LocalisedSpots:
    """The spots, those that are two replaced by both; `merged` marks what is two but too near to be taken apart."""
    if spots.fits is None or not len(spots):
        return spots
    joined = np.flatnonzero([r == Reason.PART_OF_BRIGHTER for r in candidates.reason])
    neighbour = _neighbours(candidates, spots, joined)
    merged = np.zeros(len(spots), dtype=np.bool_)
    both: list[tuple[int, int, Cut, Pair]] = []
    for k in range(len(spots)):
        m = neighbour.get(k, -1)
        if m < 0 and not (spots.converged[k] and _flat_topped(spots.fits, k)):
            continue
        across, along = spots.variances_px2[k]
        if spots.clipped[k] or not (across > config.localise.min_sigma_px**2 and along < LONGEST_PX**2):
            continue
        cut = _cut(prepared, candidates, spots, k, m, noise)
        pair = _fit(cut, spots, candidates, k, m)
        if pair is None:
            continue
        if _distance(pair.q) >= NEAREST:
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


def _flat_topped(fits: Fits, k: int) -> bool:
    """Whether a fit's residual is one that two spots leave: less in the middle, more beside it along an axis."""
    place, spot = fits.place[k], spot_of(fits.spot[k])
    grey, use = fits.windows.grey[k, : place["rows"], : place["columns"]], fits.windows.use[k]
    use = use[: place["rows"], : place["columns"]]
    y, x = np.mgrid[: grey.shape[0], : grey.shape[1]].astype(float)
    level = spot.level + spot.slope_u * x + spot.slope_v * y
    x, y = x - spot.u, y - spot.v
    signal = spot.height * np.exp(-0.5 * (spot.a * x * x + 2 * spot.h * x * y + spot.c * y * y))
    core = use & (signal > CORE * spot.height)
    left, signal = (grey - level - signal)[core], signal[core]
    cosine, sine, along = long_axis(spot)
    t = along * (cosine * x[core] + sine * y[core])
    square = max(float(left @ left), 1e-30)
    if square < LEAST_RESIDUAL**2 * float(signal @ signal):
        return False
    if len(t) <= 2 * MOMENTS:
        return False
    terms = signal[:, None] * t[:, None] ** np.arange(MOMENTS)  # a weighted fit leaves something of the lower ones too
    by, *_ = np.linalg.lstsq(terms, left, rcond=None)
    rest = left - terms @ by
    return bool(by[-1] < 0 and float(rest @ rest) < (1.0 - EXPLAINED) * square)


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
    return Cut(left, top, grey, ~foreign & (grey < noise.saturation_dn))


def _fit(cut: Cut, spots: LocalisedSpots, candidates: Candidates, k: int, m: int) -> Pair | None:
    """The joint fit, None where one spot explains the window as well."""
    fits = spots.fits
    if fits is None or np.sum(cut.use) <= 2 * TERMS:
        return None
    law, old = noise_of(fits.noise[k]), spot_of(fits.spot[k])
    shift = np.array([int(fits.place["left"][k]) - cut.left, int(fits.place["top"][k]) - cut.top], dtype=float)
    one = old._replace(u=old.u + shift[0], v=old.v + shift[1], slope_u=0.0, slope_v=0.0)
    single = fit_window(Window(cut.grey, cut.use), one, FLAT, law, STEPS)
    best: Pair | None = None
    for q in _starts(one, single.spot, single.converged, cut, candidates, m):
        pair = _joint(cut, q, law)
        if pair.converged and (best is None or _chi2(cut, pair) < _chi2(cut, best)):
            best = pair
    if best is None:
        return None
    heights = best.q[list(HEIGHT)]
    if not heights.min() > FAINTEST * heights.max():
        return None
    signal = np.einsum("k,kij->ij", heights, best.bells)
    core = cut.use & (signal > CORE * heights.max())
    freedom = int(np.sum(core)) - (TERMS - 1)
    if freedom < 3:
        return None
    left = cut.grey - _single_mean(single.spot, cut.grey.shape)
    before = float(np.sum((left**2 / best.variance)[core]))
    after = float(np.sum(((cut.grey - best.mean) ** 2 / best.variance)[core]))
    residual = math.sqrt(float(np.sum(left[core] ** 2)) / float(np.sum(signal[core] ** 2)))
    stands = residual > LEAST_RESIDUAL and before - after > LEAST_F * 3.0 * after / freedom
    return best if stands else None


def _single_mean(s: Spot, shape: tuple[int, ...]) -> Array:
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    x, y = x - s.u, y - s.v
    return np.asarray(s.level + s.height * np.exp(-0.5 * (s.a * x * x + 2 * s.h * x * y + s.c * y * y)))


def _starts(old: Spot, single: Spot, settled: bool, cut: Cut, candidates: Candidates, m: int) -> list[Array]:
    """Parameters to begin with: from the neighbour's peak, or along one spot's axis."""
    base = single if settled else old
    covariance = np.linalg.inv([[base.a, base.h], [base.h, base.c]])
    starts = []
    if m >= 0:
        first = np.array([old.u, old.v])
        second = candidates.peak_uv_px[m] - [cut.left, cut.top]
        values, axes = np.linalg.eigh(np.linalg.inv([[old.a, old.h], [old.h, old.c]]))
        width = np.clip(values, START_PX2, max(2.0 * values[0], START_PX2))
        starts.append((first, second, axes * width @ axes.T, old.height, float(candidates.height_dn[m])))
    values, axes = np.linalg.eigh(covariance)
    half, middle = math.sqrt(APART * values[1]) * axes[:, 1], np.array([base.u, base.v])
    starts.append((middle - half, middle + half, covariance - np.outer(half, half), base.height, base.height))
    out = []
    for first, second, shape, high, other in starts:
        a, h, _, c = np.linalg.inv(shape).ravel()
        out.append(np.array([*first, high, *second, other, a, h, c, base.level]))
    return out


def _model(q: Array, shape: tuple[int, ...], law: PixelNoise) -> tuple[Array, Array, Array, Array]:
    """Bells (2, R, C), mean and variance (R, C), derivatives (10, R·C)."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    a, h, c = q[SHAPE]
    bells, slopes = np.empty((2, *shape)), np.zeros((TERMS, *shape))
    for k in range(2):
        dx, dy = x - q[U[k]], y - q[V[k]]
        bells[k] = np.exp(-0.5 * (a * dx * dx + 2 * h * dx * dy + c * dy * dy))
        light = q[HEIGHT[k]] * bells[k]
        slopes[U[k]], slopes[V[k]] = light * (a * dx + h * dy), light * (h * dx + c * dy)
        slopes[HEIGHT[k]] = bells[k]
        slopes[6] -= 0.5 * light * dx * dx
        slopes[7] -= light * dx * dy
        slopes[8] -= 0.5 * light * dy * dy
    slopes[LEVEL] = 1.0
    signal = q[2] * bells[0] + q[5] * bells[1]
    mean = signal + q[LEVEL]
    variance = law.floor + law.model2 + law.gain * np.maximum(mean - law.dark, 0.0) + law.speckle2 * signal**2
    return bells, mean, variance, slopes.reshape(TERMS, -1)


def _joint(cut: Cut, q: Array, law: PixelNoise) -> Pair:
    """Fisher scoring with Levenberg's damping, the variances following the fit."""
    use, grey = cut.use.ravel(), cut.grey
    bells, mean, variance, slopes = _model(q, grey.shape, law)
    damping, converged = 1e-3, False
    for _ in range(STEPS):
        weight = use / variance.ravel()
        left = (grey - mean).ravel()
        fisher, score = (slopes * weight) @ slopes.T, slopes @ (weight * left)
        scale = np.sqrt(np.maximum(np.diag(fisher), 1e-300))
        step = np.linalg.solve(fisher / np.outer(scale, scale) + damping * np.eye(TERMS), score / scale) / scale
        new = q + step
        a, h, c = new[SHAPE]
        if (
            new[2] > 0
            and new[5] > 0
            and a > 0
            and a * c > h * h
            and a + c < 2.0 / (MIN_VARIANCE_PX2 + PIXEL_VARIANCE_PX2)
        ):
            trial = _model(new, grey.shape, law)
            same = float(np.sum(weight * (grey - trial[1]).ravel() ** 2))
            small = float(step @ score) < TOLERANCE
            if small or same <= float(np.sum(weight * left * left)):
                q, (bells, mean, variance, slopes) = new, trial
                damping = 0.1 * damping if damping > 1e-6 else 0.0
                if small and damping < 1e-2:
                    converged = True
                    break
                continue
        damping = max(8.0 * damping, 1e-3)
        if damping > MOST_DAMPING:
            break
    rows, columns = grey.shape
    inside = all(0 <= q[u] < columns and 0 <= q[v] < rows for u, v in zip(U, V, strict=True))
    weight = use / variance.ravel()
    fisher = (slopes * weight) @ slopes.T
    scale = np.sqrt(np.maximum(np.diag(fisher), 1e-300))
    moves = np.linalg.pinv(fisher / np.outer(scale, scale), hermitian=True) / np.outer(scale, scale) @ (slopes * weight)
    return Pair(q, bells, mean, variance, moves, converged and inside)


def _chi2(cut: Cut, pair: Pair) -> float:
    return float(np.sum(((cut.grey - pair.mean) ** 2 / pair.variance)[cut.use]))


def _distance(q: Array) -> float:
    """Distance of the two in full widths at half maximum along the line that joins them."""
    x, y = q[3] - q[0], q[4] - q[1]
    a, h, c = q[SHAPE]
    light = np.linalg.inv([[a, h], [h, c]]) - PIXEL_VARIANCE_PX2 * np.eye(2)
    return math.sqrt(np.array([x, y]) @ np.linalg.solve(light, [x, y])) / FULL_WIDTH


def _errors(cut: Cut, pair: Pair, law: PixelNoise) -> tuple[JointErrors, JointErrors]:
    q, (rows, columns) = pair.q, cut.grey.shape
    signal = pair.mean - q[LEVEL]
    _, _, _, slopes = _model(q, cut.grey.shape, law)
    fall = [(slopes[U[0]] + slopes[U[1]]).reshape(rows, columns), (slopes[V[0]] + slopes[V[1]]).reshape(rows, columns)]
    grainy = np.sqrt(signal**2 + WITHIN_PIXEL * (fall[0] ** 2 + fall[1] ** 2))
    camera = law.floor + law.gain * np.maximum(pair.mean - law.dark, 0.0)
    out = []
    for k in range(2):
        h = pair.moves[[U[k], V[k]]]
        speckle = np.zeros((2, 2, CLASSES))
        grains = (h * grainy.ravel()).reshape(2, rows, columns)
        padded = np.pad(grains, ((0, 0), (REACH, REACH), (REACH, REACH)))
        for kind, b, a in LAGS:
            other = padded[:, REACH + b : REACH + b + rows, REACH + a : REACH + a + columns]
            speckle[:, :, kind] += np.einsum("aij,bij->ab", grains, other)
        out.append(JointErrors((h * camera.ravel()) @ h.T, speckle, h @ h.T * q[HEIGHT[k]] ** 2))
    return out[0], out[1]


def _with_pairs(spots: LocalisedSpots, both: list[tuple[int, int, Cut, Pair]]) -> LocalisedSpots:
    """The spots with the pairs in place of the single ones; each one's window holds the light less the other's."""
    old = spots.fits
    if old is None:
        raise TypeError("a joint fit starts from single ones")
    keep = np.setdiff1d(np.arange(len(spots)), [k for k, *_ in both])
    n = 2 * len(both)
    rows = max(old.windows.grey.shape[1], *(c.grey.shape[0] for _, _, c, _ in both))
    columns = max(old.windows.grey.shape[2], *(c.grey.shape[1] for _, _, c, _ in both))
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
            size = cut.grey.shape
            other = 1 - i
            grey[to, : size[0], : size[1]] = cut.grey - q[HEIGHT[other]] * pair.bells[other]
            use[to, : size[0], : size[1]] = cut.use
            # the refused peak's number for the spot that is nearer to it; without one both bear the candidate's
            second = m >= 0 and i == 1
            candidate[at] = m if second else spots.candidate[k]
            place[at] = (candidate[at], cut.left, cut.top, size[1], size[0], FLAT)
            spot[at] = (q[U[i]], q[V[i]], q[HEIGHT[i]], *q[SHAPE], q[LEVEL], 0.0, 0.0)
            law[at] = old.noise[k]
            clipped[at] = spots.clipped[k]
            foreign[at] = 1 if _distance(q) * FULL_WIDTH < 4.0 else 0
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
