"""Which terms the lens has: those with which the views predict one another best.

A term that only fits lowers the residuals of the views that it was fitted to and none of the others. Sets that predict
alike are told apart by their size: tilt, tangential terms and principal point trade places.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.engine import Result
from calib.sensor.bundle import TILT_NAMES, TILT_PLACES, SensorBundle, plane_start, tilted_start
from calib.sensor.left_out import LeftOutViews, left_out
from calib.sensor.noise import first_noise, with_noise
from calib.sensor.shape import BENDS, FEWEST_VIEWS, PRINT
from calib.sensor.terms import CAMERA
from calib.sensor.valley import settled
from geometry import State

Array = NDArray[np.float64]

# two radial terms and the tangential ones are always there: one that is left out because the views hardly tell it makes
# the σ of those that trade with it ten times too small
RADIAL: tuple[tuple[str, ...], ...] = (("k1", "k2"), ("k1", "k2", "k3"))
RATIONAL = ("k1", "k2", "k3", "k4", "k5", "k6")
TANGENTIAL, TILT = ("p1", "p2"), ("p1", "p2", "tau_x", "tau_y")
EXTRAS = (TANGENTIAL, TILT)  # of a tilt the tangential terms have a prior; prism terms no lens has shown
LENGTH = {"k1": 4, "k2": 4, "p1": 4, "p2": 4, "k3": 5, "k4": 8, "k5": 8, "k6": 8}
LENGTH |= dict.fromkeys(("tau_x", "tau_y"), 14)  # of OpenCV's vector that holds a term
SHAPES: tuple[tuple[str, ...], ...] = (BENDS, (PRINT,))

# surprise of left-out views that each further term must save: what a needless one saves by chance, at most, in one of
# twenty sensors (benchmarks/calibrate_sensor.py --sensors)
PRICE = 2.0
POINTS = 60  # of a view's stripe, which tell terms apart as well as all
_ROUNDS = 2  # radial terms and the others in turn
MAX_CONTRADICTED = 1.0  # standard errors of the views' own gains: one view alone is no evidence


@dataclass(frozen=True, eq=False)
class Choice:
    """The set of terms that was chosen, its solution, and what every set that was tried reached."""

    bundle: SensorBundle
    result: Result
    left_out: LeftOutViews
    tried: tuple[Tried, ...]


@dataclass(frozen=True, eq=False)
class Tried:
    """A set of terms and how it predicts views left out; surprise: minus twice the log of what it predicts for them."""

    terms: tuple[str, ...]
    surprise: float
    reprojection_rms_px: float
    plane_rms_mm: float


@dataclass(frozen=True, eq=False)
class _Fit:
    bundle: SensorBundle
    result: Result
    out: LeftOutViews

    @property
    def score(self) -> float:
        """Surprise of the views left out and the terms' price."""
        return float(self.out.surprise.sum()) + PRICE * len(self.bundle.terms)

    @property
    def error(self) -> float:
        """Squared errors of the views left out, in σ of corners and stripes."""
        return float(np.sum(self.out.corner_deviance) + np.nansum(self.out.stripe_deviance))

    def as_tried(self, terms: tuple[str, ...]) -> Tried:
        """What is told of it; terms: of the lens, where a tilt is held."""
        shape = tuple(t for t in self.bundle.terms if t in (*BENDS, PRINT))
        lens = tuple(t for t in terms if t not in (*BENDS, PRINT))
        out = self.out
        return Tried((*lens, *shape), float(out.surprise.sum()), out.reprojection_rms_px, out.plane_rms_mm)

    def beats(self, other: _Fit) -> bool:
        """Whether this set is to be preferred; a larger one needs a gain that not one view alone gives.

        And smaller errors: where boards are not flat, a density of independent errors is too sharp, and a larger set
        may be thought likelier though it predicts worse.
        """
        if not self.result.converged or self.score >= other.score:
            return False
        if len(self.bundle.terms) > len(other.bundle.terms) and self.error >= other.error:
            return False
        each = other.out.surprise - self.out.surprise
        error = float(np.sqrt(len(each)) * np.std(each))
        return len(self.bundle.terms) <= len(other.bundle.terms) or float(each.sum()) > MAX_CONTRADICTED * error


def choose_terms(bundle: SensorBundle, start: State, max_terms: int = 14) -> Choice:
    """The set of terms out of those that fit into ``max_terms`` of OpenCV's vector, and the board's shape with them.

    A board that is not as stated makes a lens seem needed that is not there: the lens is chosen anew where a shape is
    taken, and the noise, which is then less, may show more of the shape.
    """
    bundle = replace(bundle, views=bundle.views.thinned(POINTS))
    shape: tuple[str, ...] = ()
    choice = _choose_lens(bundle, start, max_terms, shape)
    tried = choice.tried
    for _ in range(len(SHAPES)):
        taken, more = _choose_shape(choice, shape)
        tried = (*tried, *more)
        if taken == shape:
            break
        shape = taken
        choice = _choose_lens(bundle, start, max_terms, shape)
        tried = (*tried, *choice.tried)
    return replace(choice, tried=tried)


def _choose_shape(choice: Choice, before: tuple[str, ...]) -> tuple[tuple[str, ...], tuple[Tried, ...]]:
    """The terms of the board's shape with which left-out views are predicted better, and those that were tried."""
    known = choice.bundle.shape
    if known is None:
        return before, ()
    bundle, state = choice.bundle, choice.result.state
    if TILT[-1] in bundle.terms:  # held where it is: which shape the board has does not hang on it
        tau_x, tau_y = state.vector(CAMERA)[TILT_PLACES]
        bundle = replace(bundle, tilt_rad=(float(tau_x), float(tau_y)))
    lens = tuple(t for t in bundle.terms if t not in (*TILT_NAMES, *BENDS, PRINT))
    open_ = {BENDS: bool(np.all(known.sigma_bend > 0)), (PRINT,): len(known.corners_mm) > 0}

    def fit(shape: tuple[str, ...]) -> _Fit:
        mine = replace(bundle, terms=(*lens, *shape))
        found = mine.solve(state)
        return _Fit(mine, found, left_out(mine, found))

    first = best = fit(before)
    fits = list[_Fit]()
    for more in SHAPES:
        shape = tuple(t for t in (*BENDS, PRINT) if t in (*before, *more))
        possible = open_[more] and shape != before
        if possible and min(len(choice.bundle.views), len(first.out.surprise)) >= FEWEST_VIEWS:
            fits.append(fit(shape))
            best = fits[-1] if fits[-1].beats(best) else best
    taken = tuple(t for t in best.bundle.terms if t in (*BENDS, PRINT))
    return taken, tuple(f.as_tried(choice.bundle.terms) for f in fits)


def _choose_lens(bundle: SensorBundle, start: State, max_terms: int, shape: tuple[str, ...]) -> Choice:
    """The terms of the lens, beside those of the board's shape."""
    usual = tuple(t for t in (*RADIAL[0], *TANGENTIAL) if LENGTH[t] <= max_terms)
    first = replace(bundle, terms=(*usual, *shape))
    corners = first.without_stripes().solve(start)
    first = first_noise(first, replace(corners, state=plane_start(first.views, corners.state)))
    upright = first.solve(plane_start(first.views, corners.state))
    widest, result = first, upright
    if LENGTH[TILT[-1]] <= max_terms:
        wider = replace(first, terms=(*RADIAL[0], *TILT, *shape))
        tilted = _tilted(wider, (plane_start(first.views, start), upright.state))
        better = tilted.cost < upright.cost
        widest, result = (wider, tilted) if better else (first, upright)
    noise = with_noise(widest, result)
    fits: dict[tuple[str, ...], _Fit] = {}

    def best_of(best: _Fit | None, sets: Sequence[tuple[str, ...]]) -> _Fit:
        for terms in sets:
            if any(LENGTH[t] > max_terms for t in terms):
                continue
            if terms not in fits:
                mine = replace(noise, terms=(*terms, *shape))
                found = settled(mine, (result if TILT[-1] in terms and widest is not first else upright).state)
                fits[terms] = _Fit(mine, found, left_out(mine, found))
            best = fits[terms] if best is None or fits[terms].beats(best) else best
        return best or best_of(None, [()])

    def extra_of(fit: _Fit) -> tuple[str, ...]:
        return tuple(t for t in fit.bundle.terms if t in TILT)

    best = best_of(None, [(*RADIAL[0], *extra) for extra in EXTRAS])
    for _ in range(_ROUNDS):
        best = best_of(best, [(*radial, *extra_of(best)) for radial in (*RADIAL, RATIONAL)])
        radial = tuple(t for t in best.bundle.terms if t in RATIONAL)
        best = best_of(best, [(*radial, *extra) for extra in EXTRAS])
    return Choice(best.bundle, best.result, best.out, tuple(f.as_tried(f.bundle.terms) for f in fits.values()))


def _tilted(bundle: SensorBundle, starts: Sequence[State]) -> Result:
    """The best solution with a tilted chip, from several solutions without.

    A tilt moves the principal point of the camera without tilt that fits best, and the valley between the two is long:
    the start is at its far end.
    """
    found = [bundle.solve(tilted_start(start)) for start in starts] + [bundle.solve(starts[-1])]
    best = min(found, key=lambda r: round(r.cost, 3))
    return best if best.converged else settled(bundle, best.state)
