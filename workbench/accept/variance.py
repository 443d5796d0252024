"""Variance components of a gauge by analysis of variance, with generalised confidence intervals.

Measurements of p parts by o operators, r trials each, are taken as y_ijk = μ + P_i + O_j + (PO)_ij + E_ijk with normal,
independent effects. The mean squares S² of parts, operators, interaction and trials have the expectations

    E[S²_P]  = σ²_E + r σ²_PO + o r σ²_P      n = p − 1
    E[S²_O]  = σ²_E + r σ²_PO + p r σ²_O      n = o − 1
    E[S²_PO] = σ²_E + r σ²_PO                 n = (p − 1)(o − 1)
    E[S²_E]  = σ²_E                           n = p o (r − 1)

and n S² / E[S²] is χ² of n degrees of freedom, independently. Every component is a linear combination of expectations,
so its generalised pivotal quantity is that combination of n S² / χ²_n with χ² drawn anew; quantiles of it are limits of
confidence, and so are those of sums of components and of any function of them, none below zero.

References: AIAG, Measurement Systems Analysis, 4th ed. 2010; M. Hamada and S. Weerahandi, J. Quality Technology 32
(2000) 241; R. K. Burdick, C. M. Borror, D. C. Montgomery, Design and Analysis of Gauge R&R Studies, SIAM 2005.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as f_distribution

from workbench.accept.figures import COVERAGE, Bounds

Array = NDArray[np.float64]

POOL_ABOVE = 0.25  # p of the interaction: at 0.05 a real one is pooled too often, and GRR comes out too small (Burdick)
DRAWS = 100_000  # a limit of 2.5 % lies between 2.4 and 2.6 %
SEED = 20_100  # of the draws: the same table gives the same limits
PART, OPERATOR, INTERACTION, TRIAL = "part", "operator", "part × operator", "trial"


@dataclass(frozen=True)
class VarianceRow:
    """A row of the table of variance; f and p are None where nothing is tested."""

    name: str
    dof: int
    sum_of_squares: float
    mean_square: float
    f: float | None = None
    p: float | None = None


@dataclass(frozen=True, eq=False)
class Components:
    """Variances by source, estimated (not below zero) and drawn (K,) (as they come), and where they come from.

    table: with the interaction, where there are operators; ``used``: what the components come from, after pooling.
    negative: sources whose estimate came out below zero, and is zero.
    """

    table: tuple[VarianceRow, ...]
    used: tuple[VarianceRow, ...]
    pooled: bool
    interaction_p: float | None
    variance: dict[str, float]
    drawn: dict[str, Array]
    negative: tuple[str, ...]


def components(values: Array, pool_above: float = POOL_ABOVE, draws: int = DRAWS) -> Components:
    """Variance components of a balanced study.

    Parameters
    ----------
    values : ndarray (parts, operators, trials)
        One operator stands for a study without: parts and trials alone are told apart then.
    pool_above
        The interaction is pooled with the trials where its p-value is above; 1: never, 0: always.
    draws
        Of the confidence limits.

    Returns
    -------
    Components

    """
    p, o, r = values.shape
    table = _one_way(values) if o == 1 else _two_way(values)
    interaction = next((s for s in table if s.name == INTERACTION), None)
    pooled = interaction is not None and interaction.p is not None and interaction.p > pool_above
    used = _pooled(table) if pooled else table
    rows = _combinations(used, p, o, r)
    squares = np.array([s.mean_square for s in used])
    rng = np.random.default_rng(SEED)
    pivots = np.stack([s.dof * s.mean_square / rng.chisquare(s.dof, draws) for s in used])
    plain = {name: float(row @ squares) for name, row in rows.items()}
    return Components(
        table=table,
        used=used,
        pooled=pooled,
        interaction_p=None if interaction is None else interaction.p,
        variance={name: max(v, 0.0) for name, v in plain.items()},
        drawn={name: row @ pivots for name, row in rows.items()},
        negative=tuple(name for name, v in plain.items() if v < 0),
    )


def bounds(drawn: Array) -> Bounds:
    """Limits of confidence of a figure from its draws."""
    tail = (1 - COVERAGE) / 2
    low, high, least, most = np.quantile(drawn, [tail, 1 - tail, 1 - COVERAGE, COVERAGE])
    return Bounds(float(low), float(high), float(least), float(most))


def _one_way(values: Array) -> tuple[VarianceRow, ...]:
    p, _, r = values.shape
    flat = values[:, 0]
    part = r * float(np.sum((flat.mean(axis=1) - flat.mean()) ** 2))
    trial = float(np.sum((flat - flat.mean(axis=1, keepdims=True)) ** 2))
    return _tested({PART: (p - 1, part), TRIAL: (p * (r - 1), trial)}, TRIAL)


def _two_way(values: Array) -> tuple[VarianceRow, ...]:
    p, o, r = values.shape
    values = values - values.mean()  # a large value common to all must not eat the digits
    cell, part, operator = values.mean(axis=2), values.mean(axis=(1, 2)), values.mean(axis=(0, 2))
    sums = {
        PART: (p - 1, o * r * float(np.sum(part**2))),
        OPERATOR: (o - 1, p * r * float(np.sum(operator**2))),
        INTERACTION: ((p - 1) * (o - 1), r * float(np.sum((cell - part[:, None] - operator) ** 2))),
        TRIAL: (p * o * (r - 1), float(np.sum((values - cell[:, :, None]) ** 2))),
    }
    return _tested(sums, INTERACTION)


def _tested(sums: dict[str, tuple[int, float]], against: str) -> tuple[VarianceRow, ...]:
    """Rows with F and p: main effects against ``against``, the interaction against the trials."""
    square = {name: total / dof for name, (dof, total) in sums.items()}
    out = []
    for name, (dof, total) in sums.items():
        below = None if name == TRIAL else TRIAL if name == INTERACTION else against
        ratio = p = None
        if below is not None and square[below] > 0:
            ratio = square[name] / square[below]
            p = float(f_distribution.sf(ratio, dof, sums[below][0]))
        out.append(VarianceRow(name, dof, total, square[name], ratio, p))
    return tuple(out)


def _pooled(table: tuple[VarianceRow, ...]) -> tuple[VarianceRow, ...]:
    """The interaction counted with the trials."""
    sums = {s.name: (s.dof, s.sum_of_squares) for s in table}
    extra = sums.pop(INTERACTION)
    dof, total = sums[TRIAL]
    sums[TRIAL] = (dof + extra[0], total + extra[1])
    return _tested(sums, TRIAL)


def _combinations(used: tuple[VarianceRow, ...], p: int, o: int, r: int) -> dict[str, Array]:
    """Each component as a row over the mean squares used."""
    names = [s.name for s in used]
    unit = dict(zip(names, np.eye(len(names)), strict=True))
    below = unit.get(INTERACTION, unit[TRIAL])
    rows = {TRIAL: unit[TRIAL]}
    if OPERATOR in unit:
        rows[OPERATOR] = (unit[OPERATOR] - below) / (p * r)
    if INTERACTION in unit:
        rows[INTERACTION] = (unit[INTERACTION] - unit[TRIAL]) / r
    rows[PART] = (unit[PART] - below) / (o * r)
    return rows
