"""What a run says: errors against every factor, whether the reported σ are true, verdicts, advice in one sentence."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
from numpy.typing import NDArray

from calib.result import TRUSTWORTHY
from geometry import InputError
from workbench.campaign.asked.plan import Plan
from workbench.campaign.store.manifest import plan_of_run
from workbench.campaign.store.merge import DAMAGED

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BINS = 8  # groups of a factor that was sampled, each with as many trials
LEVEL = 0.95  # confidence of every band of the page


@dataclass(frozen=True)
class AskedAccuracy:
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

    @property
    def answered(self) -> Mask:
        """Trials with an answer that may be used: in a calibration one of which the verdict says so."""
        if self.plan.run != "calibrate":
            return np.array([v != "no_answer" for v in self.trials["verdict"]])
        return np.array([v in TRUSTWORTHY for v in self.trials["verdict"]]) & np.isfinite(self.real("error_mm"))


@dataclass(frozen=True, eq=False)
class Group:
    """Trials that share a factor's value: quantiles of an error with their 95 % confidence bands (low, high).

    A band is open (0 or infinite) where the trials are too few to bound it. answered: how many trials gave an answer
    that may be used; quantiles are theirs. The counts speak of all.
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
    plan, path = plan_of_run(folder), folder / "trials.parquet"
    if not path.exists():
        raise InputError(f"{folder}: the run is not finished, run the same `perceptron-emu sweep` command again")
    try:
        table = pq.read_table(path, page_checksum_verification=True)
    except DAMAGED as error:
        raise InputError(
            f"{path}: can not be read ({error}); `perceptron-emu sweep` makes it again of the shards"
        ) from None
    return Run(folder, plan, table.to_pydict())


def groups_of(run: Run, factor: str) -> list[tuple[str, float | None, Mask]]:
    """The trials of one factor in ascending order of its value: (text, number or None, which trials).

    A factor sampled at many values is cut into BINS groups of equal counts.
    """
    values = run.trials[factor]
    distinct = sorted({v for v in values if v is not None})
    if len(distinct) <= 2 * BINS:
        column = np.array([distinct.index(v) for v in values])
        return [(_text(v), _number(v), column == i) for i, v in enumerate(distinct)]
    x = run.real(factor)
    edges = np.quantile(x, np.linspace(0, 1, BINS + 1))
    place = np.clip(np.searchsorted(edges, x, side="right") - 1, 0, BINS - 1)
    return [
        (f"{edges[i]:.3g} … {edges[i + 1]:.3g}", float(np.median(x[place == i])), place == i)
        for i in range(BINS)
        if np.any(place == i)
    ]


def by_factor(run: Run, factor: str, error: str) -> list[Group]:
    """Groups of one factor with the quantiles of one error."""
    errors = np.where(run.answered, run.real(error), np.nan)
    return [_group(text, number, errors[mask]) for text, number, mask in groups_of(run, factor)]


def consistency(run: Run) -> Consistency | None:
    """NEES and coverage over the trials with an answer; None where there are none."""
    nees = run.real("nees")
    nees = nees[np.isfinite(nees) & run.answered]
    n = len(nees)
    if n == 0:
        return None
    from scipy.stats import chi2  # half a second, and workers need none of it

    inside = int(np.sum(nees <= chi2.ppf(LEVEL, 6)))
    bounds = (float(chi2.ppf(0.025, 6 * n) / n), float(chi2.ppf(0.975, 6 * n) / n))
    return Consistency(n, float(nees.mean()), bounds, inside / n, proportion_band(inside, n))


def verdicts(run: Run) -> list[tuple[str, int]]:
    """How often each verdict was given, most frequent first."""
    return Counter(str(v) for v in run.trials["verdict"]).most_common()


def worst_trials(run: Run, count: int) -> list[int]:
    """Trials that went worst: the largest error of what the run measures, before them those that missed most spots."""
    error = run.real({"calibrate": "error_mm", "pose": "pose_rms_mm"}.get(run.plan.run, "point_rms_z_mm"))
    lost = np.zeros(run.size)
    if run.plan.run != "calibrate":
        lost = np.nan_to_num(run.real("spots_visible") - run.real("spots_found"), nan=-1.0)
    return [int(i) for i in np.lexsort((np.arange(run.size), -np.nan_to_num(error, nan=-1.0), -lost))[:count]]


def worst_frame(run: Run, trial: int) -> int:
    """The frame of a trial that shows best what went wrong: spots missed or taken wrongly, then the largest error."""
    table = pq.read_table(run.folder / "frames.parquet", filters=[("trial", "=", trial)]).to_pylist()

    def badness(row: dict[str, Any]) -> tuple[float, float]:
        lost = row["visible"] - row["found"] + row["mislabelled"] + row["false_points"]
        return lost, row["rms_z_mm"] or 0.0

    return int(max(table, key=badness)["frame"]) if table else 0


def proportion_band(hits: int, n: int) -> tuple[float, float]:
    """95 % confidence interval of a proportion (Clopper & Pearson 1934)."""
    from scipy.stats import beta  # half a second, and workers need none of it

    low = float(beta.ppf(0.025, hits, n - hits + 1)) if hits else 0.0
    high = float(beta.ppf(0.975, hits + 1, n - hits)) if hits < n else 1.0
    return low, high


def quantile_band(ordered: Array, q: float) -> tuple[float, tuple[float, float]]:
    """A quantile of ascending values and its 95 % band, free of any distribution (order statistics, binomial ranks).

    An end of the band is 0 or infinite where the values are too few: an upper bound of the 95 % error needs 72.
    """
    n = len(ordered)
    if n == 0:
        return float("nan"), (float("nan"), float("nan"))
    from scipy.stats import binom  # half a second, and workers need none of it

    low, high = int(binom.ppf(0.025, n, q)) - 1, int(binom.ppf(0.975, n, q))
    band = (float(ordered[low]) if low >= 0 else 0.0, float(ordered[high]) if high < n else float("inf"))
    return float(np.quantile(ordered, q, method="inverted_cdf")), band


def _group(value: str, centre: float | None, errors: Array) -> Group:
    known = np.sort(errors[np.isfinite(errors)])
    median, p95 = (quantile_band(known, q) for q in (0.5, LEVEL))
    return Group(value, centre, len(errors), len(known), *median, *p95)


def _number(value: object) -> float | None:
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def _text(value: object) -> str:
    return f"{value:g}" if isinstance(value, float) else str(value)
