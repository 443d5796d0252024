"""The bundle solved by the engine, and its linearisations as the bundle's own terms give them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib import engine
from calib.bundle.on_target import OnTargetLinearised
from calib.bundle.problem import Bundle
from calib.engine import Result
from geometry import Linearised, State

Array = NDArray[np.float64]


def solve_bundle(bundle: Bundle, start: State, max_iterations: int = 60) -> Result:
    """Least squares over SCP, places, shape and what is estimated of the robot."""
    return engine.solve((*bundle.terms, *bundle.further), bundle.unknowns, start, max_iterations=max_iterations)


def linearisations(result: Result) -> tuple[OnTargetLinearised, ...]:
    """The bundle's linearised terms at its solution."""
    lins = tuple(lin for lin in result.linearised if isinstance(lin, OnTargetLinearised))
    if not lins:
        raise TypeError("the result is of another problem")
    return lins


def other_linearisations(result: Result) -> tuple[Linearised, ...]:
    """Those of the evidence beside the points."""
    return tuple(lin for lin in result.linearised if not isinstance(lin, OnTargetLinearised))


def hand_twists(bundle: Bundle, result: Result) -> Array:
    """Twists (F, 6, P) of every frame's hand by the robot's parameters, at the solution."""
    return bundle.by_frame([lin.twists for lin in linearisations(result)])
