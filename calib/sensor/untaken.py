"""A tilt of the chip that was not taken, because the views do not show it beyond chance: how likely it is all the same.

The answer holds a tilt of zero, and tilt, tangential terms and principal point trade places: were the chip tilted by an
angle that the views can not tell from none, the principal point would be wrong by many of the σ that an upright chip
leaves it. The σ that are stated are those of all tilts, each by its probability: second moments about the answer. The
valley of tilts is long and bent, so it is walked along: the bundle is solved at angles about zero.

References
----------
Hoeting, Madigan, Raftery & Volinsky, Statistical Science 14 (1999) 382: the moments of an averaged model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.engine import Covariance, Result
from calib.sensor.bundle import SensorBundle, tilted_more
from calib.sensor.choice import POINTS
from calib.sensor.terms import CAMERA, PLANE
from geometry import State

Array = NDArray[np.float64]

TILT_NAMES = ("tau_x", "tau_y")
TILTED_SHARE = 0.5  # of sensors, before any picture: many line sensors have a Scheimpflug mount
TILT_SIGMA_RAD = float(np.deg2rad(5.0))  # of its angle about either axis: mounts of line sensors have 1° to 10°
LEAST_PROBABILITY = 0.02  # a tilt less likely is none: 1 in 50 such answers may have σ that are too small
_DIRECTIONS, _FINE = 12, 96  # solved, and interpolated between: cost bends by powers of the tilt up to the fourth
_SERIES_LEFT = 4.0  # of the cost, in its last two harmonics
_FIRST_RAD, _FACTOR, _MOST = float(np.deg2rad(0.15)), 1.8, 8  # rings of angles: 0.15° to 9°
_UNLIKELY = 14.0  # cost beyond the least, from which a ring counts for nothing: a likelihood of 0.001


@dataclass(frozen=True, eq=False)
class UntakenTilt:
    """A tilt that the answer does not hold.

    Parameters
    ----------
    probability : float
        That the chip is tilted.
    tau_rad, sigma_rad : ndarray (2,)
        What it then is, and its σ.
    covariance : Covariance
        Of camera and plane about the answer, over all tilts.
    """

    probability: float
    tau_rad: Array
    sigma_rad: Array
    covariance: Covariance


@dataclass(frozen=True, eq=False)
class _Ring:
    """Solutions with a tilt held, at one angle and all directions (D,).

    cost: minus twice the log of their likelihood; prior: odds of the ring over an upright chip; common (D, C), and
    covariance (D, C, C) with the tilt held.
    """

    angle_rad: float
    cost: Array
    prior: float
    common: Array
    covariance: Array

    def between(self) -> tuple[Array, Array]:
        """Cost (F,) and common (F, C) at finer directions, by their Fourier series round the ring.

        Where the series has not ended, far out where the cost is steep, the nearest directions' as they are.
        """
        every = np.fft.rfft(np.column_stack([self.cost, self.common]), axis=0)
        if 2 / len(self.cost) * float(np.abs(every[-2:, 0]).max()) > _SERIES_LEFT:
            near = _nearest()
            return self.cost[near], self.common[near]
        fine = np.fft.irfft(every, _FINE, axis=0) * (_FINE / len(self.cost))
        return fine[:, 0], fine[:, 1:]


def _nearest() -> NDArray[np.intp]:
    """Which direction is nearest to each finer one (F,)."""
    return np.round(np.arange(_FINE) * _DIRECTIONS / _FINE).astype(np.intp) % _DIRECTIONS


def untaken_tilt(bundle: SensorBundle, result: Result, covariance: Covariance) -> UntakenTilt | None:
    """The tilt that a solution without one leaves possible; None where it holds one, or none is likely.

    Parameters
    ----------
    bundle, result, covariance
        The answer.
    """
    if TILT_NAMES[0] in bundle.terms:
        return None
    bundle = replace(bundle, views=bundle.views.thinned(POINTS))
    upright, state = _held(bundle, result.state, np.zeros(2))
    ring, states = _ring(bundle, [state] * _DIRECTIONS, 0.0, 0)
    rings, least = [ring], min(upright.cost, float(ring.between()[0].min()))
    for j in range(1, _MOST):
        ring, states = _ring(bundle, states, rings[-1].angle_rad, j)
        lowest = float(ring.between()[0].min())
        if lowest > least + _UNLIKELY:
            break
        least = min(least, lowest)
        rings.append(ring)
    return _averaged(upright, rings, least, covariance)


def _averaged(upright: _Held, rings: Sequence[_Ring], least: float, covariance: Covariance) -> UntakenTilt | None:
    way = 2 * np.pi * np.arange(_FINE) / _FINE
    weights, off, taus, spreads = [], [], [], []
    for ring in rings:
        cost, common = ring.between()
        weights.append(ring.prior / _FINE * np.exp((least - cost) / 2))
        off.append(common - upright.common)
        taus.append(ring.angle_rad * np.stack([np.cos(way), np.sin(way)], -1))
        spreads.append(ring.covariance[_nearest()])
    weight = np.concatenate(weights)
    total = float(weight.sum() + np.exp((least - upright.cost) / 2))
    probability = float(weight.sum() / total)
    if not probability >= LEAST_PROBABILITY:
        return None
    tau, away = np.concatenate(taus), np.concatenate(off)
    mean = weight @ tau / weight.sum()
    both = (1 - probability) * covariance.total + (away.T * (weight / total)) @ away
    both = both + np.einsum("k,kij->ij", weight / total, np.concatenate(spreads))
    spread = np.sqrt(weight @ (tau - mean) ** 2 / weight.sum())
    return UntakenTilt(probability, mean, spread, replace(covariance, total=(both + both.T) / 2))


def _prior(angle_rad: float, first: bool) -> float:
    """Odds of a tilt of about an angle; rings meet half way between the logarithms of their angles."""
    inner, outer = 0.0 if first else angle_rad / np.sqrt(_FACTOR), angle_rad * np.sqrt(_FACTOR)
    share = np.exp(-(inner**2) / (2 * TILT_SIGMA_RAD**2)) - np.exp(-(outer**2) / (2 * TILT_SIGMA_RAD**2))
    return float(TILTED_SHARE / (1 - TILTED_SHARE) * share)


def _ring(bundle: SensorBundle, starts: Sequence[State], from_rad: float, number: int) -> tuple[_Ring, list[State]]:
    """A ring of tilts, each solved from the one inside it."""
    angle = _FIRST_RAD * _FACTOR**number
    found, states = list[_Held](), list[State]()
    for k, start in enumerate(starts):
        way = 2 * np.pi * k / _DIRECTIONS
        toward = np.array([np.cos(way), np.sin(way)])
        held, state = _held(bundle, tilted_more(start, (angle - from_rad) * toward), angle * toward)
        found.append(held)
        states.append(state)
    cost, common, covariance = (np.array([getattr(h, n) for h in found]) for n in ("cost", "common", "covariance"))
    return _Ring(angle, cost, _prior(angle, number == 0), common, covariance), states


@dataclass(frozen=True, eq=False)
class _Held:
    """One solution with a tilt held; its cost is less the log of its covariance's volume."""

    cost: float
    common: Array
    covariance: Array


def _held(bundle: SensorBundle, start: State, tau_rad: Array) -> tuple[_Held, State]:
    held = replace(bundle, tilt_rad=(float(tau_rad[0]), float(tau_rad[1])))
    result = held.solve(start)
    u, state = result.unknowns, result.state
    spread = held.covariance(result).total
    scale = np.sqrt(np.maximum(np.diag(spread)[u.free], 1e-300))
    width = np.linalg.slogdet(spread[np.ix_(u.free, u.free)] / np.outer(scale, scale))[1] + 2 * np.log(scale).sum()
    common = np.zeros(u.size)
    common[u[CAMERA]], common[u[PLANE]] = state.vector(CAMERA), state.vector(PLANE)
    return _Held(result.cost - float(width), common, spread), state
