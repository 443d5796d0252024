"""Pictures of stripes with known truth, of the kinds that real sensors send: for tests, benchmarks and documentation.

Each kind is one thing that goes wrong in practice: a region that is mostly stripe, metal, a board, a lamp, a mirror
image, clipping, steep and curved courses. Nothing here knows how stripes are found.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.floating[Any]]

_GAIN, _READ = 0.03, 0.8  # grey levels per electron and read noise of the camera [DN]
FWHM = 2.3548  # of a Gaussian, in σ


@dataclass(frozen=True, eq=False)
class StripePicture:
    """A picture and what is true of it.

    image: (H, W) or (H, W, 3) uint8. truth: middle of the stripe in every section (N,) [px], NaN where there is none.
    turned: whether a section is a row. tolerance_px: within which a point is right. other_px: distance of a second
    stripe that is as right, 0 for none.
    """

    image: NDArray[np.uint8]
    truth: Array
    turned: bool
    tolerance_px: float
    other_px: float = 0.0


def draw(kind: str, rng: np.random.Generator) -> StripePicture:
    """A picture of one of KINDS.

    Parameters
    ----------
    kind
        One of KINDS.
    rng
        Source of its noise and place.

    Returns
    -------
    picture
        Image and truth.
    """
    return KINDS[kind](rng)


def _seen(mean: Array, rng: np.random.Generator, top: int = 255, gain: float = _GAIN) -> NDArray[np.uint8]:
    noisy = mean + rng.normal(size=mean.shape) * np.sqrt(np.maximum(mean, 0) * gain + _READ**2)
    return np.clip(np.round(noisy), 0, top).astype(np.uint8)


def _bell(height: int, centre: Array, sigma: float, peak: float | Array) -> Array:
    """A stripe (height, N) along the columns; none where its centre is NaN."""
    row = np.arange(height, dtype=float)[:, None]
    return np.asarray(np.nan_to_num(peak * np.exp(-0.5 * ((row - centre) / sigma) ** 2)))


def _grain(shape: tuple[int, int], size: float, rng: np.random.Generator) -> Array:
    """Smooth noise of unit spread."""
    field = np.asarray(cv2.GaussianBlur(rng.normal(size=shape), (0, 0), size))
    return np.asarray(field / field.std())


def _metal(shape: tuple[int, int], level: float, contrast: float, size: float, rng: np.random.Generator) -> Array:
    return np.asarray(level * np.maximum(1 + contrast * _grain(shape, size, rng), 0))


def _narrow_region(rng: np.random.Generator) -> StripePicture:
    height = int(rng.integers(16, 50))
    centre = height / 2 + rng.uniform(-0.5, 0.5) + np.linspace(-0.8, 0.8, 600)
    return StripePicture(_seen(5 + _bell(height, centre, 1.9, 140), rng), centre, False, 1.0)


def _clipped_on_metal(rng: np.random.Generator) -> StripePicture:
    centre = 230 + rng.uniform(-15, 15) - 0.09 * np.arange(300)
    mean = _metal((380, 300), 13, 0.9, 1.5, rng)
    mean += _bell(380, centre, 6.0, 1500) * np.maximum(1 + 0.25 * _grain((380, 300), 1.2, rng), 0)
    ring = np.hypot(*np.mgrid[-60:320, -150:150].astype(float)) - 48
    mean += 55 * np.exp(-0.5 * (ring / 1.5) ** 2)
    return StripePicture(_seen(np.asarray(cv2.GaussianBlur(mean.T, (0, 0), 0.7)), rng), centre, True, 4.0)


def _beside_a_board(rng: np.random.Generator) -> StripePicture:
    centre = 64 + rng.uniform(-6, 6) + 0.012 * np.arange(340)
    rows, columns = np.mgrid[:400, :340]
    board = 90.0 * ((rows // 32 + columns // 32) % 2) * (rows > 140)
    return StripePicture(
        _seen(12 + np.asarray(cv2.GaussianBlur(board, (0, 0), 0.9), float) + _bell(400, centre, 9, 40), rng),
        centre,
        False,
        5,
    )


def _dashes(rng: np.random.Generator) -> StripePicture:
    centre = np.full(600, np.nan)
    for start, stop, place in ((15, 130, 80), (142, 260, 190), (272, 380, 120), (395, 580, 300)):
        centre[start:stop] = place + rng.uniform(-12, 12) + 0.03 * np.arange(stop - start)
    mean = _metal((420, 600), 10, 1.0, 1.3, rng)
    speckle = np.maximum(1 + 0.3 * _grain((420, 600), 1.0, rng), 0)
    return StripePicture(_seen(mean + _bell(420, centre, 2.2, 120) * speckle, rng), centre, False, 3.0)


def _mirror_image(rng: np.random.Generator) -> StripePicture:
    u = np.arange(640)
    centre = 90 + rng.uniform(-5, 5) + 0.04 * u
    ghost = np.where(u > 300, centre + 55, np.nan)
    mean = 5 + _bell(230, centre, 1.8, 90) + _bell(230, ghost, 1.8, 140)
    return StripePicture(_seen(mean, rng), centre, False, 2.0)


def _clipped_below_full_scale(rng: np.random.Generator) -> StripePicture:
    centre = 90 + rng.uniform(-3, 3) + 0.021 * np.arange(640)
    return StripePicture(
        _seen(5 + _bell(180, centre, 3.0, 420), rng, top=int(rng.integers(180, 240))), centre, False, 0.3
    )


def _colour(rng: np.random.Generator) -> StripePicture:
    centre = 80 + 7 * np.sin(np.arange(640) / 80) + rng.uniform(-3, 3)
    channels = [5 + _bell(170, centre, 3.0, peak) for peak in (200, 330, 700)]
    return StripePicture(np.stack([_seen(c, rng) for c in channels], axis=-1), centre, False, 1.5)


def _on_blotches(rng: np.random.Generator) -> StripePicture:
    u = np.arange(640)
    centre = np.where((u > 50) & (u < 590), 100 + 0.04 * u + rng.uniform(-3, 3), np.nan)
    return StripePicture(_seen(_metal((230, 640), 25, 0.5, 6, rng) + _bell(230, centre, 2, 16), rng), centre, False, 2)


def _beside_a_border(rng: np.random.Generator) -> StripePicture:
    u = np.arange(640)
    centre = 80 + rng.uniform(-5, 5) + 0.015 * u
    border = 70.0 * (np.arange(280)[:, None] > 180 + 0.05 * u)
    return StripePicture(
        _seen(np.asarray(cv2.GaussianBlur(10 + border + _bell(280, centre, 2.2, 26), (0, 0), 0.8), float), rng),
        centre,
        False,
        2.0,
    )


def _white_core(rng: np.random.Generator) -> StripePicture:
    centre = 110 + 6 * np.sin(np.arange(640) / 110) + rng.uniform(-3, 3)
    halo = 140 * np.exp(-np.abs(np.arange(230)[:, None] - centre) / 15)
    return StripePicture(_seen(6 + halo + _bell(230, centre, 4.5, 900), rng), centre, False, 2.0)


def _steep(rng: np.random.Generator) -> StripePicture:
    u = np.arange(600)
    line = 25 + 2.4 * (u - 180) + rng.uniform(-4, 4)
    inside = (u > 180) & (u < 330)
    away = (np.arange(420)[:, None] - line) / np.hypot(1, 2.4)
    mean = 5 + 120 * np.exp(-0.5 * (away / 1.6) ** 2) * inside
    return StripePicture(_seen(mean, rng), np.where(inside, line, np.nan), False, 3.0)


def _arc(rng: np.random.Generator) -> StripePicture:
    radius, u = rng.uniform(160, 210), np.arange(640)
    inside = np.abs(u - 320) < 0.92 * radius
    centre = np.where(inside, 250 - np.sqrt(np.maximum(radius**2 - (u - 320.0) ** 2, 0)), np.nan)
    away = np.hypot(u - 320.0, np.arange(290)[:, None] - 250.0) - radius
    mean = 5 + 130 * np.exp(-0.5 * (away / 1.7) ** 2) * inside * (np.arange(290)[:, None] < 250)
    return StripePicture(_seen(mean, rng), centre, False, 3.0)


def _pair(widths: float) -> Callable[[np.random.Generator], StripePicture]:
    def picture(rng: np.random.Generator) -> StripePicture:
        centre, apart = 85 + rng.uniform(-3, 3) + np.zeros(640), widths * FWHM * 1.6
        mean = 5 + _bell(190, centre, 1.6, 110) + _bell(190, centre + apart, 1.6, 95)
        return StripePicture(_seen(mean, rng), centre, False, 0.6, apart)

    return picture


def _texture(rng: np.random.Generator) -> StripePicture:
    return StripePicture(_seen(_metal((240, 600), 40, 0.8, 1.5, rng), rng), np.full(600, np.nan), False, 1.0)


def _scratched_metal(rng: np.random.Generator) -> StripePicture:
    mean = np.ascontiguousarray(_metal((340, 600), 22, 0.6, 1.4, rng))
    for _ in range(12):
        start = rng.integers(40, (560, 300))
        stop = start + rng.uniform(-24, 24, 2).astype(int)
        cv2.line(mean, (int(start[0]), int(start[1])), (int(stop[0]), int(stop[1])), 60.0, 1)
    mean[int(rng.integers(170, 280)) :] += 45
    return StripePicture(_seen(np.asarray(cv2.GaussianBlur(mean, (0, 0), 0.8)), rng), np.full(600, np.nan), False, 1.0)


def _lit_board(rng: np.random.Generator) -> StripePicture:
    rows, columns = np.mgrid[:700, :700]
    squares = 110.0 * ((rows // 34 + columns // 34) % 2)
    turn = cv2.getRotationMatrix2D((350, 350), rng.uniform(20, 70), 1)
    board = cv2.warpAffine(squares, turn, (700, 700))[160:500, 40:660]
    return StripePicture(
        _seen(np.asarray(cv2.GaussianBlur(14 + board, (0, 0), 0.9), float), rng), np.full(620, np.nan), False, 1.0
    )


def _lamp(rng: np.random.Generator) -> StripePicture:
    """A stripe in the light of a lamp that falls off across it, here and there as steeply as over some widths."""
    u, v = np.arange(640), np.arange(230)[:, None]
    centre = 110 + rng.uniform(-10, 10) + 4 * np.sin(u / 90) + rng.uniform(-0.02, 0.02) * u
    away = np.hypot((u - rng.uniform(150, 490)) / 2, v - rng.choice([60, 170]))
    mean = 10 + 100 * np.exp(-0.5 * (away / rng.uniform(35, 50)) ** 2) + _bell(230, centre, 2.2, 70)
    return StripePicture(_seen(mean, rng), centre, False, 0.6)


KINDS: dict[str, Callable[[np.random.Generator], StripePicture]] = {
    "narrow_region": _narrow_region,
    "clipped_on_metal": _clipped_on_metal,
    "beside_a_board": _beside_a_board,
    "dashes": _dashes,
    "mirror_image": _mirror_image,
    "clipped_below_full_scale": _clipped_below_full_scale,
    "colour": _colour,
    "on_blotches": _on_blotches,
    "beside_a_border": _beside_a_border,
    "white_core": _white_core,
    "steep": _steep,
    "arc": _arc,
    "lamp": _lamp,
    "pair_1.2": _pair(1.2),
    "pair_1.5": _pair(1.5),
    "pair_2.0": _pair(2.0),
    "texture": _texture,
    "scratched_metal": _scratched_metal,
    "lit_board": _lit_board,
}
EMPTY = ("texture", "scratched_metal", "lit_board")  # kinds without a stripe
