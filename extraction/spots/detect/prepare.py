"""The matched blur, and the frame's own background and noise."""

from __future__ import annotations

import math
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


@dataclass(frozen=True, eq=False)
class PreparedImage:
    """An image ready for detection.

    image: the raw grey levels (H, W). smooth: after the matched blur (H, W) [DN]. kernel: that blur's row (K,).
    background, noise, tops: level, standard deviation and largest value of the blurred image per block (h, w) [DN].
    dense: whether light fills the blocks, so that background and noise are those of the ground between.
    """

    image: Image
    smooth: Image32
    kernel: Array
    background: Image32
    noise: Image32
    tops: Image32
    dense: bool = False


def prepare(image: Image, config: DetectConfig) -> PreparedImage:
    """Blur the image with the matched filter and measure background and noise block by block."""
    blurred = blur(image, config.blur_sigma_px)
    # a spot or a stripe lies in the minority of 5 × 5 blocks; the blurred quantisation error is the least noise
    background = np.asarray(cv2.medianBlur(blurred.mean, 5), dtype=np.float32)
    floor = QUANTISATION_VARIANCE * float(np.sum(blurred.kernel**2)) ** 2
    noise = np.sqrt(np.maximum(cv2.medianBlur(blurred.variance, 5), np.float32(floor)))
    prepared = PreparedImage(
        image, blurred.smooth, blurred.kernel, background, np.asarray(noise, np.float32), blurred.tops
    )
    return between_dots(prepared) if filled(prepared) else prepared


def filled(prepared: PreparedImage) -> bool:
    """Whether light, not noise, is what varies within most blocks: as of a fine grid of dots."""
    share = float(np.sum(prepared.kernel**2))
    typical = float(np.median(prepared.noise))
    if not typical > FILLED * np.sqrt(QUANTISATION_VARIANCE) * share:  # pixels have that much noise at least
        return False
    bend = _bends(prepared.image)
    return bool(bend.size and typical > FILLED * share * np.sqrt(_white(float(np.median(bend)) / 0.6745)))


def between_dots(prepared: PreparedImage) -> PreparedImage:
    """The same with background and noise as they are between dots that fill all blocks; unchanged where there is no
    such ground.
    """
    bends = np.sort(_bends(prepared.image), axis=None)
    quiet = float(np.mean(bends[: math.ceil(_QUIET * len(bends))])) / _QUIET_MEAN
    noise = math.sqrt(max(quiet**2 / 6.0, QUANTISATION_VARIANCE)) * float(np.sum(prepared.kernel**2))
    (h, w), smooth = prepared.background.shape, prepared.smooth
    if min(smooth.shape) < BLOCK_PX:
        return prepared
    blocks = smooth[: h * BLOCK_PX, : w * BLOCK_PX].reshape(h, BLOCK_PX, w, BLOCK_PX).swapaxes(1, 2).reshape(h, w, -1)
    ground = cv2.medianBlur(np.quantile(blocks, _DARK, axis=2).astype(np.float32), 3) + np.float32(_DARK_SIGMA * noise)
    if np.mean(blocks < (ground + np.float32(_GROUND_SIGMA * noise))[:, :, None]) < _GROUND:
        return prepared
    level = np.full_like(prepared.noise, noise * math.sqrt(block_share(tuple(prepared.kernel))))  # as of blocks
    return replace(prepared, background=np.asarray(ground, np.float32), noise=level, dense=True)


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
