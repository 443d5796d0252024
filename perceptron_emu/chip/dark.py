"""Pixels without light: their grey level as a function of 16 random bits, looked up or counted by thresholds."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Float32 = NDArray[np.float32]
Draws = NDArray[np.uint16]
Image = NDArray[np.uint8] | NDArray[np.uint16]

MAX_THRESHOLDS = 6  # a pixel: beyond, a look-up of the noise is quicker than so many comparisons
PHASES = 4096  # of a grey level, to which a pixel's own offset is rounded; its noise is some thousand of them wide
FRACTION_BITS = 12  # of levels in the look-up
NEVER = 2**16 - 1  # no draw is above it


class DarkPixels(NamedTuple):
    """What pixels (N,) without light give.

    Parameters
    ----------
    lowest : Image
        The level of the lowest draw (N,); empty where levels are looked up.
    above : Draws
        (K, N): every threshold that the draw is above adds a level. K = 0 where levels are looked up.
    offset : NDArray
        int32 (N,), a pixel's own offset in parts of 2^FRACTION_BITS of a level; empty where thresholds serve.
    noise : NDArray
        int32 (2¹⁶,), the level of each draw in the same parts, without the offset.
    top : int
        The largest level.
    """

    lowest: NDArray[np.uint16]
    above: Draws
    offset: NDArray[np.int32]
    noise: NDArray[np.int32]
    top: int


def dark_pixels(level_dn: Array, offset_e: Float32, gain_dn_per_e: float, top_dn: float) -> DarkPixels:
    """Thresholds, or the table, of pixels without light.

    A pixel's level is ⌊level_dn[r] + gain · offset⌋ for the draw r of 16 bits, cut at 0 and the largest level. As
    level_dn never falls with r, the level is the lowest one plus the number of thresholds that r has passed.

    Parameters
    ----------
    level_dn : Array
        (2¹⁶,) never falling [DN], rounding's half included.
    offset_e : Float32
        Own offsets (N,) of the pixels [e⁻].
    gain_dn_per_e : float
        Of the converter.
    top_dn : float
        The largest level.

    Returns
    -------
    DarkPixels
        Thresholds where few serve, else the table.
    """
    own = np.floor(offset_e.astype(float) * (gain_dn_per_e * PHASES) + 0.5).astype(np.int32)
    count = math.ceil(float(level_dn[-1] - level_dn[0])) + 1
    none = np.zeros(0, np.int32)
    if count > MAX_THRESHOLDS:
        noise = np.floor(level_dn * 2**FRACTION_BITS + 0.5).astype(np.int32)
        return DarkPixels(none.astype(np.uint16), np.zeros((0, 0), np.uint16), own, noise, int(top_dn))
    phase = np.arange(PHASES) / PHASES
    lowest = np.floor(level_dn[0] + phase).astype(np.int32)
    steps = lowest + np.arange(1, count + 1)[:, None]  # (K, PHASES)
    first = np.searchsorted(level_dn, steps - phase, side="left")  # the first draw that reaches the level
    table = np.where(first > NEVER, NEVER, first - 1).astype(np.uint16)
    above, base = np.empty((count, len(own)), np.uint16), np.empty(len(own), np.uint16)
    _place(own, lowest, table, int(top_dn), base, above)
    return DarkPixels(base, above, none, none, int(top_dn))


@kernel
def _place(
    own: NDArray[np.int32],
    lowest: NDArray[np.int32],
    table: Draws,
    top: int,
    base: NDArray[np.uint16],
    above: Draws,
) -> None:
    """Every pixel's lowest level (N,) and thresholds (K, N) from those of its phase; levels stay in 0 … top."""
    for i in range(len(own)):
        whole, phase = own[i] // PHASES, own[i] % PHASES
        low = whole + lowest[phase]
        cut = max(-low, 0)  # levels below 0 that are not counted
        base[i] = min(max(low, 0), top)
        for k in range(len(table)):
            known = k + cut < len(table) and base[i] + k + 1 <= top
            above[k, i] = table[k + cut, phase] if known else NEVER


@kernel
def dark_levels(draws: Draws, dark: DarkPixels, first: int, out: Image) -> None:
    """Fill out (n,) for pixels without light, from pixel ``first`` on, of the draws (n,)."""
    here = slice(first, first + len(out))
    count = len(dark.above)
    if count == 0:
        _looked_up(draws, dark.offset[here], dark.noise, dark.top, out)
        return
    base, above = dark.lowest[here], dark.above
    for i in range(len(out)):
        out[i] = base[i]
    k = 0
    while k + 1 < count:
        _two(draws, above[k, here], above[k + 1, here], out)
        k += 2
    if k < count:
        _one(draws, above[k, here], out)


@kernel
def _looked_up(draws: Draws, offset: NDArray[np.int32], noise: NDArray[np.int32], top: int, out: Image) -> None:
    largest = np.int32(top)
    for i in range(len(out)):
        out[i] = min(max((offset[i] + noise[draws[i]]) >> FRACTION_BITS, np.int32(0)), largest)


@kernel
def _one(draws: Draws, above: Draws, out: Image) -> None:
    for i in range(len(out)):
        out[i] += draws[i] > above[i]


@kernel
def _two(draws: Draws, above: Draws, also: Draws, out: Image) -> None:
    for i in range(len(out)):
        out[i] += (draws[i] > above[i]) + np.uint8(draws[i] > also[i])
