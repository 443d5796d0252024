"""Order statistics and equal values inside kernels: the k-th smallest without sorting, where a number stands."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel


@kernel
def kth_smallest(values: NDArray[Any], k: int) -> float:
    """The k-th smallest, counted from 0, of finite values (N,), which are left in another order; 0 of none.

    Partitions move without branching on a comparison; equal values are set aside together, so that a flat image takes
    no longer than a rough one.
    """
    low, high = 0, len(values)
    if high == 0:
        return 0.0
    while True:
        a, b, c = values[low], values[(low + high) // 2], values[high - 1]
        pivot = max(min(a, b), min(max(a, b), c))
        less = low
        for i in range(low, high):
            x = values[i]
            values[i] = values[less]
            values[less] = x
            less += 1 if x < pivot else 0
        if k < less:
            high = less
            continue
        equal = less
        for i in range(less, high):
            x = values[i]
            values[i] = values[equal]
            values[equal] = x
            equal += 1 if x == pivot else 0
        if k < equal:
            return float(pivot)
        low = equal


@kernel
def kth_smallest_level(values: NDArray[np.float32], k: int) -> float:
    """`kth_smallest` of float32, which stay as they are: by counting their bytes, the highest first.

    Of some hundred it takes half as long.
    """
    n = len(values)
    if n == 0:
        return 0.0
    bits, key, count = values.view(np.uint32), np.empty(n, np.uint32), np.empty(256, np.int64)
    sign, eight = np.uint32(0x80000000), np.uint32(255)
    for i in range(n):  # as numbers without a sign, that are in the same order
        key[i] = ~bits[i] if bits[i] >= sign else bits[i] | sign
    for byte in range(4):
        shift = np.uint32(24 - 8 * byte)
        for i in range(256):
            count[i] = 0
        for i in range(n):
            count[(key[i] >> shift) & eight] += 1
        wanted = 0
        while k >= count[wanted]:
            k -= count[wanted]
            wanted += 1
        left = 0
        for i in range(n):
            x = key[i]
            key[left] = x
            left += 1 if ((x >> shift) & eight) == wanted else 0
        n = left
        if n == 1:
            break
    key[0] = key[0] ^ sign if key[0] >= sign else ~key[0]
    return float(key.view(np.float32)[0])


@kernel
def median(values: NDArray[Any]) -> float:
    """The median of finite values (N,), which are left in another order; 0 of none."""
    n = len(values)
    if n == 0:
        return 0.0
    upper = kth_smallest(values, n // 2)
    if n % 2:
        return upper
    lower = values[0]
    for i in range(n // 2):  # those before the upper one are no larger
        lower = max(lower, values[i])
    return 0.5 * (float(lower) + upper)


@kernel
def mean(values: NDArray[Any]) -> float:
    """The mean of some values (N,); numba's own takes a second to compile."""
    total = 0.0
    for i in range(len(values)):
        total += values[i]
    return total / len(values)


@kernel
def median_of(values: NDArray[Any], start: int, stop: int) -> float:
    """The median of values start … stop - 1, which stay as they are."""
    own = np.empty(max(stop - start, 0))
    for i in range(start, stop):
        own[i - start] = values[i]
    return median(own)


@kernel
def positions_of(values: NDArray[np.integer[Any]], wanted: int, out: NDArray[np.int64]) -> int:
    """Where ``values`` (N,) are ``wanted``, in order, into the first of ``out`` (N,); how many there are."""
    n = 0
    for i in range(len(values)):
        if values[i] == wanted:
            out[n] = i
            n += 1
    return n
