"""The sentence a user came for: the fewest poses, with which tilts, that reach an accuracy."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any

import numpy as np

from workbench.campaign.results.summary import Array, AskedAccuracy, Mask, Run, groups_of, proportion_band

FEWEST = 20  # trials of one setting below which its share says nothing
FEW_VALUES = 4  # other factors with at most so many values may be part of the advice
POSES, TILT = ("poses.locations", "poses.per_location"), "poses.tilt_max_deg"


@dataclass(frozen=True)
class PoseBudget:
    """Trials of one number of poses and largest tilt. hits: those that reached the target; given: the other factors
    that were fixed, as ``name = value``.
    """

    poses: float
    tilt_deg: float
    trials: int
    hits: int
    given: tuple[str, ...] = ()

    @property
    def share(self) -> float:
        """Part of the trials that reached the target; one without an answer did not."""
        return self.hits / self.trials

    @property
    def band(self) -> tuple[float, float]:
        """95 % interval of the share."""
        return proportion_band(self.hits, self.trials)


def reached(run: Run, target: AskedAccuracy) -> Mask:
    """Trials whose answer may be used and lies within the target."""
    return run.answered & (run.real("error_mm") <= target.mm) & (run.real("error_deg") <= target.deg)


def cells(run: Run, target: AskedAccuracy, among: Mask | None = None, given: tuple[str, ...] = ()) -> list[PoseBudget]:
    """All settings of poses and tilt in the run, fewest poses first."""
    good = reached(run, target)
    inside = np.ones(run.size, bool) if among is None else among
    poses = _grouped(_setting(run, POSES[0]) * _setting(run, POSES[1]))
    tilt = _grouped(_setting(run, TILT))
    out = []
    for n, degrees in sorted(set(zip(poses[inside], tilt[inside], strict=True))):
        here = inside & (poses == n) & (tilt == degrees)
        out.append(PoseBudget(float(n), float(degrees), int(here.sum()), int(good[here].sum()), given))
    return out


def advice(run: Run, target: AskedAccuracy) -> str:
    """What to do for the target, or that nothing in this plan is enough."""
    wanted = f"{target.mm:g} mm / {target.deg:g}° at {100 * target.level:g} %"
    everything = cells(run, target)
    for fixed in range(3):
        tried = everything if fixed == 0 else list(_given(run, target, fixed))
        enough = [c for c in tried if c.share >= target.level and c.trials >= FEWEST]
        if enough:
            best = min(enough, key=lambda c: (c.poses, c.tilt_deg, -c.share))
            return f"For {wanted} take {_words(best)}: {_share(best)}{_doubt(best, target)}"
    if max(c.trials for c in everything) < FEWEST:
        return f"Too few trials to say what reaches {wanted}: no setting of poses and tilt has {FEWEST} of them."
    best = max((c for c in (*everything, *_given(run, target, 1)) if c.trials >= FEWEST), key=lambda c: c.share)
    reach = [float(np.nanquantile(np.where(run.answered, run.real(e), np.nan), target.level)) for e in _errors(run)]
    return (
        f"No setting of this plan reaches {wanted}. The nearest, {_words(best)}, does so in {100 * best.share:.1f} % "
        f"of its {best.trials} trials; over all trials with an answer the {100 * target.level:g} % errors are "
        f"{reach[0]:.3f} mm and {reach[1]:.3f}°."
    )


def _errors(run: Run) -> tuple[str, ...]:
    return ("error_mm", "error_deg") if np.any(run.answered) else ("trial", "trial")


def _words(cell: PoseBudget) -> str:
    others = "".join(f", {text}" for text in cell.given)
    return f"≥ {cell.poses:.0f} poses with tilts up to ≥ {cell.tilt_deg:.0f}°{others}"


def _share(cell: PoseBudget) -> str:
    low, high = (100 * b for b in cell.band)
    over = "the other factors" if cell.given else "all other factors"
    return (
        f"{100 * cell.share:.1f} % of {cell.trials} trials reached it (95 % interval {low:.1f} … {high:.1f} %), over "
        f"{over} of this plan."
    )


def _doubt(cell: PoseBudget, target: AskedAccuracy) -> str:
    sure = cell.band[0] >= target.level
    return "" if sure else f" More trials would be needed to be sure of {100 * target.level:g} %."


def _given(run: Run, target: AskedAccuracy, count: int) -> Iterator[PoseBudget]:
    """Settings of poses and tilt where ``count`` other factors hold one of their values."""
    others: dict[str, Any] = {}
    for name in run.plan.factors:
        values = groups_of(run, name)
        if name not in (*POSES, TILT) and 2 <= len(values) <= FEW_VALUES:
            others[name] = values
    for names in combinations(others, count):
        for chosen in product(*(others[name] for name in names)):
            among = np.logical_and.reduce([mask for _, _, mask in chosen])
            yield from cells(run, target, among, tuple(f"{n} = {v[0]}" for n, v in zip(names, chosen, strict=True)))


def _setting(run: Run, name: str) -> Array:
    """A setting of every trial: the factor's column, or the plan's one value."""
    if name in run.plan.factors:
        return run.real(name)
    here: Any = run.plan.base
    for part in name.split("."):
        here = getattr(here, part)
    return np.full(run.size, float(here))


def _grouped(values: Array) -> Array:
    """Values as they are, or upward to fives where there are many, so that sampled settings fall into groups."""
    return np.ceil(values / 5 - 1e-9) * 5 if len(np.unique(values)) > 16 else values
