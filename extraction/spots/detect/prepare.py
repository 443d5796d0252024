"""The matched blur, and the frame's own background and noise."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.config import DetectConfig
from extraction.image import Image
from extraction.noise import QUANTISATION_VARIANCE
from extraction.spots.detect.blur import BLOCK_PX, ROW_STEP, Image32, blur

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# of the blocks' typical noise over that of neighbouring pixels, above which what fills the blocks is light, not noise:
# images with strings have 0.7, grids of dots up to 24 px apart 7 to 60
FILLED = 4.0
ROWS_APART = 31  # no multiple of a pitch: of the rows that tell the pixels' own noise
# of second differences the least such share, which no dot has a part in, and for noise of σ 1 their mean: a quantile
# would be a whole number; share of the darkest pixels of a block, and how many σ they lie below the middle
_QUIET, _QUIET_MEAN = 0.3, 0.1903
_DARK, _DARK_SIGMA = 0.05, 1.645
# share of the pixels within three σ of the ground, from which there is a ground between dots: grids 12 px apart have
# 0.35 and more, blotches and textures of surfaces 0.2 at most
_GROUND, _GROUND_SIGMA = 0.3, 3.0
# third neighbour's distance over the first's: 1.0 to 1.1 in grids, 1.3 in those seen at 40° aside; of speckle's and
# textures' peaks it is 1.4 and more
_EVEN, _FEWEST_DOTS, _SOME_DOTS = 1.3, 12, 100
_ABOUT_BLOCKS = 6  # to every side of a zone's middle: dots enough, and no more to look at
_NEAREST_PX = 7.0  # between dots: the blurred peaks of textures stand as near
_FEWEST_BLOCKS = 16  # side by side, that light fills: a smaller grid stands in the minority of 5 × 5 blocks


@dataclass(frozen=True, eq=False)
class PreparedImage:
    """An image ready for detection.

    image: the raw grey levels (H, W). smooth: after the matched blur (H, W) [DN]. kernel: that blur's row (K,).
    background, noise, tops: level, standard deviation and largest value of the blurred image per block (h, w) [DN].
    dense: the blocks (h, w) that light fills, so that background and noise are those of the ground between.
    too_fine: whether a part of the image holds dots with no ground between.
    """

    image: Image
    smooth: Image32
    kernel: Array
    background: Image32
    noise: Image32
    tops: Image32
    dense: Mask
    too_fine: bool = False


def prepare(image: Image, config: DetectConfig) -> PreparedImage:
    """Blur the image with the matched filter and measure background and noise block by block."""
    blurred = blur(image, config.blur_sigma_px)
    # a spot or a stripe lies in the minority of 5 × 5 blocks; the blurred quantisation error is the least noise
    background = np.asarray(cv2.medianBlur(blurred.mean, 5), dtype=np.float32)
    floor = QUANTISATION_VARIANCE * float(np.sum(blurred.kernel**2)) ** 2
    noise = np.sqrt(np.maximum(cv2.medianBlur(blurred.variance, 5), np.float32(floor)))
    none = np.zeros(noise.shape, np.bool_)
    prepared = PreparedImage(
        image, blurred.smooth, blurred.kernel, background, np.asarray(noise, np.float32), blurred.tops, none
    )
    if filled(prepared):
        return between_dots(prepared, ~none, _quiet_noise(prepared))
    for zone, level in _filled_zones(prepared):
        if _holds_grid(prepared, zone):
            seen = between_dots(prepared, zone, level)
            prepared = replace(seen, too_fine=prepared.too_fine or seen is prepared)
    return prepared


def filled(prepared: PreparedImage) -> bool:
    """Whether light, not noise, is what varies within most blocks: as of a fine grid of dots."""
    share = float(np.sum(prepared.kernel**2))
    typical = float(np.median(prepared.noise))
    if not typical > FILLED * np.sqrt(QUANTISATION_VARIANCE) * share:  # pixels have that much noise at least
        return False
    bend = _bends(prepared.image)
    return bool(bend.size and typical > FILLED * share * np.sqrt(_white(float(np.median(bend)) / 0.6745)))


def between_dots(prepared: PreparedImage, zone: Mask, noise_dn: float) -> PreparedImage:
    """The same with background and noise as they are between dots that fill the blocks of a zone (h, w); unchanged
    where there is no such ground.

    noise_dn: σ of the blurred image by noise alone.
    """
    (h, w), smooth = prepared.background.shape, prepared.smooth
    if min(smooth.shape) < BLOCK_PX:
        return prepared
    rows, columns = np.flatnonzero(zone.any(axis=1)), np.flatnonzero(zone.any(axis=0))
    box = slice(rows[0], rows[-1] + 1), slice(columns[0], columns[-1] + 1)
    blocks = smooth[: h * BLOCK_PX, : w * BLOCK_PX].reshape(h, BLOCK_PX, w, BLOCK_PX).swapaxes(1, 2)[box]
    blocks = blocks.reshape(*blocks.shape[:2], -1)
    dark = np.quantile(blocks, _DARK, axis=2).astype(np.float32)
    ground = cv2.medianBlur(dark, 3) + np.float32(_DARK_SIGMA * noise_dn)
    inside = zone[box]
    near_ground = (blocks < (ground + np.float32(_GROUND_SIGMA * noise_dn))[:, :, None]).mean(axis=2)
    if near_ground[inside].mean() < _GROUND:
        return prepared
    background, noise = prepared.background.copy(), prepared.noise.copy()
    background[box][inside] = ground[inside]
    noise[zone] = noise_dn * math.sqrt(block_share(tuple(prepared.kernel)))  # as of blocks
    return replace(prepared, background=background, noise=noise, dense=prepared.dense | zone)


def _filled_zones(prepared: PreparedImage) -> Iterator[tuple[Mask, float]]:
    """Zones of blocks (h, w) side by side that light fills, as of a fine grid of dots, and the noise there [DN]."""
    least = FILLED * math.sqrt(QUANTISATION_VARIANCE) * float(np.sum(prepared.kernel**2))
    if np.count_nonzero(prepared.noise > least) < _FEWEST_BLOCKS:  # pixels have that much noise at least
        return
    noise = _quiet_noise(prepared)
    number, zones = cv2.connectedComponents((prepared.noise > FILLED * noise).astype(np.uint8), connectivity=4)
    for k in range(1, number):
        zone = np.asarray(zones == k)
        if np.count_nonzero(zone) >= _FEWEST_BLOCKS:
            yield zone, noise


def _holds_grid(prepared: PreparedImage, zone: Mask) -> bool:
    """Whether the peaks of a zone of blocks (h, w), above its mean, stand as dots of a grid do: each as near to its
    third neighbour as to its first, about. A part of the zone about its middle block says so.
    """
    inside = np.argwhere(zone)
    middle = inside[np.argmin(np.sum((inside - inside.mean(axis=0)) ** 2, axis=1))]
    (top, left), (low, right) = np.maximum(middle - _ABOUT_BLOCKS, 0), middle + _ABOUT_BLOCKS + 1
    part = prepared.smooth[top * BLOCK_PX : low * BLOCK_PX, left * BLOCK_PX : right * BLOCK_PX]
    v, u = np.nonzero(part >= cv2.dilate(part, np.ones((5, 5), np.uint8)))
    here, (h, w) = zone[top:low, left:right], zone[top:low, left:right].shape
    block = np.minimum(v // BLOCK_PX, h - 1), np.minimum(u // BLOCK_PX, w - 1)
    dots = here[block] & (part[v, u] > prepared.background[top:low, left:right][block])
    places = np.column_stack([v, u])[dots].astype(float)
    if not _FEWEST_DOTS <= len(places) <= np.count_nonzero(here) * BLOCK_PX**2 / _NEAREST_PX**2:
        return False
    some = places[:: math.ceil(len(places) / _SOME_DOTS)]
    square = np.subtract.outer(some[:, 0], places[:, 0]) ** 2 + np.subtract.outer(some[:, 1], places[:, 1]) ** 2
    square = np.partition(square, (1, 3), axis=1)  # the first is the dot itself
    return bool(np.median(square[:, 3] / np.maximum(square[:, 1], 1.0)) < _EVEN**2)


def _quiet_noise(prepared: PreparedImage) -> float:
    """σ of the blurred image by the pixels' own noise alone [DN]: by the second differences that no dot has a part
    in.
    """
    bends, quiet = _bends(prepared.image).ravel(), 0.0
    if len(bends):
        least = math.ceil(_QUIET * len(bends))
        quiet = float(np.mean(np.partition(bends, least - 1)[:least])) / _QUIET_MEAN
    return math.sqrt(max(quiet**2 / 6.0, QUANTISATION_VARIANCE)) * float(np.sum(prepared.kernel**2))


def _bends(image: Image) -> NDArray[np.int32]:
    """Second differences along some rows, without their sign: of them a slope is none."""
    rows = image[::ROWS_APART].astype(np.int32)
    return np.asarray(np.abs(rows[:, :-2] - 2 * rows[:, 1:-1] + rows[:, 2:]))


def _white(bend: float) -> float:
    """A pixel's variance by second differences of that σ, rounding added [DN²]."""
    return bend**2 / 6.0 + QUANTISATION_VARIANCE


@lru_cache(maxsize=16)
def block_share(kernel: tuple[float, ...]) -> float:
    """Typical variance within a block over that of blurred white noise: a block's own mean takes some, and the median
    of blocks lies below their mean (Wilson & Hilferty 1931).
    """
    lags = np.correlate(kernel, kernel, "full")[len(kernel) - 1 :]
    rho = np.pad(lags / lags[0], (0, BLOCK_PX))
    own, square = 1.0, 1.0
    for step in (1, ROW_STEP):
        count = BLOCK_PX // step
        apart = np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
        near = rho[np.minimum(apart * step, len(kernel))]
        own, square = own * float(near.mean()), square * float(np.mean(near**2))
    return (1.0 - own) * (1.0 - 2.0 * square / 9.0) ** 3
