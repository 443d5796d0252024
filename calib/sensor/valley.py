"""The least-squares solution where a tilt of the chip is free: along the bent valley to its lowest place.

Tilt, tangential terms, principal point and the boards' turns trade places. Straight steps of all of them together leave
the valley so soon that they must be damped until they are short, far from its lowest place. Given the tilt, the rest is
well determined: so the tilt alone is moved, by the step that the normal equations propose, the rest following; what the
valley's bend adds to its curvature is learnt from one step to the next.

References
----------
Broyden, Mathematics of Computation 19 (1965) 577: the slope of a system learnt from its steps.
Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413: a problem in those variables that make it difficult.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.engine import Result, normal_step
from calib.sensor.bundle import TILT_NAMES, TILT_PLACES, SensorBundle, tilted_more
from calib.sensor.terms import CAMERA
from geometry import State, Step

Array = NDArray[np.float64]

_MORE = 4  # solutions one after the other, before a set of terms is given up
_STEPS = 12  # of the tilt: five are usual
_HALVED = 5  # times, that a step may be
_INNER_STEPS = 10  # of the rest: two or three are usual
_LOWEST_SIGMA = 1e-4  # a step of the tilt so short that it is at the valley's lowest place
_INNER_SIGMA = 1e-3  # to which the rest follows: its last step is shorter by its square
_JUDGED_SIGMA = 0.01  # a shorter step is taken as it is: the rounding of the cost must not decide


def settled(bundle: SensorBundle, start: State) -> Result:
    """As ``bundle.solve``, gone on with while the iteration has not settled, and down the valley of a free tilt."""
    result = bundle.solve(start)
    if TILT_NAMES[0] in bundle.terms:
        return _lowest(bundle, result)
    for _ in range(_MORE):
        if result.converged:
            break
        result = bundle.solve(result.state)
    return result


@dataclass(frozen=True, eq=False)
class _Place:
    """A solution with the tilt as it is, and the step from it that the normal equations propose."""

    result: Result
    step: Step

    @staticmethod
    def of(bundle: SensorBundle, state: State) -> _Place:
        result = bundle.solve(state, max_steps=0)
        return _Place(result, normal_step(result.normal, result.unknowns.free, 0.0))

    @property
    def tilt_step(self) -> Array:
        """Proposed for the tilt (2,)."""
        places = np.array(self.result.unknowns.indices(CAMERA))[TILT_PLACES]
        return np.asarray(self.step.common[places])

    def moved(self, bundle: SensorBundle, by: Array) -> _Place:
        """At the tilt that is more by (2,), all else solved anew."""
        start = tilted_more(self.result.state, by)
        tilt = start.vector(CAMERA)[TILT_PLACES]
        rest = tuple(t for t in bundle.terms if t not in TILT_NAMES)
        held = replace(bundle, terms=rest, tilt_rad=(float(tilt[0]), float(tilt[1])))
        return _Place.of(bundle, held.solve(start, max_steps=_INNER_STEPS, settled_sigma=_INNER_SIGMA).state)


def _lowest(bundle: SensorBundle, result: Result) -> Result:
    here = _Place.of(bundle, result.state)
    gain = np.eye(2)  # of the step over what is proposed
    for _ in range(_STEPS):
        if here.step.decrement < _LOWEST_SIGMA**2:
            return replace(here.result, converged=True)
        move = gain @ here.tilt_step
        there = here.moved(bundle, move)
        for _ in range(_HALVED):
            if there.result.cost <= here.result.cost or here.step.decrement < _JUDGED_SIGMA**2:
                break
            move = move / 2
            there = here.moved(bundle, move)
        else:
            return here.result
        learnt = gain @ (here.tilt_step - there.tilt_step)
        if (along := move @ learnt) != 0:
            gain = gain + np.outer(move - learnt, move @ gain) / along
        here = there
    return here.result
