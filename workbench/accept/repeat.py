"""Repeatability: one thing measured again and again, nothing moved; with Cg and Cgk against a master's value."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, t

from extraction import Circle, GapFlushConfig, Line, Profile, find_target_points, measure_gap_flush
from geometry import InputError, NoAnswerError, Remark, no_remark
from workbench.accept.figures import COVERAGE, Bounds, Figure, Limit, Rule
from workbench.accept.gauge_study import SHARE, STUDY
from workbench.accept.on_standard import told
from workbench.accept.record import Record, make_record
from workbench.accept.recorded import PlacedProfile, Progress, Recorded
from workbench.accept.variance import bounds
from workbench.files import read_table

Array = NDArray[np.float64]

STANDARD = "ISO 5725-2 (repeatability), AIAG MSA 4th ed. and ISO 22514-7 (Cg, Cgk of one master)"
FEWEST = 5  # measurements; fewer tell σ to a factor of more than three
_USUAL = 25  # what the books ask of one master
_LIMIT = 2.77  # 1.96 √2: two single measurements differ by less in 95 % of cases
_DRAWS, _SEED = 50_000, 20_102  # a limit of 2.5 % lies between 2.36 and 2.64 %
_DRIFT = 0.01  # p of a trend over the measurements' order, below which it is said
_WIDEST_HOLE = 3.0  # of the usual spacing: no value is taken from across a wider one
_MOST_LAGS = 200
FEATURES = ("plane", "sphere", "edge", "wedge", "gap")
FORM = "what drifts over days, temperature and mounting is not in a series of minutes: that is reproducibility"


@dataclass(frozen=True, eq=False)
class Series:
    """Values (N,) of one measurand in the order in which they were taken."""

    name: str
    unit: str
    values: Array


def read_series(path: Path, value: str = "value", remark: Remark = no_remark) -> Series:
    """The column of values of a table.

    Parameters
    ----------
    path
        A table with that column.
    value
        Its name.
    remark
        Told of columns that are ignored.

    Returns
    -------
    Series

    Raises
    ------
    InputError
        Naming line and column.

    """
    table = read_table(path, (value,), (value,), remark=remark)
    return Series(value, "mm", np.array([row.number(value) for row in table.rows]))


def series_of(
    recorded: Recorded,
    feature: str,
    diameter_mm: float | None = None,
    config: GapFlushConfig | None = None,
    progress: Progress | None = None,
) -> tuple[list[Series], list[str]]:
    """What a feature's measurands are in each profile, and a sentence for each profile that does not show it."""
    rows: list[dict[str, float]] = []
    lost: list[str] = []
    for placed in told(recorded.profiles, progress):
        try:
            rows.append(_measured(placed.profile, feature, diameter_mm, config))
        except NoAnswerError as error:
            lost.append(f"{placed.name}: {error}")
    if not rows:
        raise NoAnswerError(f"no profile shows the {feature}: {lost[0]}")
    names = rows[0]
    return [Series(n, "deg" if n.endswith("_deg") else "mm", np.array([row[n] for row in rows])) for n in names], lost


def _measured(
    profile: Profile, feature: str, diameter_mm: float | None, config: GapFlushConfig | None
) -> dict[str, float]:
    if feature == "gap":
        answer = measure_gap_flush(profile, config)
        return {"gap_mm": answer.gap_mm, "flush_mm": answer.flush_mm}
    found = find_target_points(profile, feature, (diameter_mm,))
    if found.reason is not None:
        raise NoAnswerError(found.text)
    curve = found.curves[0]
    if isinstance(curve, Circle):
        return {"centre_y_mm": curve.centre_mm[0], "centre_z_mm": curve.centre_mm[1], "radius_mm": curve.radius_mm}
    if feature == "edge":
        return {"edge_y_mm": float(found.yz_mm[0, 0]), "edge_z_mm": float(found.yz_mm[0, 1])}
    other = found.curves[-1]
    if feature == "wedge" and isinstance(other, Line):
        ridge = curve.meets(other)
        if ridge is None:
            raise NoAnswerError("the wedge's faces are parallel")
        return {"ridge_y_mm": float(ridge[0]), "ridge_z_mm": float(ridge[1])}
    middle = float(np.median(profile.yz_mm[:, 0]))
    slope = curve.direction[1] / curve.direction[0]
    height = curve.origin_mm[1] + slope * (middle - curve.origin_mm[0])
    return {"height_mm": float(height), "angle_deg": float(np.rad2deg(np.arctan(slope)))}


def accept_repeat(
    series: Sequence[Series],
    files: Sequence[Path],
    limits: Sequence[Limit] = (),
    rule: Rule = "conformity",
    *,
    of: str | None = None,
    reference: float | None = None,
    tolerance: float | None = None,
    profiles: Sequence[PlacedProfile] = (),
    notes: Sequence[str] = (),
    remarks: Sequence[str] = (),
) -> Record:
    """Standard deviation, repeatability limit, drift, and of one measurand Cg and Cgk.

    Parameters
    ----------
    series
        Measurands, each measured as often.
    files
        That they come from.
    limits, rule
        On sigma, sigma_z, Cg or Cgk, and what passes.
    of
        The measurand that limits, reference and tolerance speak of; None: the first.
    reference, tolerance
        The master's value and the full width of what is tolerated.
    profiles
        Whose scatter point by point is told as well (sigma_z).
    notes
        Of how the series were made.
    remarks
        The user's own words for the record.

    Returns
    -------
    Record

    Raises
    ------
    InputError
        For too few measurements, constants, or a measurand that is not there.

    """
    names = [s.name for s in series]
    if of is not None and of not in names:
        raise InputError(f'"{of}" is not among what is measured: {", ".join(names)}')
    chosen = series[names.index(of)] if of is not None else series[0]
    n = len(chosen.values)
    if n < FEWEST:
        raise InputError(f"{n} measurement{'s' * (n != 1)}: repeatability needs at least {FEWEST}, better {_USUAL}")
    if np.all(chosen.values == chosen.values[0]):
        raise InputError(
            f"all {n} values of {chosen.name} are {chosen.values[0]:g}: either they were copied, or the gauge's step "
            "is coarser than its repeatability"
        )
    rows = [_row(s) for s in series]
    sigma = float(np.std(chosen.values, ddof=1))
    figures = [
        Figure("sigma", sigma, chosen.unit, f"standard deviation of {chosen.name}", sigma_bounds(sigma, n - 1)),
        Figure("r", _LIMIT * sigma, chosen.unit, "repeatability limit: two measurements differ by less, 95 % of times",
               sigma_bounds(_LIMIT * sigma, n - 1)),
        *_capability(chosen, reference, tolerance),
    ]  # fmt: skip
    if profiles:
        figures.append(pointwise(profiles))
    said = [*notes, *(f"{r['measurand']} drifts over the series: p = {r['drift_p']:.2g}" for r in rows if _drifts(r))]
    if n < _USUAL:
        said.append(f"{n} measurements; the books ask for {_USUAL} to 50 of one master")
    return make_record(
        "repeat", f"repeatability of {chosen.name}, {n} measurements", STANDARD, figures, limits, rule, files,
        details={"of": chosen.name, "reference": reference, "tolerance": tolerance, "measurands": rows},
        not_judged=[FORM], notes=said, remarks=remarks,
    )  # fmt: skip


def sigma_bounds(sigma: float, dof: float) -> Bounds:
    """Limits of a standard deviation of normal values, by χ²."""
    tail = (1 - COVERAGE) / 2
    low, high, least, most = sigma * np.sqrt(dof / chi2.ppf([1 - tail, tail, COVERAGE, 1 - COVERAGE], dof))
    return Bounds(float(low), float(high), float(least), float(most))


def pointwise(profiles: Sequence[PlacedProfile]) -> Figure:
    """Pooled σ of z over the places that all profiles share; its interval counts neighbours as far as they agree."""
    words = "pooled standard deviation of z, place by place along the profile"
    heights = _on_common_grid([p.profile.yz_mm for p in profiles])
    if heights.shape[1] < FEWEST:
        return Figure("sigma_z", None, "mm", f"{words}: the profiles share no places")
    off = heights - heights.mean(axis=0)
    n, places = off.shape
    variance = float(np.sum(off**2)) / ((n - 1) * places)
    independent = places / _neighbours(off)
    return Figure(
        "sigma_z", float(np.sqrt(variance)), "mm", words, sigma_bounds(np.sqrt(variance), (n - 1) * independent)
    )


def _on_common_grid(profiles: Sequence[Array]) -> Array:
    """Heights (profiles, places) on a lateral grid, where every profile has points around the place."""
    ordered = [yz[np.argsort(yz[:, 0], kind="stable")] for yz in profiles]
    pitch = float(np.median(np.concatenate([np.diff(yz[:, 0]) for yz in ordered if len(yz) > 1])))
    low, high = max(yz[0, 0] for yz in ordered), min(yz[-1, 0] for yz in ordered)
    if not (pitch > 0 and high > low):
        return np.zeros((len(profiles), 0))
    grid = np.arange(low, high, pitch)
    out, whole = [], np.ones(len(grid), dtype=bool)
    for yz in ordered:
        k = np.clip(np.searchsorted(yz[:, 0], grid), 1, len(yz) - 1)
        whole &= yz[k, 0] - yz[k - 1, 0] <= _WIDEST_HOLE * pitch
        out.append(np.interp(grid, yz[:, 0], yz[:, 1]))
    return np.array(out)[:, whole]


def _neighbours(off: Array) -> float:
    """How many neighbouring places count as one: 1 + 2 Σ ρ_k, up to the first lag without correlation."""
    power = float(np.mean(off**2))
    total = 1.0
    for k in range(1, min(_MOST_LAGS, off.shape[1] // 4)):
        rho = float(np.mean(off[:, k:] * off[:, :-k])) / power if power > 0 else 0.0
        if rho <= 0:
            break
        total += 2 * rho**2  # of squares, whose sum the variance is
    return total


def _row(s: Series) -> dict[str, object]:
    n, sigma = len(s.values), float(np.std(s.values, ddof=1))
    b = sigma_bounds(sigma, n - 1) if sigma > 0 else Bounds(0, 0, 0, 0)
    order = np.arange(n) - (n - 1) / 2
    slope = float(order @ s.values / (order @ order))
    rest = s.values - s.values.mean() - slope * order
    error = float(np.sqrt(rest @ rest / max(n - 2, 1) / (order @ order)))
    p = 2 * float(t.sf(abs(slope) / error, n - 2)) if error > 0 else 1.0
    return {
        "measurand": s.name, "unit": s.unit, "n": n, "mean": float(s.values.mean()), "sigma": sigma,
        "sigma_low": b.low, "sigma_high": b.high, "range": float(np.ptp(s.values)),
        "drift_over_series": slope * (n - 1), "drift_p": p,
    }  # fmt: skip


def _drifts(row: dict[str, object]) -> bool:
    p = row["drift_p"]
    return isinstance(p, float) and p < _DRIFT


def _capability(s: Series, reference: float | None, tolerance: float | None) -> list[Figure]:
    words = "a fifth of the tolerance over six σ", "a tenth of the tolerance less the bias, over three σ"
    figures: list[Figure] = []
    n, sigma, mean = len(s.values), float(np.std(s.values, ddof=1)), float(s.values.mean())
    if reference is not None:
        half = t.ppf([(1 + COVERAGE) / 2, COVERAGE], n - 1) * sigma / np.sqrt(n)
        bias = mean - reference
        b = Bounds(bias - half[0], bias + half[0], bias - half[1], bias + half[1])
        figures.append(Figure("bias", bias, s.unit, f"mean of {s.name} less the master's value", b, signed=True))
    if tolerance is None:
        none = (Figure(k, None, "", f"{w}: no tolerance was given") for k, w in zip(("Cg", "Cgk"), words, strict=True))
        return [*figures, *none]
    share, b = SHARE * tolerance / STUDY, sigma_bounds(sigma, n - 1)
    of_share = Bounds(share / b.high, share / b.low, share / b.most, share / b.least)
    figures.append(Figure("Cg", share / sigma, "", words[0], of_share))
    if reference is None:
        return [*figures, Figure("Cgk", None, "", f"{words[1]}: no reference value was given")]
    rng = np.random.default_rng(_SEED)
    drawn = sigma * np.sqrt((n - 1) / rng.chisquare(n - 1, _DRAWS))
    biases = np.abs(mean - reference - drawn / np.sqrt(n) * rng.standard_normal(_DRAWS))
    cgk = (SHARE / 2 * tolerance - biases) / (STUDY / 2 * drawn)
    value = (SHARE / 2 * tolerance - abs(mean - reference)) / (STUDY / 2 * sigma)
    return [*figures, Figure("Cgk", value, "", words[1], bounds(cgk))]
