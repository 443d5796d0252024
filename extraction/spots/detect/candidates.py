"""Candidates for string spots: peaks that stand above their surroundings, and the shape of the region around each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.config import DetectConfig
from extraction.reasons import Reason
from extraction.spots.detect.blur import BLOCK_PX
from extraction.spots.detect.peaks import PLACE_BITS, find_peaks
from extraction.spots.detect.prepare import PreparedImage
from extraction.spots.detect.regions import ESCAPED, JOINED, REGION, RING_PX, RegionRule, grow_regions

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

LEAST_RING_PX = 5  # half side of a ring: beyond the light of the smallest spot, blurred
# what `refusal` counts; a later one hides the others
REASONS = (
    "",
    Reason.TOO_WIDE,
    Reason.TOO_LONG,
    Reason.PART_OF_BRIGHTER,
    Reason.TOO_FAINT,
    Reason.IN_THE_NOISE,
    Reason.OUTSIDE_REGION,
)


@dataclass(frozen=True, eq=False)
class Candidates:
    """Peaks of the blurred image, brightest first, and why each was refused ("" while it stands).

    peak_uv_px: brightest pixel (N, 2). height_dn: over its surroundings; ring_dn, ring_noise_dn, uneven_dn: those,
    their spread, and how much one side is brighter than the other (N,).
    mean_uv_px, cov_uv_px2: moments (N, 2), (N, 2, 2) of the region above `region_level` of the height.
    area_px, length_px, width_px: of that region, along and across its long axis (N,).
    refusal: place in REASONS (N,). later: reason of those that were refused after they were localised.
    owner: 1 + index of the candidate whose region a pixel belongs to, 0 for none (H, W).
    beyond: fainter peaks that `max_candidates` left out.
    """

    peak_uv_px: Array
    height_dn: Array
    ring_dn: Array
    ring_noise_dn: Array
    uneven_dn: Array
    mean_uv_px: Array
    cov_uv_px2: Array
    area_px: Array
    length_px: Array
    width_px: Array
    refusal: NDArray[np.uint8]
    owner: NDArray[np.int16]
    beyond: int = 0
    later: Mapping[int, str] = field(default_factory=dict)

    def __len__(self) -> int:
        """The number of candidates, refused ones included."""
        return len(self.refusal)

    @cached_property
    def reason(self) -> tuple[str, ...]:
        """Why each was refused (N,), "" while it stands."""
        return tuple(self.later.get(k, REASONS[code]) for k, code in enumerate(self.refusal))

    def refused(self, index: NDArray[np.intp], reasons: NDArray[np.object_]) -> Candidates:
        """The same, with the reasons of the candidates ``index`` (N,) replaced by ``reasons`` (N,)."""
        return replace(self, later={**self.later, **dict(zip(index.tolist(), reasons, strict=True))})


def find_candidates(
    prepared: PreparedImage, config: DetectConfig, mm_per_px: float, usable: Mask | None = None
) -> Candidates:
    """Peaks above the noise, with the shape of their regions and the reason of each refusal.

    mm_per_px: scale of the laser sheet in the image, for the limits of size that are given in mm. usable: the pixels
    (H, W) that are looked at; a peak on another is refused.
    """
    seen = find_peaks(prepared, config.threshold)
    peaks = np.sort(seen)[: config.max_candidates]
    length = max(config.min_length_px, config.max_length_mm / mm_per_px)
    width = max(config.min_width_px, config.max_width_mm / mm_per_px)
    owner = np.zeros(prepared.smooth.shape, np.int16)  # pages that no region touches stay unwritten
    # a region of twice the largest length is none, wherever in it the peak lies
    least_noise = float(prepared.noise.min())
    rule = RegionRule(config.threshold, config.min_height_dn, config.region_level, 2.0 * length, least_noise)
    table = np.zeros(len(peaks), REGION)
    grow_regions(prepared.smooth, owner, peaks, _rings(prepared, peaks), rule, table)
    height = table["top"] - table["ring"]
    covariance = np.stack([table[name] for name in ("cov_uu", "cov_uv", "cov_uv", "cov_vv")], axis=1)
    return Candidates(
        peak_uv_px=np.stack([table["peak_u"], table["peak_v"]], axis=1),
        height_dn=height,
        ring_dn=table["ring"],
        ring_noise_dn=table["ring_noise"],
        uneven_dn=table["uneven"],
        mean_uv_px=np.stack([table["mean_u"], table["mean_v"]], axis=1),
        cov_uv_px2=covariance.reshape(-1, 2, 2),
        area_px=table["area"],
        length_px=table["length"],
        width_px=table["width"],
        refusal=_refusals(table, height, (config, length, width), usable),
        owner=owner,
        beyond=len(seen) - len(peaks),
    )


def _rings(prepared: PreparedImage, peaks: NDArray[np.int64]) -> NDArray[np.int64]:
    """Half side of each peak's ring (N,): where dots fill the image, between a dot and its neighbours."""
    rings = np.full(len(peaks), RING_PX)
    if not prepared.dense.any() or len(peaks) == 0:
        return rings
    (h, w), columns = prepared.dense.shape, prepared.smooth.shape[1]
    place = peaks & PLACE_BITS
    block = np.minimum(place // columns // BLOCK_PX, h - 1), np.minimum(place % columns // BLOCK_PX, w - 1)
    inside = prepared.dense[block]
    pitch = BLOCK_PX * math.sqrt(int(np.count_nonzero(prepared.dense)) / max(int(np.count_nonzero(inside)), 1))
    # those beside the zone are its dots as well
    about = cv2.dilate(prepared.dense.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
    rings[about[block]] = min(max(round(pitch / 2), LEAST_RING_PX), RING_PX)
    return rings


def _refusals(
    table: NDArray[np.void], height: Array, limits: tuple[DetectConfig, float, float], usable: Mask | None
) -> NDArray[np.uint8]:
    """Why each peak is refused: its place in REASONS."""
    config, length_px, width_px = limits
    outside = np.zeros(len(table), np.bool_)
    if usable is not None:
        outside = ~usable[table["peak_v"].astype(int), table["peak_u"].astype(int)]
    refused = {
        Reason.TOO_WIDE: table["width"] > width_px,
        Reason.TOO_LONG: (table["length"] > length_px) | (table["state"] == ESCAPED),
        Reason.PART_OF_BRIGHTER: table["state"] == JOINED,
        Reason.TOO_FAINT: height < config.min_height_dn,
        Reason.IN_THE_NOISE: height < config.threshold * table["ring_noise"],
        Reason.OUTSIDE_REGION: outside,
    }
    codes = np.zeros(len(table), np.uint8)
    for code, reason in enumerate(REASONS[1:], start=1):
        codes[refused[Reason(reason)]] = code
    return codes
