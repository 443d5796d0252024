"""What a figure proves of a limit, in ISO 14253-1's words."""

from __future__ import annotations

import pytest

from workbench.accept.figures import CONTRARY, OPEN, PROVEN, Figure, Limit, check, gaussian_bounds, judge

U = 0.1  # standard uncertainty: conformity is proven 0.1645 off the limit


@pytest.mark.parametrize(
    ("value", "decision"),
    [(0.83, PROVEN), (0.84, OPEN), (1.0, OPEN), (1.16, OPEN), (1.17, CONTRARY), (-1.17, CONTRARY)],
)
def test_a_signed_error_is_judged_by_its_size(value: float, decision: str) -> None:
    figure = Figure("PS", value, "mm", "", gaussian_bounds(value, U), signed=True)
    found = check(Limit("PS", 1.0), figure, "conformity")
    assert found.decision == decision
    assert found.passed == (decision == PROVEN)
    assert check(Limit("PS", 1.0), figure, "nonconformity").passed == (decision != CONTRARY)
    assert check(Limit("PS", 1.0), figure, "simple").passed == (abs(value) <= 1.0)


def test_at_least_is_the_mirror_of_at_most() -> None:
    for value, decision in ((1.17, PROVEN), (1.0, OPEN), (0.83, CONTRARY)):
        figure = Figure("Cgk", value, "", "", gaussian_bounds(value, U))
        assert check(Limit("Cgk", 1.0, at_most=False), figure, "conformity").decision == decision


def test_verdicts() -> None:
    good, open_, bad = (Figure(n, v, "mm", "", gaussian_bounds(v, U)) for n, v in (("a", 0.5), ("b", 1.0), ("c", 2.0)))
    limits = [Limit(n, 1.0) for n in "abc"]
    assert judge([], [good], "conformity")[1].code == "no_limits"
    assert judge(limits[:1], [good], "conformity")[1].code == "conform"
    unsure = judge(limits[:2], [good, open_], "conformity")[1]
    assert (unsure.code, unsure.passed) == ("not_proven", False)
    assert judge(limits[:2], [good, open_], "nonconformity")[1].passed
    broken = judge(limits, [good, open_, bad], "nonconformity")[1]
    assert (broken.code, broken.passed) == ("nonconform", False)


def test_what_is_not_told_proves_nothing() -> None:
    found = check(Limit("Cgk", 1.0, at_most=False), Figure("Cgk", None, "", ""), "conformity")
    assert (found.decision, found.passed) == (OPEN, False)
