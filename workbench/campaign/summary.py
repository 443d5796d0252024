"""What a run says: errors against every factor, whether the reported σ are true, verdicts, advice in one sentence."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray
from scipy.stats import beta, chi2

from geometry import InputError
from workbench.campaign.plan import Plan, plan_of
from workbench.campaign.store import read_manifest

Array = NDArray[np.float64]

BINS = 8  # groups of a factor that was sampled, each with as many trials
LEVEL = 0.95


@dataclass(frozen=True)
class Target:
    """The accuracy asked for: translation [mm] and rotation [deg] errors at ``level`` of the trials."""

    mm: float = 0.1
    deg: float = 0.03
    level: float = LEVEL


@dataclass(frozen=True, eq=False)
class Run:
    """A run's tables as columns, with its plan."""

    folder: Path
    plan: Plan
    trials: dict[str, list[Any]]

    def real(self, name: str) -> Array:
        """A column as floats, NaN where a trial has no value."""
        return np.array([np.nan if v is None else float(v) for v in self.trials[name]])

    @property
    def size(self) -> int:
        """The number of trials."""
        return len(self.trials["trial"])


@dataclass(frozen=True, eq=False)
class Group:
    """Trials that share a factor's value: quantiles of an error with their 95 % confidence bands (low, high).

    answered: how many trials gave an answer at all.
    """

    value: str
    centre: float | None
    trials: int
    answered: int
    median: float
    median_band: tuple[float, float]
    p95: float
    p95_band: tuple[float, float]


@dataclass(frozen=True)
class Consistency:
    """Whether the reported σ are true: mean NEES (6 when so) and coverage of the 95 % ellipsoid, with bounds."""

    trials: int
    nees: float
    nees_bounds: tuple[float, float]
    coverage: float
    coverage_bounds: tuple[float, float]


def read_run(folder: Path) -> Run:
    """The tables of a finished run; InputError where the run is not finished or not a run."""
    record = read_manifest(folder)
    path = folder / "trials.parquet"
    if not path.exists():
        raise InputError(f"{folder}: the run is not finished, run the same `perceptron-emu sweep` command again")
    plan = record["plan"]
    if not isinstance(plan, dict):
        raise InputError(f"{folder / 'run.json'}: its plan is not a table")
    return Run(folder, plan_of(plan), pq.read_table(path).to_pydict())


def by_factor(run: Run, factor: str, error: str) -> list[Group]:
    """Groups of one factor in ascending order: its values, or BINS of equal counts where it was sampled."""
    values = run.trials[factor]
    distinct = sorted({v for v in values if v is not None})
    errors = run.real(error)
    if len(distinct) <= 2 * BINS:
        column = np.array([distinct.index(v) for v in values])
        numbers = [float(v) if not isinstance(v, str) else None for v in distinct]
        return [_group(_text(v), numbers[i], errors[column == i]) for i, v in enumerate(distinct)]
    x = run.real(factor)
    edges = np.quantile(x, np.linspace(0, 1, BINS + 1))
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, BINS - 1)
    return [
        _group(f"{edges[i]:.3g} … {edges[i + 1]:.3g}", float(np.median(x[place == i])), errors[place == i])
        for i in range(BINS)
        if np.any(place == i)
    ]


def consistency(run: Run) -> Consistency | None:
    """NEES and coverage over the trials with an answer; None where there are none."""
    nees = run.real("nees")
    nees = nees[np.isfinite(nees)]
    n = len(nees)
    if n == 0:
        return None
    inside = int(np.sum(nees <= chi2.ppf(LEVEL, 6)))
    bounds = (float(chi2.ppf(0.025, 6 * n) / n), float(chi2.ppf(0.975, 6 * n) / n))
    return Consistency(n, float(nees.mean()), bounds, inside / n, proportion_band(inside, n))


def verdicts(run: Run) -> list[tuple[str, int]]:
    """How often each verdict was given, most frequent first."""
    return Counter(str(v) for v in run.trials["verdict"]).most_common()


def worst_trials(run: Run, count: int) -> list[int]:
    """Trials with the largest translation error, those without an answer after them."""
    error = np.nan_to_num(run.real("error_mm"), nan=-1.0)
    return [int(i) for i in np.argsort(-error, kind="stable")[:count]]


def advice(run: Run, target: Target) -> str:
    """The sentence a user came for: the fewest poses, with which tilts, that reach the target."""
    poses = _setting(run, "poses.locations") * _setting(run, "poses.per_location")
    tilt = _setting(run, "poses.tilt_max_deg")
    good = (run.real("error_mm") <= target.mm) & (run.real("error_deg") <= target.deg)
    wanted = f"{target.mm:g} mm / {target.deg:g}° at {100 * target.level:g} %"
    cells = sorted(set(zip(_rounded(poses), _rounded(tilt), strict=True)))
    shares = {c: good[(_rounded(poses) == c[0]) & (_rounded(tilt) == c[1])] for c in cells}
    reached = [c for c, g in shares.items() if g.mean() >= target.level]
    if reached:
        n, degrees = min(reached)
        share, size = shares[n, degrees].mean(), len(shares[n, degrees])
        return (
            f"For {wanted} take ≥ {n:.0f} poses with tilts up to ≥ {degrees:.0f}°: {100 * share:.1f} % of {size} "
            f"trials reached it (over all other factors of this plan)."
        )
    best = max(cells, key=lambda c: shares[c].mean())
    reach_mm = float(np.nanquantile(run.real("error_mm"), target.level))
    reach_deg = float(np.nanquantile(run.real("error_deg"), target.level))
    return (
        f"No setting of this plan reaches {wanted}: the best, {best[0]:.0f} poses with tilts up to {best[1]:.0f}°, "
        f"does so in {100 * shares[best].mean():.1f} % of its trials; over all trials the {100 * target.level:g} % "
        f"errors are {reach_mm:.3f} mm and {reach_deg:.3f}°."
    )


def proportion_band(hits: int, n: int) -> tuple[float, float]:
    """95 % confidence interval of a proportion (Clopper & Pearson 1934)."""
    low = float(beta.ppf(0.025, hits, n - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, n - hits)) if hits < n else 1.0
    return low, high


def _group(value: str, centre: float | None, errors: Array) -> Group:
    known = np.sort(errors[np.isfinite(errors)])
    median, p95 = (_quantile(known, q) for q in (0.5, LEVEL))
    return Group(value, centre, len(errors), len(known), *median, *p95)


def _quantile(ordered: Array, q: float) -> tuple[float, tuple[float, float]]:
    """A quantile and its 95 % band from the order statistics, free of any distribution (binomial ranks)."""
    n = len(ordered)
    if n == 0:
        return float("nan"), (float("nan"), float("nan"))
    spread = 1.96 * np.sqrt(n * q * (1 - q))
    low, high = (int(np.clip(round(n * q + s), 0, n - 1)) for s in (-spread, spread))
    return float(np.quantile(ordered, q, method="inverted_cdf")), (float(ordered[low]), float(ordered[high]))


def _setting(run: Run, name: str) -> Array:
    """A setting of every trial: the factor's column, or the plan's one value."""
    if name in run.plan.factors:
        return run.real(name)
    here: Any = run.plan.base
    for part in name.split("."):
        here = getattr(here, part)
    return np.full(run.size, float(here))


def _rounded(values: Array) -> Array:
    """Values on whole numbers, upward, so that sampled settings fall into groups."""
    return np.ceil(values / 5 - 1e-9) * 5 if len(np.unique(values)) > 2 * BINS else values


def _text(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
