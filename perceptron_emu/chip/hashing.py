"""Counter-based randomness: the same key and the same place give the same number, in any order and on any thread."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel
from geometry.special import ndtri

Float32 = NDArray[np.float32]
Complex64 = NDArray[np.complex64]

BITS = 12  # of a place in the table: 16 KB, which the fastest cache holds
LOW = 2**BITS - 1
# Standard normal deviates at the middles of equal slices of probability, scaled to unit variance
_DEVIATES = ndtri((np.arange(2**BITS) + 0.5) / 2**BITS)
NORMAL: Float32 = (_DEVIATES / _DEVIATES.std()).astype(np.float32)
# the same at the middles of 2¹⁶ slices: one draw of 16 bits, 256 KB
_FINE = ndtri((np.arange(2**16) + 0.5) / 2**16)
DEVIATE: Float32 = (_FINE / _FINE.std()).astype(np.float32)
_FAR = 0x40000000  # added to rows and columns: a grid reaches as far before its origin as behind


@kernel(inline=True)
def mix(counter: int | np.uint64, key: np.uint64) -> np.uint64:
    """64 well mixed bits of a counter under a key (splitmix64's finaliser; Steele, Lea & Flood 2014)."""
    z = np.uint64(counter) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(key)
    z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return z ^ (z >> np.uint64(31))


@kernel(inline=True)
def mix32(counter: np.uint32, low: np.uint32, high: np.uint32) -> np.uint32:
    """32 well mixed bits of a 32-bit counter under two halves of a key: half the width, several at once.

    Two rounds of multiply and xor-shift, each a permutation (constants: Wellons, Hash Prospector, 2018).
    """
    x = np.uint32(counter + low)
    x = np.uint32((x ^ (x >> np.uint32(16))) * np.uint32(0x7FEB352D))
    x = np.uint32((x ^ (x >> np.uint32(15))) * np.uint32(0x846CA68B))
    x = np.uint32(x ^ (x >> np.uint32(16)) ^ high)
    x = np.uint32((x ^ (x >> np.uint32(16))) * np.uint32(0x21F0AAAD))
    x = np.uint32((x ^ (x >> np.uint32(15))) * np.uint32(0x735A2D97))
    return np.uint32(x ^ (x >> np.uint32(15)))


@kernel
def draw16(out: NDArray[np.uint32], first: np.uint32, low: np.uint32, high: np.uint32) -> None:
    """Random bits of pairs of pixels from pair ``first`` on, 16 for each pixel, under two halves of a key."""
    for i in range(len(out)):
        out[i] = mix32(first + np.uint32(i), low, high)


def white_noise(row: int, column: int, rows: int, columns: int, keys: Sequence[int]) -> Complex64:
    """Complex circular Gaussian noise of unit power on part of an endless grid.

    Parameters
    ----------
    row, column : int
        The part's first cell on the grid; parts that overlap agree.
    rows, columns : int
        Its size.
    keys : sequence of int
        One for each pattern.

    Returns
    -------
    Complex64
        (n, rows, columns).
    """
    out = np.empty((len(keys), rows, columns), np.complex64)
    for own, key in zip(out, keys, strict=True):
        _white_noise(own, row, column, np.uint64(key & 0xFFFFFFFFFFFFFFFF))
    return out


@kernel(fastmath=True)
def _white_noise(out: Complex64, row: int, column: int, key: np.uint64) -> None:
    low = np.uint64(LOW)
    scale = np.float32(math.sqrt(0.5))
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            bits = mix((np.uint64(row + i + _FAR) << np.uint64(32)) | np.uint64(column + j + _FAR), key)
            out[i, j] = complex(scale * NORMAL[bits & low], scale * NORMAL[(bits >> np.uint64(BITS)) & low])


def mix_keys(key: int, number: int) -> int:
    """A key for a part of what a key stands for.

    Parameters
    ----------
    key : int
        At least 0.
    number : int
        Which part.

    Returns
    -------
    int
        63 bits.
    """
    return int(np.random.SeedSequence([key, number]).generate_state(1, np.uint64)[0] >> np.uint64(1))
