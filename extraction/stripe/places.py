"""The places that are fitted: which sections hold a stripe, about where, and what is known of each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.stripe.view import IntArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Places:
    """What is to be fitted (N,), ordered by section, then place.

    section. centre_px: about where. low, high: the half-open range of rows that is this one's own: it ends midway to
    its neighbours. width_px: Gaussian σ expected. stripe: which of the stripes. partner: of a pair fitted jointly, the
    index of the other; -1 for none. faint: whether sections are too faint to be measured alone. ghost: whether their
    stripe is one. doubt: whether another ridge has as good a claim.
    """

    section: IntArray
    centre_px: Array
    low: IntArray
    high: IntArray
    width_px: Array
    stripe: IntArray
    partner: IntArray
    faint: Mask
    ghost: Mask
    doubt: Mask

    def __len__(self) -> int:
        """The number of places."""
        return len(self.section)

    def take(self, chosen: NDArray[np.intp]) -> Places:
        """The chosen places, in order; partners are lost, being indices."""
        if len(chosen) == len(self) and np.all(self.partner < 0):
            return self
        return Places(
            self.section[chosen],
            self.centre_px[chosen],
            self.low[chosen],
            self.high[chosen],
            self.width_px[chosen],
            self.stripe[chosen],
            np.full(len(chosen), -1, np.int32),
            self.faint[chosen],
            self.ghost[chosen],
            self.doubt[chosen],
        )


@dataclass(frozen=True, eq=False)
class StripeFacts:
    """What is asked of a stripe: whether it is a ghost; the number of the first of its pair, or its own; the number of
    the course that it is a piece of.
    """

    ghost: bool
    pair: int
    course: int
