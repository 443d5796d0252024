"""A robot's uncertain numbers by name: unit, prior and group of each, rows by joint, and random errors of that size."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SYMBOLS = {"theta": "θ", "alpha": "α", "beta": "β"}  # the others are printed as they are named


@dataclass(frozen=True)
class Parameter:
    """One number of a robot that is not known exactly.

    Parameters
    ----------
    name
        What it is and of which joint, counted from 1: "theta1", "d2", "alpha4", "compliance3".
    unit
        "rad", "mm", "rad/Nm", …: of its corrections and of ``sigma``.
    sigma
        Prior standard deviation; 0 for a number that is known exactly.
    group
        What it is estimated or held together with: "theta", "d", "a", "alpha", "beta", "compliance", …
    """

    name: str
    unit: str
    sigma: float
    group: str

    @cached_property
    def row(self) -> str:
        """The name without its joint: "theta" of "theta1"."""
        return self.name.rstrip("0123456789")

    @cached_property
    def joint(self) -> int | None:
        """The joint, counted from 1; None where the name has none."""
        number = self.name[len(self.row) :]
        return int(number) if number else None

    @property
    def symbol(self) -> str:
        """The name as it is printed: "θ1", "α4", "d2"."""
        return SYMBOLS.get(self.row, self.row) + self.name[len(self.row) :]
