"""Results as files hold them: rounded well above their last bits, which hang on the processor, far below their σ.

A sum's order, a fused product or a library's sine leaves some 1e-16 of a number to the processor, solving a system
some 1e-10 of a millimetre. Files that are to be the same everywhere hold less than that.
"""

from __future__ import annotations

import json
import math
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

DIGITS = 9  # significant, of any number
DECIMALS = 7  # at most: of mm, px, degrees, and of what has no unit
ROTATION_DECIMALS = 9  # of the entries of a rotation: a micrometre at a kilometre
COVARIANCE_DIGITS = 6  # of a σ, and places of a correlation
_MOST_PLACES, _SPOILT = 13, 0.05  # of a correlation, and what of its least eigenvalue rounding may change
_SIGMA_PLACES = 6  # of a number, below the first digit of its σ: numbers that only count together keep what they say


def rounded(value: Any, name: str = "") -> Any:
    """A value of plain data (dicts, lists, numbers, text) or arrays, as plain data with its floats rounded.

    name: the key under which it stands. ``T_…`` are transforms, ``covariance`` those of σ in mixed units; both as rows
    or flat.
    """
    if isinstance(value, dict):
        return {str(k): rounded(v, str(k)) for k, v in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return rounded(value.tolist(), name)
    if isinstance(value, list | tuple):
        if name.startswith("T_") and _is_full(value, (4, 4)):
            return _like(rounded_transform(value), value)
        if name == "covariance" and (_is_full(value, (6, 6)) or _is_full(value, (2, 2))):
            return _like(rounded_covariance(value), value)
        return [rounded(v, name) for v in value]
    return rounded_number(value) if isinstance(value, float) else value


def rounded_number(value: float, decimals: int = DECIMALS) -> float:
    """A number to DIGITS significant digits and no more than ``decimals`` places, never a negative zero."""
    return round(float(f"{value:.{DIGITS}g}"), decimals) + 0.0 if math.isfinite(value) else value


def rounded_by_sigma(value: float, sigma: float) -> float:
    """A number to a millionth of its σ; as any other where the σ is none."""
    if not 0 < sigma < math.inf:
        return rounded_number(value)
    return round(value, _SIGMA_PLACES - math.floor(math.log10(sigma))) + 0.0


def _is_full(value: Any, shape: tuple[int, int]) -> bool:
    """Whether the rows, or the flat list, are a matrix of numbers of that shape."""
    try:
        m = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        return False
    return m.shape in (shape, (shape[0] * shape[1],)) and bool(np.all(np.isfinite(m)))


def rounded_transform(value: ArrayLike) -> NDArray[np.float64]:
    """A transform (4, 4), or its 16 numbers, with lengths and rotation rounded."""
    m = np.array(value, dtype=float).reshape(4, 4)
    translation = [rounded_number(float(t)) for t in m[:3, 3]]
    m = np.round(m, ROTATION_DECIMALS)
    m[:3, 3] = translation
    return m + 0.0


def rounded_covariance(value: ArrayLike) -> NDArray[np.float64]:
    """A covariance (n, n), or its n² numbers, by σ and correlations rounded.

    An entry near zero is rounding noise of the diagonal's size. Where unknowns trade places, correlations near 1 keep
    the places that say what the unknowns are known to together; no rounding makes a variance of theirs negative.
    """
    m = np.array(value, dtype=float)
    m = m.reshape((math.isqrt(m.size),) * 2)
    variance = np.diag(m)
    if not np.all(variance > 0):
        return np.array([float(f"{v:.{COVARIANCE_DIGITS}g}") for v in m.ravel()]).reshape(m.shape)
    sigma = np.array([float(f"{s:.{COVARIANCE_DIGITS}g}") for s in np.sqrt(variance)])
    correlation = m / np.sqrt(np.outer(variance, variance))
    least = float(np.linalg.eigvalsh(correlation)[0]) or math.ulp(1.0)
    places = COVARIANCE_DIGITS
    while places < _MOST_PLACES and abs(np.linalg.eigvalsh(np.round(correlation, places))[0] / least - 1) > _SPOILT:
        places += 1
    return np.asarray(np.round(correlation, places) * np.outer(sigma, sigma)) + 0.0


def _like(matrix: NDArray[np.float64], value: Any) -> Any:
    """The matrix as rows, or flat where ``value`` is."""
    return matrix.tolist() if isinstance(value[0], list | tuple) else matrix.ravel().tolist()


def clean(value: Any) -> Any:
    """Plain JSON values: arrays as lists, numpy numbers as numbers, what is not finite as None."""
    if isinstance(value, dict):
        return {str(k): clean(v) for k, v in value.items()}
    if isinstance(value, np.ndarray):
        return clean(value.tolist())
    if isinstance(value, list | tuple):
        return [clean(v) for v in value]
    if isinstance(value, np.generic):
        return clean(value.item())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    return value


def json_text(value: Any, indent: int | None = 1) -> str:
    """One JSON object as ASCII text without NaN, its numbers rounded so that every processor writes the same."""
    return json.dumps(rounded(clean(value)), indent=indent, allow_nan=False)
