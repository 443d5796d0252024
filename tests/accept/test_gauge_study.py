"""A gauge study against the book's own figures, and against gauges whose components are known.

The intervals' coverage is that of normal effects; nothing is said of gauges whose spread grows with the part.
"""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import binom, chi2, f

from tests.accept.aiag import VALUES
from workbench.accept import GaugeTable, study_gauge
from workbench.accept.variance import INTERACTION, OPERATOR, PART, TRIAL, components

ROUNDING = 5e-6  # of the book's last digit, five decimals
N_GAUGES, LEVEL = 200, 0.95
LIKELY = 1e-3  # of the two sides together: how often a sound interval would fail the test of its coverage


def table_of(values: np.ndarray, reference: np.ndarray | None = None) -> GaugeTable:
    parts = tuple(f"{i}" for i in range(len(values)))
    operators = tuple("ABCDEF"[: values.shape[1]]) if values.shape[1] > 1 else ()
    return GaugeTable(parts, operators, values, np.full(len(parts), np.nan) if reference is None else reference)


def test_the_book_s_table_of_variance() -> None:
    """Sums of squares, F and p of the full table, and the rows after pooling, as published."""
    found = components(VALUES)
    rows = {s.name: s for s in found.table}
    assert [rows[n].dof for n in (PART, OPERATOR, INTERACTION, TRIAL)] == [9, 2, 18, 60]
    published = {PART: (88.3619, 9.81799), OPERATOR: (3.1673, 1.58363), INTERACTION: (0.3590, 0.01994)}
    for name, (total, square) in (published | {TRIAL: (2.7589, 0.04598)}).items():
        assert rows[name].sum_of_squares == pytest.approx(total, abs=5e-5)
        assert rows[name].mean_square == pytest.approx(square, abs=ROUNDING)
    assert rows[INTERACTION].f == pytest.approx(0.434, abs=5e-4)
    assert found.interaction_p == pytest.approx(0.974, abs=5e-4)
    assert found.pooled
    used = {s.name: s for s in found.used}
    assert used[TRIAL].dof == 78
    assert used[TRIAL].mean_square == pytest.approx(0.03997, abs=ROUNDING)
    assert used[PART].f == pytest.approx(245.614, abs=5e-4)
    assert used[OPERATOR].f == pytest.approx(39.617, abs=5e-4)


def test_the_book_s_figures() -> None:
    figures = {f.name: f for f in study_gauge(table_of(VALUES), tolerance_mm=8.0).figures}
    for name, published in (("EV", 0.199933), ("AV", 0.226838), ("GRR", 0.302373), ("PV", 1.04233), ("TV", 1.08530)):
        assert figures[name].value == pytest.approx(published, abs=ROUNDING)
    for name, published in (("EV", 18.4), ("AV", 20.9), ("GRR", 27.9), ("PV", 96.0)):
        assert figures[f"percent_{name}"].value == pytest.approx(published, abs=0.05)
    assert figures["ndc"].value == 4
    assert figures["INT"].value is None
    assert figures["percent_GRR_tolerance"].value == pytest.approx(100 * 6 * 0.302373 / 8, abs=1e-3)
    assert figures["Cg"].value == pytest.approx(0.2 * 8 / (6 * 0.199933), abs=1e-4)


def test_intervals_against_closed_forms() -> None:
    """EV's is that of χ², GRR's that of modified large samples (Burdick, Borror and Montgomery 2005, table 3.5)."""
    figures = {f.name: f for f in study_gauge(table_of(VALUES), pool_above=1.0).figures}
    square = {s.name: (s.mean_square, s.dof) for s in components(VALUES).table}
    ev, n = square[TRIAL]
    bounds = figures["EV"].bounds
    assert bounds is not None
    exact = np.sqrt(ev * n / chi2.ppf([0.975, 0.025], n))
    assert (bounds.low, bounds.high) == pytest.approx(exact, rel=4e-3)
    p, _, r = VALUES.shape
    weight = {OPERATOR: 1 / (p * r), INTERACTION: (p - 1) / (p * r), TRIAL: (r - 1) / r}
    value = sum(weight[k] * square[k][0] for k in weight)
    below = sum((weight[k] * square[k][0] * (1 - square[k][1] / chi2.ppf(0.975, square[k][1]))) ** 2 for k in weight)
    above = sum((weight[k] * square[k][0] * (square[k][1] / chi2.ppf(0.025, square[k][1]) - 1)) ** 2 for k in weight)
    large = np.sqrt([value - np.sqrt(below), value + np.sqrt(above)])
    bounds = figures["GRR"].bounds
    assert bounds is not None
    assert (bounds.low, bounds.high) == pytest.approx(large, rel=0.03)  # two approximations of one interval


@pytest.mark.parametrize(("interaction", "shape"), [(0.0, (10, 3, 3)), (0.6, (8, 4, 2)), (0.0, (12, 1, 4))])
def test_components_of_known_gauges_lie_in_their_intervals(interaction: float, shape: tuple[int, int, int]) -> None:
    """Of 200 emulated gauges each interval covers the truth as often as 95 % do, by exact binomial bounds.

    Intervals of this kind may cover more than they say where a component is near zero, never less.
    """
    p, o, r = shape
    truth = {"EV": 0.5, "AV": 0.7 if o > 1 else 0.0, "INT": interaction, "PV": 2.0}
    gauge = np.sqrt(truth["EV"] ** 2 + truth["AV"] ** 2 + truth["INT"] ** 2)
    truth |= {"GRR": gauge, "TV": np.hypot(gauge, truth["PV"])}
    truth["percent_GRR"] = 100 * gauge / truth["TV"]
    rng = np.random.default_rng([77, *shape, round(10 * interaction)])
    covered = dict.fromkeys(truth, 0)
    for _ in range(N_GAUGES):
        values = (
            50
            + truth["PV"] * rng.standard_normal((p, 1, 1))
            + truth["AV"] * rng.standard_normal((1, o, 1))
            + truth["INT"] * rng.standard_normal((p, o, 1))
            + truth["EV"] * rng.standard_normal((p, o, r))
        )
        for figure in study_gauge(table_of(values), draws=2000).figures:
            if figure.name in covered and figure.bounds is not None:
                covered[figure.name] += figure.bounds.low <= truth[figure.name] <= figure.bounds.high
    least = binom.ppf(LIKELY / 2, N_GAUGES, LEVEL)
    told = {name: n for name, n in covered.items() if n or name in ("EV", "PV", "GRR", "TV")}
    assert min(n for name, n in told.items() if name != "INT") >= least, covered
    if interaction == 0:
        assert covered["EV"] <= binom.ppf(1 - LIKELY / 2, N_GAUGES, LEVEL), covered


def test_an_interaction_is_pooled_by_its_p_value() -> None:
    rng = np.random.default_rng(4)
    values = rng.standard_normal((6, 1, 1)) * 3 + rng.standard_normal((6, 3, 1)) + 0.1 * rng.standard_normal((6, 3, 2))
    found = components(values)
    assert not found.pooled
    source = next(s for s in found.table if s.name == INTERACTION)
    assert source.f is not None
    assert source.p == pytest.approx(float(f.sf(source.f, source.dof, 18)), abs=1e-15)
    assert components(values, pool_above=0.0).pooled
    assert found.variance[INTERACTION] > 0.2


def test_a_large_common_value_changes_nothing() -> None:
    near, far = components(VALUES), components(VALUES + 1e6)
    for name, v in near.variance.items():
        assert far.variance[name] == pytest.approx(v, rel=1e-6)


def test_bias_of_a_master_counts_in_cgk() -> None:
    """Cgk = (0.1 T − |bias|) / (3 EV); without reference values it is not told."""
    means = VALUES.mean(axis=(1, 2))
    reference = np.full(10, np.nan)
    reference[3] = means[3] + 0.1
    figures = {f.name: f for f in study_gauge(table_of(VALUES, reference), tolerance_mm=8.0).figures}
    ev = figures["EV"].value
    assert ev is not None
    assert figures["Cgk"].value == pytest.approx((0.8 - 0.1) / (3 * ev), abs=1e-12)
    assert {f.name: f for f in study_gauge(table_of(VALUES), tolerance_mm=8.0).figures}["Cgk"].value is None
