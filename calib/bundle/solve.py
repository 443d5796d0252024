"""The bundle solved by the engine, and its linearisation as the bundle's own term gives it."""

from __future__ import annotations

from calib import engine
from calib.bundle.on_target import OnTargetLinearised
from calib.bundle.problem import Bundle
from calib.engine import Result
from geometry import State


def solve_bundle(bundle: Bundle, start: State, max_iterations: int = 60) -> Result:
    """Least squares over SCP, places, shape and what is estimated of the robot."""
    return engine.solve([bundle.term], bundle.unknowns, start, max_iterations=max_iterations)


def linearisation(result: Result) -> OnTargetLinearised:
    """The bundle's linearised term at its solution."""
    lin = result.linearised[0]
    if not isinstance(lin, OnTargetLinearised):
        raise TypeError("the result is of another problem")
    return lin
