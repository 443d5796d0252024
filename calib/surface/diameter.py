"""Whether a ball is as large as stated: its diameter estimated from the data, against the number in the file."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np

from calib.bundle import Solution, given_noise, reweighed, solve_bundle
from calib.config import CalibConfig
from calib.engine import covariance
from geometry import Target, target_at
from jig_cad import Sphere

Targets = Target | Mapping[str, Target]

_SIGMAS = 5.0  # of a sound cell none in a million is farther off
_LEAST_MM = 0.005  # nobody states a ball's diameter better
_ROUNDS = 3  # of the noise of hand poses, each by a factor of up to 2.7 in a variance


@dataclass(frozen=True)
class Diameter:
    """A ball's diameter as stated, and as the data have it."""

    stated_mm: float
    estimated_mm: float
    sigma_mm: float

    @property
    def off_sigma(self) -> float:
        """How many σ the data are off what was stated."""
        return abs(self.estimated_mm - self.stated_mm) / self.sigma_mm

    @property
    def contradicted(self) -> bool:
        """Whether chance is no explanation."""
        return self.off_sigma > _SIGMAS and abs(self.estimated_mm - self.stated_mm) > _LEAST_MM

    @property
    def text(self) -> str:
        """In a sentence."""
        return (
            f"the ball's diameter is {self.estimated_mm:.3f} ± {self.sigma_mm:.3f} mm by the data and "
            f"{self.stated_mm:g} mm by target.toml, {self.off_sigma:.0f} σ apart: it was estimated instead; measure "
            "the ball and mend diameter_mm"
        )


def contradicted_diameter(solution: Solution, config: CalibConfig) -> Diameter | None:
    """The first ball of a solution whose stated diameter the data contradict, None where all are right.

    Each is estimated without its prior, everything else as it was; but the noise of hand poses, where it is learnt from
    the residuals, took a wrong diameter for noise, and is found anew. One that was solved for without a stated number
    is no contradiction.
    """
    learnt = solution.bundle.hands.poses_only and not given_noise(config)
    for term in solution.bundle.terms:
        if not isinstance(term.target, Sphere) or not term.target.known:
            continue
        free = solution.bundle.knowing(**{term.shape_block: np.array([np.inf])}).estimating(solution.applied)
        try:
            found = solve_bundle(free, solution.result.state)
            for _ in range(_ROUNDS if learnt else 0):
                free = reweighed(free, found)
                found = solve_bundle(free, found.state)
        except np.linalg.LinAlgError:
            continue
        here = Diameter(
            term.target.diameter_mm,
            term.target.diameter_mm + float(found.state.vector(term.shape_block)[0]),
            float(covariance(found).sigma(term.shape_block)[0]),
        )
        if found.converged and here.contradicted:
            return here
    return None


def with_free_diameters(target: Targets, locations: Collection[str]) -> Targets | None:
    """The targets with nothing known of any ball's diameter; None where no location has a ball."""
    if not any(isinstance(target_at(target, name), Sphere) for name in locations):
        return None
    if isinstance(target, Mapping):
        new = {id(t): _freed(t) for t in target.values()}
        return {name: new[id(t)] for name, t in target.items()}
    return _freed(target)


def estimated_diameter(solution: Solution, stated: Targets) -> Diameter | None:
    """Of a solution with free diameters the first ball that is not as large as was stated."""
    for term in solution.bundle.terms:
        name = solution.bundle.unknowns.block(term.place_block).members[0]
        before = stated[name] if isinstance(stated, Mapping) else stated
        if not isinstance(term.target, Sphere) or not isinstance(before, Sphere) or not before.known:
            continue
        value = term.target.diameter_mm + float(solution.result.state.vector(term.shape_block)[0])
        here = Diameter(before.diameter_mm, value, float(solution.covariance.sigma(term.shape_block)[0]))
        if here.contradicted:
            return here
    return None


def _freed(target: Target) -> Target:
    return replace(target, diameter_sigma_mm=float("inf")) if isinstance(target, Sphere) else target
