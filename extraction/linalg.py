"""Small positive definite systems inside kernels: Cholesky's factor, and the solution by it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]

# of a diagonal term, what must be left of it: a hundred times the rounding of nine sums
SINGULAR = 1e-13


@kernel
def cholesky(matrix: Array, damping: float, n: int, out: Array) -> bool:
    """Lower factor of matrix + damping · diag(matrix), leading n × n; False where it is not positive definite."""
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            if i == j:
                total += damping * matrix[i, i]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            if i == j:
                if not total > SINGULAR * matrix[i, i]:
                    return False
                out[i, i] = np.sqrt(total)
            else:
                out[i, j] = total / out[j, j]
    return True


@kernel
def solve(factor: Array, right: Array, n: int, out: Array) -> None:
    """Out = (L Lᵀ)⁻¹ right, leading n."""
    for i in range(n):
        total = right[i]
        for k in range(i):
            total -= factor[i, k] * out[k]
        out[i] = total / factor[i, i]
    for i in range(n - 1, -1, -1):
        total = out[i]
        for k in range(i + 1, n):
            total -= factor[k, i] * out[k]
        out[i] = total / factor[i, i]
