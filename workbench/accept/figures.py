"""Figures of a test with their intervals, limits on them, and what the two prove together (ISO 14253-1)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from scipy.stats import norm

COVERAGE = 0.95  # of intervals, two-sided; the level of ISO 14253-1's decision, one-sided
ONE_SIDED = float(norm.ppf(COVERAGE))  # 1.645 standard uncertainties
TWO_SIDED = float(norm.ppf((1 + COVERAGE) / 2))  # 1.960

Rule = Literal["conformity", "nonconformity", "simple"]
RULES: tuple[Rule, ...] = ("conformity", "nonconformity", "simple")
PROVEN, CONTRARY, OPEN = "conformity proven", "nonconformity proven", "neither proven"
WITHIN, BEYOND = "within the limit", "beyond the limit"  # by the value alone


@dataclass(frozen=True)
class Bounds:
    """An interval of a figure at `COVERAGE`: two-sided from low to high; one-sided at least, at most."""

    low: float
    high: float
    least: float
    most: float


@dataclass(frozen=True)
class Figure:
    """One figure of a test.

    name: its key in the record; unit: "mm", "%", "" for a ratio; words: what it is. value: None where the test can not
    tell it, and ``words`` say why. bounds: None where the figure has no uncertainty.
    signed: an error with a sign, whose size is what a limit speaks of.
    """

    name: str
    value: float | None
    unit: str
    words: str
    bounds: Bounds | None = None
    signed: bool = False


@dataclass(frozen=True)
class Limit:
    """What is asked of a figure: at most, or at least."""

    figure: str
    value: float
    at_most: bool = True


@dataclass(frozen=True)
class Check:
    """A limit, the figure that it is put on, and what was decided."""

    limit: Limit
    figure: Figure
    decision: str
    passed: bool


@dataclass(frozen=True)
class Conformity:
    """conform, nonconform, not_proven (no limit is broken for certain, and not all are kept for certain), no_limits."""

    code: str
    text: str
    passed: bool


def gaussian_bounds(value: float, u: float) -> Bounds:
    """The interval of a value with a standard uncertainty."""
    return Bounds(value - TWO_SIDED * u, value + TWO_SIDED * u, value - ONE_SIDED * u, value + ONE_SIDED * u)


def check(limit: Limit, figure: Figure, rule: Rule) -> Check:
    """What a figure proves of a limit.

    Parameters
    ----------
    limit
        What is asked.
    figure
        What was measured; of a signed one the size is judged.
    rule
        conformity: passes only what is proven to conform, as the supplier must (ISO 14253-1). nonconformity: fails only
        what is proven not to, as the user must. simple: the value alone decides. A figure without an interval is
        decided by its value.

    Returns
    -------
    Check

    """
    if figure.value is None:
        return Check(limit, figure, OPEN, rule == "nonconformity")
    value = abs(figure.value) if figure.signed else figure.value
    kept = value <= limit.value if limit.at_most else value >= limit.value
    if rule == "simple" or figure.bounds is None:
        return Check(limit, figure, WITHIN if kept else BEYOND, kept)
    least, most = figure.bounds.least, figure.bounds.most
    if figure.signed:
        least, most = max(least, -most, 0.0), max(most, -least)
    sure, broken = (most <= limit.value, least > limit.value) if limit.at_most else (
        least >= limit.value, most < limit.value
    )  # fmt: skip
    decision = PROVEN if sure else CONTRARY if broken else OPEN
    return Check(limit, figure, decision, not broken if rule == "nonconformity" else sure)


def judge(limits: Sequence[Limit], figures: Sequence[Figure], rule: Rule) -> tuple[tuple[Check, ...], Conformity]:
    """Every limit's check, and the verdict over all."""
    by_name = {f.name: f for f in figures}
    checks = tuple(check(limit, by_name[limit.figure], rule) for limit in limits)
    if not checks:
        return checks, Conformity("no_limits", "no limit was given: the figures are stated and nothing is judged", True)
    passed = all(c.passed for c in checks)
    broken = [c for c in checks if c.decision in (CONTRARY, BEYOND)]
    unsure = [c for c in checks if c.decision == OPEN]
    text = "; ".join(said(c) for c in (broken or unsure or checks))
    code = "nonconform" if broken else "not_proven" if unsure else "conform"
    return checks, Conformity(code, text, passed)


def said(c: Check) -> str:
    """A check in words."""
    name = f"{c.figure.name} = {'unknown' if c.figure.value is None else f'{c.figure.value:.4g}'}"
    side = "at most" if c.limit.at_most else "at least"
    return f"{name}, {side} {c.limit.value:g} asked: {c.decision}"
