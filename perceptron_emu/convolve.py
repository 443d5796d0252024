"""A line convolved with a symmetric kernel, several pixels at once."""

from __future__ import annotations

from geometry.compiled import kernel


@kernel(fastmath=True)
def convolved(line, taps, out):  # type: ignore[no-untyped-def]
    """Fill out (n,) with the line (n + taps − 1,) convolved; taps: of odd number, the same to either side."""
    reach = len(taps) // 2
    n, middle = len(out), line[reach : reach + len(out)]
    for i in range(n):
        out[i] = taps[reach] * middle[i]
    for k in range(reach):
        weight, before, after = taps[k], line[k : k + n], line[2 * reach - k : 2 * reach - k + n]
        for i in range(n):
            out[i] += weight * (before[i] + after[i])
