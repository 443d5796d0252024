"""Small positive definite systems inside kernels: Cholesky's factor, and the solution by it.

Of four unknowns it is written out in scalars, which stay in registers: stripes solve ten thousand of them a frame, and
the general one takes a third more of the whole fit.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]


@kernel
def cholesky(matrix: Array, damping: float, singular: float, n: int, out: Array) -> bool:
    """Lower factor of matrix + damping · diag(matrix), leading n × n; False where it is not positive definite.

    singular: share of a diagonal term of which more must be left; what the sums round to, and some.
    """
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            if i == j:
                total += damping * matrix[i, i]
            for k in range(j):
                total -= out[i, k] * out[j, k]
            if i == j:
                if not total > singular * matrix[i, i]:
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


class Symmetric4(NamedTuple):
    """A symmetric matrix (4, 4): its upper triangle by rows. As a factor UᵀDU: D's reciprocals on the diagonal."""

    a00: float
    a01: float
    a02: float
    a03: float
    a11: float
    a12: float
    a13: float
    a22: float
    a23: float
    a33: float


class Vector4(NamedTuple):
    """Four numbers."""

    a0: float
    a1: float
    a2: float
    a3: float


@kernel
def factor4(f: Symmetric4, singular: float) -> tuple[bool, Symmetric4]:
    """The factor of f; False where f is not positive definite. singular: as of `cholesky`."""
    u00 = 1 / f.a00
    u01, u02, u03 = f.a01 * u00, f.a02 * u00, f.a03 * u00
    d1 = f.a11 - u01 * f.a01
    u11 = 1 / d1
    e12, e13 = f.a12 - u01 * f.a02, f.a13 - u01 * f.a03
    u12, u13 = e12 * u11, e13 * u11
    d2 = f.a22 - u02 * f.a02 - u12 * e12
    u22 = 1 / d2
    e23 = f.a23 - u02 * f.a03 - u12 * e13
    u23 = e23 * u22
    d3 = f.a33 - u03 * f.a03 - u13 * e13 - u23 * e23
    definite = f.a00 > 0 and d1 > singular * f.a11 and d2 > singular * f.a22 and d3 > singular * f.a33
    return definite, Symmetric4(u00, u01, u02, u03, u11, u12, u13, u22, u23, 1 / d3)


@kernel
def solve4(u: Symmetric4, b: Vector4) -> Vector4:
    """The solution x of UᵀDU x = b."""
    y1 = b.a1 - u.a01 * b.a0
    y2 = b.a2 - u.a02 * b.a0 - u.a12 * y1
    x3 = (b.a3 - u.a03 * b.a0 - u.a13 * y1 - u.a23 * y2) * u.a33
    x2 = y2 * u.a22 - u.a23 * x3
    x1 = y1 * u.a11 - u.a12 * x2 - u.a13 * x3
    return Vector4(b.a0 * u.a00 - u.a01 * x1 - u.a02 * x2 - u.a03 * x3, x1, x2, x3)
