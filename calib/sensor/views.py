"""What a sensor is calibrated from: a board's corners and the laser stripe on it, view by view, as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Corners:
    """Corners of a board as seen.

    Parameters
    ----------
    xy_mm : ndarray (N, 2)
        Where they lie on the board.
    uv_px : ndarray (N, 2)
        Where they are seen.
    covariance_px2 : ndarray (N, 2, 2)
        Of uv_px.
    """

    xy_mm: Array
    uv_px: Array
    covariance_px2: Array

    def __len__(self) -> int:
        """The number of corners."""
        return len(self.uv_px)

    def __getitem__(self, chosen: Mask | Index) -> Corners:
        """The chosen corners."""
        return Corners(self.xy_mm[chosen], self.uv_px[chosen], self.covariance_px2[chosen])


@dataclass(frozen=True, eq=False)
class StripePoints:
    """Points of a laser stripe in the image, in order along it.

    Parameters
    ----------
    uv_px : ndarray (M, 2)
        The stripe's centre.
    normal : ndarray (M, 2)
        Unit vectors along which it was localised.
    sigma_px : ndarray (M,)
        Standard deviation along them.
    """

    uv_px: Array
    normal: Array
    sigma_px: Array

    def __len__(self) -> int:
        """The number of points."""
        return len(self.uv_px)

    def __getitem__(self, chosen: Mask | Index | slice) -> StripePoints:
        """The chosen points."""
        return StripePoints(self.uv_px[chosen], self.normal[chosen], self.sigma_px[chosen])

    @staticmethod
    def nothing() -> StripePoints:
        """No point."""
        return StripePoints(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))


@dataclass(frozen=True, eq=False)
class BoardView:
    """One pose of the board: its corners and the stripe on it (which may hold no point).

    Parameters
    ----------
    name : str
    corners : Corners
    stripe : StripePoints
    soft : bool
        If out of focus.
    axes : bool
        Whether the corners' x and y are the board's own, up to a turn by 180°; of a part of a checkerboard they may be
        turned by 90°.
    named : bool
        Whether the same place on the board is the same corner in every view.
    """

    name: str
    corners: Corners
    stripe: StripePoints
    soft: bool = False
    axes: bool = False
    named: bool = False


@dataclass(frozen=True, eq=False)
class BoardViews:
    """All views, their points one after the other."""

    views: tuple[BoardView, ...]

    @staticmethod
    def of(views: Sequence[BoardView]) -> BoardViews:
        """The views in their order."""
        return BoardViews(tuple(views))

    def __len__(self) -> int:
        """The number of views."""
        return len(self.views)

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return tuple(v.name for v in self.views)

    @cached_property
    def corners(self) -> Corners:
        """All corners."""
        every = [v.corners for v in self.views]
        return Corners(*(np.concatenate([getattr(c, n) for c in every]) for n in Corners.__dataclass_fields__))

    @cached_property
    def stripe(self) -> StripePoints:
        """All points of stripes."""
        every = [v.stripe for v in self.views]
        return StripePoints(
            *(np.concatenate([getattr(s, n) for s in every]) for n in StripePoints.__dataclass_fields__)
        )

    @cached_property
    def axes(self) -> Mask:
        """Of which views (V,) the corners' axes are the board's own."""
        return np.array([v.axes for v in self.views], dtype=bool)

    @cached_property
    def named(self) -> Mask:
        """Of which views (V,) the corners are known by their places."""
        return np.array([v.named for v in self.views], dtype=bool)

    @cached_property
    def view_of_corner(self) -> Index:
        """Whose corner each is (ΣN,)."""
        return np.repeat(np.arange(len(self)), [len(v.corners) for v in self.views])

    @cached_property
    def view_of_stripe(self) -> Index:
        """Whose stripe each point belongs to (ΣM,)."""
        return np.repeat(np.arange(len(self)), [len(v.stripe) for v in self.views])

    def __getitem__(self, chosen: Mask | Index) -> BoardViews:
        """The chosen views."""
        return BoardViews(tuple(self.views[i] for i in np.arange(len(self))[chosen]))

    def thinned(self, points: int) -> BoardViews:
        """The views with every n-th point of their stripes, so that no more than that many are left."""
        steps = (-(-len(v.stripe) // points) or 1 for v in self.views)
        return BoardViews(tuple(replace(v, stripe=v.stripe[::n]) for v, n in zip(self.views, steps, strict=True)))
