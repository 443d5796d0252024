"""A direct map from pixels to the laser plane, as makers of sensors store it: no camera, no lens, no pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError

Array = NDArray[np.float64]

MOST_POWER = 12  # of a polynomial's terms: beyond, the borders of an image are made of rounding


@dataclass(frozen=True, eq=False)
class DirectMap:
    """(u, v) to (y, z) [mm] of the laser plane: a homography or a polynomial.

    Parameters
    ----------
    homography : ndarray (3, 3) or None
        (u, v, 1) to (y, z, 1), up to a factor.
    polynomial : tuple of (i, j, y, z)
        Coefficients [mm] of uⁱvʲ, in pixels from the image's centre over its half diagonal; empty for a homography.
    rms_mm : float
        What it leaves of the points that it was fitted to, root mean square of their distances.
    seen_px : (u, v, u, v) or None
        Least and largest pixel that it was fitted to; beyond them it says nothing. None where it holds everywhere.

    Raises
    ------
    InputError
        Where the numbers can not be such a map.
    """

    homography: Array | None = None
    polynomial: tuple[tuple[int, int, float, float], ...] = ()
    rms_mm: float = 0.0
    seen_px: tuple[float, float, float, float] | None = None

    def __post_init__(self) -> None:
        if (self.homography is None) == (not self.polynomial):
            raise InputError("[direct] has homography or polynomial: exactly one of them")
        if self.homography is not None:
            h = self.homography
            scale = float(np.abs(h).max()) if h.shape == (3, 3) and np.all(np.isfinite(h)) else 0.0
            if scale == 0 or np.linalg.matrix_rank(h) < 3:
                raise InputError("[direct] homography must be an invertible 3 × 3 matrix of finite numbers")
        for i, j, y, z in self.polynomial:
            if not (min(i, j) >= 0 and i + j <= MOST_POWER and np.isfinite([y, z]).all()):
                raise InputError(
                    f"[direct] polynomial has the row [{i}, {j}, {y:g}, {z:g}]: two powers, {MOST_POWER} "
                    "together at most, and two finite coefficients are right"
                )
        if len({row[:2] for row in self.polynomial}) < len(self.polynomial):
            raise InputError("[direct] polynomial has two rows of the same powers")
        if not 0 <= self.rms_mm < np.inf:
            raise InputError(f"[direct] rms_mm = {self.rms_mm:g}: must be finite and not negative")
        box = self.seen_px
        if box is not None and not (box[0] < box[2] and box[1] < box[3]):
            raise InputError("[direct] seen_px is [least u, least v, largest u, largest v]")

    def to_sheet(self, uv_px: Array, size_px: tuple[int, int]) -> tuple[Array, Array]:
        """Points (N, 2) [mm] of the laser plane seen at pixels (N, 2), and their Jacobian (N, 2, 2) by the pixel.

        size_px: width and height of the image. NaN beyond the pixels that the map was fitted to.
        """
        yz, jacobian = self._by_homography(uv_px) if self.homography is not None else self._by_powers(uv_px, size_px)
        if self.seen_px is not None:
            low, high = np.array(self.seen_px[:2]), np.array(self.seen_px[2:])
            beyond = ~np.all((uv_px >= low) & (uv_px <= high), axis=1)
            yz[beyond], jacobian[beyond] = np.nan, np.nan
        return yz, jacobian

    def _by_homography(self, uv: Array) -> tuple[Array, Array]:
        assert self.homography is not None  # noqa: S101 - asked before
        h = self.homography
        w = uv @ h[2, :2] + h[2, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            yz = (uv @ h[:2, :2].T + h[:2, 2]) / w[:, None]
            jacobian = (h[:2, :2] - yz[:, :, None] * h[2, :2]) / w[:, None, None]
        return yz, jacobian

    def _by_powers(self, uv: Array, size_px: tuple[int, int]) -> tuple[Array, Array]:
        half = np.hypot(*size_px) / 2
        at = (uv - (np.array(size_px) - 1) / 2) / half
        yz, jacobian = np.zeros((len(uv), 2)), np.zeros((len(uv), 2, 2))
        for i, j, *c in self.polynomial:
            u, v = at[:, 0] ** i, at[:, 1] ** j
            yz += np.outer(u * v, c)
            by_u = i * at[:, 0] ** max(i - 1, 0) * v / half
            by_v = j * at[:, 1] ** max(j - 1, 0) * u / half
            jacobian += np.array(c)[None, :, None] * np.stack([by_u, by_v], -1)[:, None, :]
        return yz, jacobian
