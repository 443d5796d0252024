"""From factors to design points: grid, random, Latin hypercube, Sobol."""

from __future__ import annotations

import itertools
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.campaign.asked.plan import MAX_TRIALS, Plan, Range
from workbench.campaign.asked.settings import TrialSettings, is_whole

Point = dict[str, Any]


def design_points(plan: Plan) -> list[Point]:
    """Every design point as factor → value, in the order of their trials; the same for the same plan."""
    if plan.design == "grid":
        columns = [_grid_values(name, factor) for name, factor in plan.factors.items()]
        size = int(np.prod([len(c) for c in columns], dtype=float))
        _check_size(size * plan.repeats)
        return [dict(zip(plan.factors, values, strict=True)) for values in itertools.product(*columns)]
    samples = plan.samples or 0
    _check_size(samples * plan.repeats)
    unit = _unit_cube(plan, samples)
    return [{name: _at(name, f, u) for (name, f), u in zip(plan.factors.items(), row, strict=True)} for row in unit]


def _check_size(trials: int) -> None:
    if trials > MAX_TRIALS:
        raise InputError(f"the plan has {trials} trials, more than {MAX_TRIALS}: take fewer values or a random design")


def _unit_cube(plan: Plan, samples: int) -> NDArray[np.float64]:
    """Points (samples, factors) of the unit cube."""
    rng = np.random.default_rng(np.random.SeedSequence(plan.seed, spawn_key=(0,)))
    dimensions = len(plan.factors)
    if dimensions == 0:
        return np.zeros((samples, 0))
    if plan.design == "random":
        return rng.random((samples, dimensions))
    from scipy.stats import qmc  # half a second, and workers need none of it

    if plan.design == "latin_hypercube":
        return np.asarray(qmc.LatinHypercube(dimensions, rng=rng).random(samples))
    power = int(np.ceil(np.log2(max(samples, 1))))  # Sobol points are balanced in powers of two only
    return np.asarray(qmc.Sobol(dimensions, rng=rng).random_base2(power))[:samples]


def _grid_values(name: str, factor: list[Any] | Range) -> list[Any]:
    if isinstance(factor, Range):
        return [_at(name, factor, u) for u in np.linspace(0.0, 1.0, factor.steps or 2)]
    return list(factor)


def _at(name: str, factor: list[Any] | Range, u: float) -> Any:
    """The factor's value at ``u`` in [0, 1]."""
    if not isinstance(factor, Range):
        return factor[min(int(u * len(factor)), len(factor) - 1)]
    value = factor.low * (factor.high / factor.low) ** u if factor.log else factor.low + u * (factor.high - factor.low)
    return round(value) if is_whole(TrialSettings, name) else float(value)
