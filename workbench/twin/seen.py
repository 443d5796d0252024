"""What extraction sees of stripe images, in numbers that change with the sensor's light, lens and chip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction import Profile, StripeConfig, extract_profile
from extraction.stripe import AMBIGUOUS, SATURATED
from geometry import Sensor
from workbench.twin.rounding import unrounded

Array = NDArray[np.float64]
Image = NDArray[np.uint8] | NDArray[np.uint16]

PARTS = 4  # of each image's stripe: the scatter of their differences gives the σ of the means
MIN_SECTIONS = 60  # of a part
SMOOTH_SECTIONS = 15  # half-width of the running parabola that stands for the smooth line
LEVELS = (0.08, 0.2, 0.4, 0.6, 0.85)  # of the stripe's height: edges of bins of mean light
BAND_WIDTHS = 4.0  # of the stripe: its own light lies within
ROOM_PX = (25, 45)  # from the stripe: the surface beside it in room light
CLEAR_PX = 60  # from the stripe: no laser light
DARKEST = 5.0  # percentile of blocks that stands for the black level
BLOCK_PX = 32
FLANK = (0.2, 0.6)  # of the stripe's height: pixels between are its flanks
BREAK_WIDTHS = 3.0  # of the stripe: a run ends where neighbours lie farther apart
LIKE_WIDTH = 2.0  # by which the widths of runs of one laser's stripe differ at most from the usual one

NAMES = (
    "height", "width", "fan", "line_rms", "line_lag1", "line_lag2", "height_rms", "height_lag1", "height_lag2",
    "width_rms", "noise_0", "noise_1", "noise_2", "noise_3", "room", "room_noise", "black",
    "dark_noise", "flank",
)  # fmt: skip
_LOG = {
    "height", "width", "line_rms", "height_rms", "width_rms", "noise_0", "noise_1", "noise_2", "noise_3", "room_noise",
    "dark_noise", "flank",
}  # fmt: skip


@dataclass(frozen=True, eq=False)
class ImageSeen:
    """What extraction sees of one image.

    image: grey levels. profile: its points, those in doubt left out. residual_px: of each point from the smooth line
    (N,), NaN near ends. bounds: sections (P + 1,) where its parts begin and the last one ends. parts: figures
    (P, len(NAMES)) of them, NaN where a part can not tell. found: points of the stripe, those in doubt too. clipped:
    those with saturated pixels.
    """

    image: Image
    profile: Profile
    residual_px: Array
    bounds: NDArray[np.int64]
    parts: Array
    found: int
    clipped: int


@dataclass(frozen=True)
class Look:
    """Which points of a stripe are taken.

    clipped_too: those with saturated pixels. doubted_too: those of ridges that another like them makes doubtful.
    width_px: usual width of the laser's stripe, other ridges are left out; None where all are taken.
    """

    clipped_too: bool = False
    doubted_too: bool = False
    width_px: float | None = None

    def wrong(self) -> np.uint8:
        """Flags of points that are left out."""
        taken = SATURATED * self.clipped_too + AMBIGUOUS * self.doubted_too
        return np.uint8(0xFF - taken)


def see(
    image: Image, sensor: Sensor, config: StripeConfig, look: Look, bounds: NDArray[np.int64] | None = None
) -> ImageSeen:
    """Extract an image's stripe and take the figures of its parts: of equal shares of its points, or between bounds."""
    profile = extract_profile(image, sensor, config)
    found, clipped = len(profile), int(np.sum((profile.peaks.flag & SATURATED) > 0))
    surroundings = _Surroundings.of(image, profile)
    profile = _like(profile[(profile.peaks.flag & look.wrong()) == 0], look.width_px)
    peaks = profile.peaks
    across = _across(profile)
    line = smooth(peaks.section, across)
    residual = np.abs(peaks.normal[:, 1 if _along_u(profile) else 0]) * (across - line)
    bounds = _bounds(peaks.section) if bounds is None else bounds
    light = surroundings.figures(bounds, _along_u(profile))
    rows = np.full((len(bounds) - 1, len(NAMES)), np.nan)
    for k, (a, b) in enumerate(pairwise(bounds)):
        here = np.flatnonzero((peaks.section >= a) & (peaks.section < b))
        if len(here) >= MIN_SECTIONS:
            rows[k] = _figures(image, sensor, profile[here], residual[here], look.clipped_too, light[k])
    return ImageSeen(image, profile, residual, bounds, rows, found, clipped)


def _bounds(section: NDArray[np.int32]) -> NDArray[np.int64]:
    """Sections where parts of equally many points begin, and behind the last; one alone where there are too few."""
    if len(section) < MIN_SECTIONS:
        return np.zeros(1, np.int64)
    count = min(PARTS, len(section) // MIN_SECTIONS)
    first = np.arange(count) * len(section) // count
    return np.array([*section[first], section[-1] + 1], np.int64)


def usual_width_px(every: Sequence[ImageSeen]) -> float | None:
    """The width that half of the light in stripes lies below; None where there are none."""
    width = np.concatenate([s.profile.peaks.width_px for s in every])
    light = np.concatenate([s.profile.peaks.amplitude_dn for s in every])
    if len(width) == 0:
        return None
    order = np.argsort(width, kind="stable")
    total = np.add.accumulate(light[order])
    return float(width[order][np.searchsorted(total, total[-1] / 2)])


def _like(profile: Profile, width_px: float | None) -> Profile:
    """The runs of a profile that are as wide as the laser's stripe: a lit rim or groove is a ridge, too."""
    if width_px is None or len(profile) == 0:
        return profile
    far = np.abs(np.diff(_across(profile))) > BREAK_WIDTHS * width_px
    ends = np.flatnonzero(far | (np.diff(profile.peaks.section) > SMOOTH_SECTIONS)) + 1
    keep = np.zeros(len(profile), dtype=bool)
    for a, b in pairwise([0, *ends, len(profile)]):
        ratio = float(np.median(profile.peaks.width_px[a:b])) / width_px
        keep[a:b] = 1 / LIKE_WIDTH <= ratio <= LIKE_WIDTH
    return profile[keep]


def gaps(seen: ImageSeen) -> int:
    """Sections without a point between the stripe's first and last."""
    section = seen.profile.peaks.section
    return int(np.ptp(section) + 1 - len(np.unique(section))) if len(section) else 0


def smooth(section: NDArray[np.int32], values: Array) -> Array:
    """Running parabola through values at sections (N,); NaN where fewer than half of the sections have one."""
    out = np.full(len(values), np.nan)
    if len(values) < SMOOTH_SECTIONS:
        return out
    first = int(section.min())
    n = int(section.max()) - first + 1
    line, there = np.zeros(n), np.zeros(n)
    line[section - first], there[section - first] = values - values.mean(), 1.0
    x = np.arange(-SMOOTH_SECTIONS, SMOOTH_SECTIONS + 1, dtype=float)
    m0, m1, m2, m3, m4 = (np.convolve(there, (x**k)[::-1], "same") for k in range(5))
    b0, b1, b2 = (np.convolve(line, (x**k)[::-1], "same") for k in range(3))
    matrix = np.stack([np.stack([m0, m1, m2], -1), np.stack([m1, m2, m3], -1), np.stack([m2, m3, m4], -1)], -2)
    good = m0 > SMOOTH_SECTIONS
    fitted = np.full(n, np.nan)
    fitted[good] = np.linalg.solve(matrix[good], np.stack([b0, b1, b2], -1)[good][..., None])[:, 0, 0]
    out = fitted[section - first] + values.mean()
    return np.asarray(out)


def _along_u(profile: Profile) -> bool:
    return len(profile) == 0 or bool(np.median(np.abs(profile.peaks.normal[:, 1])) > np.sqrt(0.5))


def _across(profile: Profile) -> Array:
    return profile.peaks.uv_px[:, 1] if _along_u(profile) else profile.peaks.uv_px[:, 0]


def _figures(
    image: Image, sensor: Sensor, part: Profile, residual: Array, clipped_too: bool, light: dict[str, float]
) -> Array:
    peaks, values = part.peaks, dict.fromkeys(NAMES, np.nan) | light
    values["height"], values["width"] = (float(np.median(v)) for v in (peaks.amplitude_dn, peaks.width_px))
    angle = np.arctan2(part.yz_mm[:, 0] - sensor.sheet.origin_mm[1], part.yz_mm[:, 1] - sensor.sheet.origin_mm[2])
    off = np.abs(angle) / (sensor.sheet.fan_rad / 2)
    values["fan"] = float(np.mean(np.log(peaks.amplitude_dn) * (off - off.mean())) / max(np.var(off), 1e-6))
    section = peaks.section
    values["line_rms"], values["line_lag1"], values["line_lag2"] = _scatter(section, residual)
    height = np.log(np.maximum(peaks.amplitude_dn, 1e-3))
    values["height_rms"], values["height_lag1"], values["height_lag2"] = _scatter(
        section, height - smooth(section, height)
    )
    values["width_rms"] = _scatter(section, np.log(peaks.width_px) - smooth(section, np.log(peaks.width_px)))[0]
    values.update(_noise_of_levels(image, part))
    if not clipped_too:
        values["flank"] = np.nan  # what the width says, once more
    elif np.median(peaks.amplitude_dn + peaks.background_dn) <= sensor.require_camera().saturation_dn:
        values["height"] = np.nan  # so many pixels are clipped in a row that nothing tells it
    return np.array([np.log(max(values[n], 1e-9)) if n in _LOG else values[n] for n in NAMES])


def _scatter(section: NDArray[np.int32], residual: Array) -> tuple[float, float, float]:
    """Robust rms of residuals, and their correlation from one section to the next and to the one after it."""
    good = np.isfinite(residual)
    if good.sum() < MIN_SECTIONS // 2:
        return np.nan, np.nan, np.nan
    rms = 1.4826 * float(np.median(np.abs(residual[good])))
    line = np.full(int(np.ptp(section)) + 1, np.nan)
    line[section - section.min()] = np.clip(residual, -4 * rms, 4 * rms)
    products = [line[k:] * line[:-k] for k in (1, 2)]
    if any(np.isfinite(p).sum() < MIN_SECTIONS // 4 for p in products):
        return rms, np.nan, np.nan
    power = max(float(np.nanmean(line**2)), 1e-12)
    return rms, float(np.nanmean(products[0])) / power, float(np.nanmean(products[1])) / power


def _noise_of_levels(image: Image, part: Profile) -> dict[str, float]:
    """Variance of second differences along the stripe, over 6, in bins of mean light; width of both flanks [px]."""
    peaks = part.peaks
    grey = image if _along_u(part) else image.T
    along, across = (0, 1) if _along_u(part) else (1, 0)
    reach = int(np.ceil(BAND_WIDTHS * float(np.median(peaks.width_px))))
    u = peaks.uv_px[:, along].round().astype(int)
    v = peaks.uv_px[:, across].round().astype(int)
    keep = (u > 0) & (u < grey.shape[1] - 1) & (v - reach > 0) & (v + reach < grey.shape[0] - 1)
    rows = v[keep, None] + np.arange(-reach, reach + 1)
    left, middle, right = (grey[rows, (u[keep] + k)[:, None]].astype(float) for k in (-1, 0, 1))
    background = peaks.background_dn[keep][:, None]
    level = ((left + middle + right) / 3 - background) / peaks.amplitude_dn[keep][:, None]
    second = (left - 2 * middle + right) ** 2 / 6
    out = {}
    for k, (low, high) in enumerate(pairwise(LEVELS)):
        inside = (level >= low) & (level < high)
        out[f"noise_{k}"] = float(np.mean(second[inside])) if inside.sum() > MIN_SECTIONS else np.nan
    flank = (level >= FLANK[0]) & (level < FLANK[1])
    out["flank"] = float(flank.sum()) / len(level) if flank.sum() > MIN_SECTIONS else np.nan
    return out


@dataclass(frozen=True, eq=False)
class _Surroundings:
    """Where no laser light is: grey levels, distance from the stripe [px], the darkest blocks."""

    image: Image
    distance: Array
    dark: Array

    @classmethod
    def of(cls, image: Image, profile: Profile) -> _Surroundings:
        mask = np.ones(image.shape, np.uint8)
        at = profile.peaks.uv_px.round().astype(int)
        mask[np.clip(at[:, 1], 0, image.shape[0] - 1), np.clip(at[:, 0], 0, image.shape[1] - 1)] = 0
        distance = cv2.distanceTransform(mask, cv2.DIST_L2, 3).astype(float)
        height, width = (n // BLOCK_PX * BLOCK_PX for n in image.shape)
        shape = height // BLOCK_PX, BLOCK_PX, width // BLOCK_PX, BLOCK_PX
        blocks = image[:height, :width].reshape(shape).swapaxes(1, 2).reshape(-1, BLOCK_PX, BLOCK_PX).astype(float)
        clear = distance[:height, :width].reshape(shape).swapaxes(1, 2).reshape(-1, BLOCK_PX**2).min(1) > CLEAR_PX
        blocks = blocks[clear]
        if len(blocks):
            means = blocks.mean((1, 2))
            blocks = blocks[means <= np.percentile(means, DARKEST)]
        return cls(image, distance, blocks)

    def figures(self, bounds: NDArray[np.int64], along_u: bool) -> list[dict[str, float]]:
        """Room light beside each part, the black level and the noise of dark blocks, of which every part has its own.

        Second differences tell noise, not the darkness's own slope.
        """
        parts, out = len(bounds) - 1, []
        for k, (a, b) in enumerate(pairwise(bounds)):
            grey, distance = ((m if along_u else m.T)[:, a:b] for m in (self.image, self.distance))
            there, values = (distance > ROOM_PX[0]) & (distance < ROOM_PX[1]), {}
            if there.any():  # a median of whole grey levels is whole: the mean about it is not
                middle = float(np.median(grey[there]))
                values["room"] = float(np.mean(np.clip(grey[there], middle - 3, middle + 3)))
            second = np.diff(grey.astype(float), 2, axis=1)[there[:, 1:-1]]
            if len(second) > MIN_SECTIONS:
                values["room_noise"] = float((second**2).mean()) / 6
            dark = self.dark[k::parts]
            if len(dark):
                variance = float((np.diff(dark, 2, axis=2) ** 2).mean()) / 6
                values["black"], values["dark_noise"] = unrounded(float(dark.mean()), variance)
            out.append(values)
        return out
