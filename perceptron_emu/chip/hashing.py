"""Counter-based randomness: the same key and the same place give the same number, in any order and on any thread."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numba import uint32, uint64
from numpy.typing import NDArray
from scipy.special import ndtri

from geometry.compiled import kernel

BITS = 12  # of a place in the table: 16 KB, which the fastest cache holds
LOW = 2**BITS - 1
# Standard normal deviates at the middles of equal slices of probability, scaled to unit variance
_DEVIATES = ndtri((np.arange(2**BITS) + 0.5) / 2**BITS)
NORMAL = (_DEVIATES / _DEVIATES.std()).astype(np.float32)


@kernel(inline=True)
def mix(counter, key):  # type: ignore[no-untyped-def]
    """64 well mixed bits of a counter under a key (splitmix64's finaliser; Steele, Lea & Flood 2014)."""
    z = uint64(counter) * uint64(0x9E3779B97F4A7C15) + uint64(key)
    z = (z ^ (z >> uint64(30))) * uint64(0xBF58476D1CE4E5B9)
    z = (z ^ (z >> uint64(27))) * uint64(0x94D049BB133111EB)
    return z ^ (z >> uint64(31))


@kernel(inline=True)
def mix32(counter, low, high):  # type: ignore[no-untyped-def]
    """32 well mixed bits of a 32-bit counter under two halves of a key: half the width, several at once.

    Two rounds of multiply and xor-shift, each a permutation (constants: Wellons, Hash Prospector, 2018).
    """
    x = uint32(counter + low)
    x = uint32((x ^ (x >> uint32(16))) * uint32(0x7FEB352D))
    x = uint32((x ^ (x >> uint32(15))) * uint32(0x846CA68B))
    x = uint32(x ^ (x >> uint32(16)) ^ high)
    x = uint32((x ^ (x >> uint32(16))) * uint32(0x21F0AAAD))
    x = uint32((x ^ (x >> uint32(15))) * uint32(0x735A2D97))
    return uint32(x ^ (x >> uint32(15)))


def white_noise(row: int, column: int, rows: int, columns: int, keys: Sequence[int]) -> NDArray[np.complex64]:
    """Complex circular Gaussian noise (n, rows, columns) of unit power on part of an endless grid, one for each key."""
    out = np.empty((len(keys), rows, columns), np.complex64)
    for own, key in zip(out, keys, strict=True):
        _white_noise(own, row, column, np.uint64(key & 0xFFFFFFFFFFFFFFFF), NORMAL)
    return out


@kernel(fastmath=True)
def _white_noise(out, row, column, key, normal):  # type: ignore[no-untyped-def]
    low = uint64(LOW)
    scale = np.float32(math.sqrt(0.5))
    for i in range(out.shape[0]):
        for j in range(out.shape[1]):
            bits = mix((uint64(row + i + 0x40000000) << uint64(32)) | uint64(column + j + 0x40000000), key)
            out[i, j] = complex(scale * normal[bits & low], scale * normal[(bits >> uint64(BITS)) & low])


def mix_keys(key: int, number: int) -> int:
    """A key of 63 bits for the given part of what ``key`` stands for."""
    return int(np.random.SeedSequence([key, number]).generate_state(1, np.uint64)[0] >> np.uint64(1))
