"""A gauge study: EV, AV, GRR, PV, %GRR, ndc, Cg and Cgk from parts × operators × trials, each with its interval."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench.accept.figures import Figure
from workbench.accept.gauge_table import GaugeTable
from workbench.accept.variance import (
    DRAWS,
    INTERACTION,
    OPERATOR,
    PART,
    POOL_ABOVE,
    TRIAL,
    Components,
    bounds,
    components,
)

Array = NDArray[np.float64]

NDC = 1.41  # √2 as AIAG rounds it: categories of a width of 1.41 GRR
STUDY = 6.0  # σ that a spread is taken for: 99.73 %; older books have 5.15, 99 %
SHARE = 0.2  # of the tolerance that six σ of repeated measurements of one master are held against (Cg)
_SEED_BIAS = 20_101


@dataclass(frozen=True, eq=False)
class GaugeStudy:
    """The figures of a gauge by name, the components that they come from, remarks."""

    table: GaugeTable
    components: Components
    figures: tuple[Figure, ...]
    notes: tuple[str, ...]


def study_gauge(
    table: GaugeTable,
    tolerance_mm: float | None = None,
    pool_above: float = POOL_ABOVE,
    draws: int = DRAWS,
) -> GaugeStudy:
    """EV, AV, INT, GRR, PV, TV, their shares, ndc, Cg and Cgk of a study.

    Parameters
    ----------
    table
        Of parts × operators × trials.
    tolerance_mm
        Full width of what is tolerated; without it there are no shares of it, no Cg and no Cgk.
    pool_above
        The interaction is pooled where its p-value is above.
    draws
        Of the intervals.

    Returns
    -------
    GaugeStudy
        Figures that the study can not tell are None and say why.

    """
    found = components(table.values, pool_above, draws)
    figures = [
        _spread("EV", found, "equipment variation: repeatability, σ of trials", TRIAL),
        _spread("AV", found, "appraiser variation: reproducibility, σ among operators", OPERATOR),
        _spread("INT", found, "σ of the interaction of parts and operators", INTERACTION),
        _spread("GRR", found, "gauge repeatability and reproducibility, σ of a measurement", *_GAUGE),
        _spread("PV", found, "part variation, σ among parts", PART),
        _figure("TV", found, "mm", "total variation, σ", lambda v: np.sqrt(_total(v))),
        *(_share(f"percent_{name}", found, names) for name, names in _SHARES.items()),
        _figure("ndc", found, "", "number of distinct categories, 1.41 PV / GRR, whole ones", _ndc),
    ]
    figures += [_of_tolerance(name, found, names, tolerance_mm) for name, names in _SHARES.items() if name != "PV"]
    figures += _capability(table, found, tolerance_mm, draws)
    return GaugeStudy(table, found, tuple(figures), _notes(table, found))


_GAUGE = (TRIAL, OPERATOR, INTERACTION)
_SHARES: dict[str, tuple[str, ...]] = {
    "EV": (TRIAL,), "AV": (OPERATOR,), "INT": (INTERACTION,), "GRR": _GAUGE, "PV": (PART,),
}  # fmt: skip
_Variances = dict[str, float] | dict[str, Array]


def _sum(v: _Variances, names: tuple[str, ...]) -> Array:
    """The variance of sources together, not below zero."""
    total = sum((np.asarray(v[name], dtype=float) for name in names if name in v), start=np.zeros(()))
    return np.asarray(np.maximum(total, 0.0))


def _total(v: _Variances) -> Array:
    return _sum(v, _GAUGE) + _sum(v, (PART,))


def _figure(name: str, found: Components, unit: str, words: str, function: Callable[[_Variances], Array]) -> Figure:
    with np.errstate(divide="ignore", invalid="ignore"):
        value, drawn = float(function(found.variance)), function(found.drawn)
    return Figure(name, value if np.isfinite(value) else None, unit, words, bounds(drawn))


def _spread(name: str, found: Components, words: str, *sources: str) -> Figure:
    if not any(s in found.variance for s in sources):
        why = "pooled with the trials" if found.pooled and sources == (INTERACTION,) else "the study has no operators"
        return Figure(name, None, "mm", f"{words}: {why}")
    return _figure(name, found, "mm", words, lambda v: np.sqrt(_sum(v, sources)))


def _share(name: str, found: Components, sources: tuple[str, ...]) -> Figure:
    words = f"{name.removeprefix('percent_')} of the total variation"
    if not any(s in found.variance for s in sources):
        return Figure(name, None, "%", words)
    return _figure(name, found, "%", words, lambda v: 100 * np.sqrt(_sum(v, sources) / _total(v)))


def _of_tolerance(name: str, found: Components, sources: tuple[str, ...], tolerance: float | None) -> Figure:
    key, words = f"percent_{name}_tolerance", f"six {name} of the tolerance"
    if tolerance is None or not any(s in found.variance for s in sources):
        return Figure(key, None, "%", words + (": no tolerance was given" if tolerance is None else ""))
    return _figure(key, found, "%", words, lambda v: 100 * STUDY * np.sqrt(_sum(v, sources)) / tolerance)


def _ndc(v: _Variances) -> Array:
    gauge = np.maximum(_sum(v, _GAUGE), np.finfo(float).tiny)
    return np.floor(NDC * np.sqrt(_sum(v, (PART,)) / gauge))


def _capability(table: GaugeTable, found: Components, tolerance: float | None, draws: int) -> list[Figure]:
    """Cg by the repeatability, Cgk with the largest bias of a part whose own value is known.

    The bias' pivotal quantity is that of a mean of the part's measurements with the gauge's whole spread.
    """
    words = "0.2 of the tolerance over six EV", "a tenth of the tolerance less the largest bias, over three EV"
    if tolerance is None:
        return [
            Figure(name, None, "", f"{w}: no tolerance was given") for name, w in zip(("Cg", "Cgk"), words, strict=True)
        ]
    cg = _figure("Cg", found, "", words[0], lambda v: SHARE * tolerance / (STUDY * np.sqrt(_sum(v, (TRIAL,)))))
    known = np.flatnonzero(np.isfinite(table.reference))
    if len(known) == 0:
        return [cg, Figure("Cgk", None, "", f"{words[1]}: the table has no column reference")]
    bias = table.values.mean(axis=(1, 2))[known] - table.reference[known]
    _, o, r = table.values.shape
    error = _sum(found.drawn, (TRIAL,)) / (o * r)
    for name, n in ((OPERATOR, o), (INTERACTION, o)):
        if name in found.drawn:
            error = error + np.asarray(found.drawn[name]) / n
    error = np.maximum(error, 0.0)
    rng = np.random.default_rng(_SEED_BIAS)
    most = np.zeros(draws)
    for b in bias:
        most = np.maximum(most, np.abs(b - np.sqrt(error) * rng.standard_normal(draws)))
    half = SHARE / 2 * tolerance
    value = (half - float(np.max(np.abs(bias)))) / (STUDY / 2 * np.sqrt(found.variance[TRIAL]))
    return [
        cg,
        Figure("Cgk", float(value), "", words[1], bounds((half - most) / (STUDY / 2 * np.sqrt(found.drawn[TRIAL])))),
    ]


def _notes(table: GaugeTable, found: Components) -> tuple[str, ...]:
    notes = []
    if not table.operators:
        notes.append("no column operator: a study without operators; AV is not told and GRR is EV alone")
    if found.pooled:
        notes.append(f"the interaction is pooled with the trials: p = {found.interaction_p:.3g}")
    notes += [
        f"the variance of {name} came out below zero and is taken as zero: it can not be told from the trials"
        for name in found.negative
    ]
    if len(table.operators) in (2, 3):
        notes.append(f"{len(table.operators)} operators tell AV to a factor only: see its interval, and GRR's")
    step = _step(table.values)
    ev = float(np.sqrt(found.variance[TRIAL]))
    if step > ev:
        notes.append(
            f"the values go in steps of {step:.3g} mm, more than EV: the gauge's display is part of its spread"
        )
    return tuple(notes)


def _step(values: Array) -> float:
    """The smallest difference between values that differ by more than rounding."""
    steps = np.diff(np.unique(values))
    steps = steps[steps > 1e-9 * max(float(np.max(np.abs(values))), 1e-300)]
    return float(steps.min()) if len(steps) else 0.0
