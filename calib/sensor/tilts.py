"""All tilts of the chip that the views leave possible, each by its probability.

Tilt, tangential terms and principal point trade places: the parameters that agree with the views lie on a long and bent
valley, far out on which numbers that are known well have moved by many of the σ that a tangent gives them. So it is
walked along: the bundle is solved with the tilt held, at tilts about the answer, or about zero where the answer holds
none. Given the tilt, what is left is as good as Gaussian; every tilt counts by its likelihood and a prior.

An upright chip is a possibility beside a tilt that was taken, and a tilt beside an upright chip that was.

References
----------
Hoeting, Madigan, Raftery & Volinsky, Statistical Science 14 (1999) 382: the moments of an averaged model.
Tierney & Kadane, J. Am. Stat. Assoc. 81 (1986) 82: a density's marginal by a Gaussian at every value that is held.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.engine import Result
from calib.sensor.bundle import TILT_NAMES, TILT_PLACES, SensorBundle, sensor_part, tilted_more
from calib.sensor.terms import CAMERA, PLANE
from calib.sensor.valley import settled
from geometry import State

Array = NDArray[np.float64]

POINTS = 120  # of a view's stripe, by which the tilts are solved: more hardly tell more, for neighbours are alike
TILTED_SHARE = 0.5  # of sensors, before any picture: many line sensors have a Scheimpflug mount
TILT_SIGMA_RAD = float(np.deg2rad(5.0))  # of its angle about either axis: mounts of line sensors have 1° to 10°
LEAST_PROBABILITY = 0.02  # a tilt less likely is none: 1 in 50 such answers may have σ that are too small
_DIRECTIONS, _FINE = 12, 96  # solved, and interpolated between: cost bends by powers of the tilt up to the fourth
_SERIES_LEFT = 4.0  # of the cost, in its last two harmonics
_FIRST_RAD, _FACTOR, _MOST = float(np.deg2rad(0.15)), 1.8, 8  # rings of angles about zero: 0.15° to 9°
_UNLIKELY = 14.0  # cost beyond the least, from which a ring counts for nothing: a likelihood of 0.001
_RINGS = 4  # about a tilt that was taken: Gauss and Laguerre's, true to the fourteenth power of the distance
_BEYOND = 8.0  # σ of a tilt that was taken, from which an upright chip is none


@dataclass(frozen=True, eq=False)
class PossibleTilts:
    """Tilts (K,), each with the camera and the plane that then agree with the views.

    Parameters
    ----------
    weight : ndarray (K,)
        Probabilities, their sum 1.
    tau_rad : ndarray (K, 2)
        The tilts; (0, 0) of an upright chip.
    camera, plane : ndarray (K, 18), (K, 3)
        The solutions, as the bundle has them.
    covariance : ndarray (K, 21, 21)
        Of camera and plane, the tilt held.
    taken : bool
        Whether the answer holds a tilt.
    """

    weight: Array
    tau_rad: Array
    camera: Array
    plane: Array
    covariance: Array
    taken: bool

    @property
    def tilted(self) -> NDArray[np.bool_]:
        """Which have a tilt (K,)."""
        return np.asarray(np.any(self.tau_rad != 0, axis=1))

    @property
    def probability(self) -> float:
        """That the chip is tilted."""
        return float(self.weight[self.tilted].sum())

    @property
    def mean_rad(self) -> Array:
        """Of the tilt (2,), where there is one."""
        mine = self.tilted
        return np.asarray(self.weight[mine] @ self.tau_rad[mine] / self.weight[mine].sum())

    @property
    def sigma_rad(self) -> Array:
        """Of the tilt (2,), where there is one."""
        mine = self.tilted
        return np.asarray(
            np.sqrt(self.weight[mine] @ (self.tau_rad[mine] - self.mean_rad) ** 2 / self.weight[mine].sum())
        )


def possible_tilts(bundle: SensorBundle, result: Result, covariance: Array) -> PossibleTilts | None:
    """The tilts beside an answer.

    Parameters
    ----------
    bundle, result, covariance
        The answer.

    Returns
    -------
    tilts
        None where the answer holds none, and none is likely.
    """
    thin = replace(bundle, views=bundle.views.thinned(POINTS))
    if TILT_NAMES[0] in bundle.terms:
        return _about_taken(thin, result, covariance)
    return _about_none(thin, result, covariance)


def _about_taken(bundle: SensorBundle, result: Result, covariance: Array) -> PossibleTilts:
    """On rings of the distance that the covariance gives to tilts, each solved from the one inside it."""
    free = replace(bundle, terms=tuple(t for t in bundle.terms if t not in TILT_NAMES))
    tau = result.state.vector(CAMERA)[TILT_PLACES]
    places = np.array(result.unknowns.indices(CAMERA))[TILT_PLACES]
    spread = covariance[np.ix_(places, places)]
    root = np.linalg.cholesky(spread)
    square, share = np.polynomial.laguerre.laggauss(_RINGS)
    parts, states = list[_Part](), [(result.state, tau)] * _DIRECTIONS
    for s, w in zip(square, share, strict=True):
        log_area = float(s + np.log(w / _DIRECTIONS) + np.log(2 * np.pi * root[0, 0] * root[1, 1]))
        for k in range(_DIRECTIONS):
            way = 2 * np.pi * k / _DIRECTIONS
            there = tau + root @ (np.sqrt(2 * s) * np.array([np.cos(way), np.sin(way)]))
            start, before = states[k]
            held, state = _held(free, tilted_more(start, there - before), there)
            states[k] = state, there
            parts.append(_Part(there, log_area + _log_density(there) - held.cost / 2, held))
    if tau @ np.linalg.solve(spread, tau) < _BEYOND**2:
        upright, _ = _held(free, tilted_more(result.state, -tau), np.zeros(2), more=True)
        parts.append(_Part(np.zeros(2), float(np.log(1 - TILTED_SHARE)) - upright.cost / 2, upright))
    return _weighed(parts, taken=True)


def _log_density(tau_rad: Array) -> float:
    """Of a tilt, before any picture."""
    return float(np.log(TILTED_SHARE / (2 * np.pi * TILT_SIGMA_RAD**2)) - tau_rad @ tau_rad / (2 * TILT_SIGMA_RAD**2))


def _about_none(bundle: SensorBundle, result: Result, covariance: Array) -> PossibleTilts | None:
    """On rings of angles about zero; None where no tilt is likely."""
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
    way = 2 * np.pi * np.arange(_FINE) / _FINE
    around, near = np.stack([np.cos(way), np.sin(way)], -1), _nearest()
    alone = replace(upright, common=_common(result), covariance=covariance)
    parts = [_Part(np.zeros(2), float(np.log(1 - TILTED_SHARE)) - upright.cost / 2, alone)]
    for ring in rings:
        cost, common = ring.between()
        common = common + (alone.common - upright.common)
        parts += [
            _Part(
                ring.angle_rad * around[f],
                float(np.log(ring.prior * (1 - TILTED_SHARE) / _FINE)) - cost[f] / 2,
                _Held(cost[f], common[f], ring.covariance[near[f]]),
            )
            for f in range(_FINE)
        ]
    found = _weighed(parts, taken=False)
    return found if found.probability >= LEAST_PROBABILITY else None


@dataclass(frozen=True, eq=False)
class _Held:
    """One solution with a tilt held; its cost is less the log of its covariance's volume."""

    cost: float
    common: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class _Part:
    tau_rad: Array
    log_weight: float
    held: _Held


def _weighed(parts: Sequence[_Part], taken: bool) -> PossibleTilts:
    log_weight = np.array([p.log_weight for p in parts])
    weight = np.exp(log_weight - log_weight.max())
    common = np.array([p.held.common for p in parts])
    return PossibleTilts(
        weight / weight.sum(),
        np.array([p.tau_rad for p in parts]),
        common[:, :-3],
        common[:, -3:],
        np.array([p.held.covariance for p in parts]),
        taken,
    )


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


def _held(bundle: SensorBundle, start: State, tau_rad: Array, more: bool = False) -> tuple[_Held, State]:
    """more: whether the start is far."""
    held = replace(bundle, tilt_rad=(float(tau_rad[0]), float(tau_rad[1])))
    result = settled(held, start) if more else held.solve(start)
    u = result.unknowns
    spread = held.covariance_of_all(result)
    scale = np.sqrt(np.maximum(np.diag(spread)[u.free], 1e-300))
    width = np.linalg.slogdet(spread[np.ix_(u.free, u.free)] / np.outer(scale, scale))[1] + 2 * np.log(scale).sum()
    return _Held(result.cost - float(width), _common(result), sensor_part(spread, u)), result.state


def _common(result: Result) -> Array:
    """Camera and plane, one behind the other."""
    return np.concatenate([result.state.vector(CAMERA), result.state.vector(PLANE)])
