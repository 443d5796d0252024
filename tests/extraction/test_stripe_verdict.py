"""Which ridges are stripe at both sides of each limit, of ridges that are measured already."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from extraction.stripe.ridges import Chain
from extraction.stripe.verdict import stripes
from extraction.stripe.verdict.stripes import Stripe, StripeVerdict, judge
from extraction.stripe.verdict.track import Bumps, Track

GREY = np.zeros((4, 4), np.uint8)


def ridge(first: int = 0, length: int = 400, at: float = 100.0, **changed: Any) -> Stripe:
    """A clear one of 100 DN and σ 2 px, of a chain of contrast 10."""
    given: dict[str, Any] = {
        "height": 100.0, "width": 2.0, "flat": 0.4, "peaks": 1, "contrast": 10.0, "significance": 100.0, "slope": 0.0,
        "narrow": False, "dark": False, "least": 20, "chain": None,
    } | changed  # fmt: skip
    g = given
    section = np.arange(first, first + length, 1.0)
    place = at + g["slope"] * np.arange(length)
    light = float(g["height"])
    chain = g["chain"] or Chain(
        section, place, np.full(length, light), 1, 4 if g["narrow"] else 1, g["significance"], light, g["contrast"],
        light * length,
    )  # fmt: skip
    bumps = Bumps(g["peaks"], 0.0, 0.0, g["width"], light, g["flat"])
    return Stripe(
        Track(first, place, np.full(length, g["width"])), chain, bumps, light, least=g["least"], dark=g["dark"]
    )


def judged(monkeypatch: pytest.MonkeyPatch, *measured: Stripe, max_width: float = 30.0) -> StripeVerdict:
    """The verdict where the chains measure as given, most light first."""
    chains: list[Chain] = []
    for s in measured:
        if not any(s.chain is c for c in chains):
            chains.append(s.chain)
    monkeypatch.setattr(stripes, "_measure", lambda _grey, chain, *_: [s for s in measured if s.chain is chain])
    return judge(GREY, chains, 255.0, max_width, 20)


def kept(monkeypatch: pytest.MonkeyPatch, *measured: Stripe) -> list[tuple[int, float]]:
    """First section and place there of what is kept, ghosts not counted."""
    found = judged(monkeypatch, *measured).stripes
    return sorted((s.track.first, float(s.track.place[0])) for s in found if not s.ghost)


BEST = ridge()


@pytest.mark.parametrize(
    ("beside", "beyond", "reason"),
    [
        ({"length": 80, "height": 46.0}, {"length": 80, "height": 44.0}, "faint"),  # of its light
        ({"height": 22.1}, {"height": 21.9}, "weak_beside_the_stripe"),
        ({"contrast": 6.6}, {"contrast": 6.4}, "weak_beside_the_stripe"),
        ({"length": 160, "width": 4.9}, {"length": 160, "width": 5.1}, "weak_beside_the_stripe"),  # than the best
        ({"length": 160, "width": 6.0, "height": 130.1}, {"length": 160, "width": 6.0, "height": 129.9},
         "weak_beside_the_stripe"),
        ({"narrow": True, "significance": 50.1}, {"narrow": True, "significance": 49.9}, "weak_beside_the_stripe"),
        ({"flat": 0.61, "width": 2.5}, {"flat": 0.61, "width": 2.7}, "flat"),
        ({"flat": 0.59, "width": 2.7}, {"flat": 0.61, "width": 2.7}, "flat"),
        ({"width": 5.0}, {"width": 30.1}, "too_wide"),
        ({"first": 380, "length": 36, "height": 101.0}, {"first": 380, "length": 36, "height": 101.0, "dark": True},
         "weak_beside_the_stripe"),
    ],
)  # fmt: skip
def test_a_limit_divides_what_is_kept_beside_the_best(
    monkeypatch: pytest.MonkeyPatch, beside: dict[str, Any], beyond: dict[str, Any], reason: str
) -> None:
    apart = {"at": 300.0, "first": 350, "length": 300}
    taken = judged(monkeypatch, BEST, ridge(**apart | beside))
    assert len(taken.stripes) == 2
    assert not any(s.ghost for s in taken.stripes)
    left = judged(monkeypatch, BEST, ridge(**apart | beyond))
    assert len(left.stripes) == 1
    assert left.refused == {reason: 1}


def test_a_ridge_must_be_some_times_longer_than_wide(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six full widths (28.3 sections of σ 2 px), four of one that stands out as the best does, and the least asked."""
    weaker = {"at": 300.0, "first": 450, "contrast": 9.0, "height": 150.0}
    assert len(judged(monkeypatch, BEST, ridge(length=29, **weaker)).stripes) == 2
    assert len(judged(monkeypatch, BEST, ridge(length=28, **weaker)).stripes) == 1
    clear = weaker | {"contrast": 10.0, "significance": 50.0, "height": 200.0}
    assert len(judged(monkeypatch, BEST, ridge(length=19, least=19, **clear)).stripes) == 2
    assert len(judged(monkeypatch, BEST, ridge(length=19, least=20, **clear)).stripes) == 1
    assert len(judged(monkeypatch, BEST, ridge(length=18, least=18, **clear)).stripes) == 1
    assert len(judged(monkeypatch, BEST, ridge(length=19, least=19, **clear | {"significance": 49.9})).stripes) == 1
    short = judged(monkeypatch, ridge(length=28))
    assert (short.stripes, short.refused) == ([], {"short": 1})


def test_faint_chains_are_not_measured_but_where_a_longer_one_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 40,000: a hundredth is looked at within 60 sections of its end and nowhere else, a thousandth nowhere."""
    faint = {"length": 40, "height": 10.0, "contrast": 9.0}  # 0.01 of the light
    assert judged(monkeypatch, BEST, ridge(first=459, **faint)).stripes[1].joined
    assert judged(monkeypatch, BEST, ridge(first=460, **faint)).refused == {"faint": 1}
    assert judged(monkeypatch, BEST, ridge(first=100, at=400.0, **faint)).refused == {"faint": 1}
    assert judged(monkeypatch, BEST, ridge(first=410, **faint | {"height": 3.9})).refused == {"faint": 1}
    assert len(judged(monkeypatch, BEST, ridge(first=410, **faint | {"height": 4.1})).stripes) == 2
    assert judged(monkeypatch).refused == {}


def test_what_goes_on_in_line_is_joined(monkeypatch: pytest.MonkeyPatch) -> None:
    """A short dim piece: within the gap, on the line of either, with contrast enough; of slanting pieces, too."""
    for slope in (0.0, 0.3, -0.7):
        best = ridge(slope=slope)
        piece = {"first": 430, "length": 25, "height": 20.0, "contrast": 5.3, "slope": slope}
        on = 100.0 + slope * 430
        near = 3.0 + 0.15 * 30 + 2.0
        assert len(judged(monkeypatch, best, ridge(at=on, **piece)).stripes) == 2
        assert len(judged(monkeypatch, best, ridge(at=on + near - 0.2, **piece)).stripes) == 2
        assert len(judged(monkeypatch, best, ridge(at=on + near + 0.2, **piece)).stripes) == 1
        assert len(judged(monkeypatch, best, ridge(at=on, **piece | {"contrast": 5.1})).stripes) == 1
        assert len(judged(monkeypatch, best, ridge(at=on, **piece | {"width": 5.1})).stripes) == 1
        before = {"first": 400, "length": 400, "slope": slope, "at": on}
        early = ridge(at=on - slope * 55, **piece | {"first": 345, "length": 25})
        assert len(judged(monkeypatch, ridge(**before), early).stripes) == 2


@pytest.mark.parametrize("slope", [0.3, -0.3])
def test_what_lies_on_the_line_of_one_of_two_pieces_alone_is_joined(
    monkeypatch: pytest.MonkeyPatch, slope: float
) -> None:
    """Fifty sections on: the line of one passes the other, that of the other misses by 15 px, of which 12.5 are few."""
    piece = {"first": 450, "length": 25, "height": 20.0, "contrast": 5.3}
    on = 100.0 + slope * 450
    assert len(judged(monkeypatch, ridge(slope=slope), ridge(at=on, **piece)).stripes) == 2
    assert len(judged(monkeypatch, ridge(), ridge(at=100.0 + 51 * slope, slope=slope, **piece)).stripes) == 2
    assert len(judged(monkeypatch, ridge(), ridge(at=100.0 + 51 * slope, **piece)).stripes) == 1


def test_rivals_are_of_like_light_over_like_sections(monkeypatch: pytest.MonkeyPatch) -> None:
    def rivals(**other: Any) -> list[bool]:
        return [s.rivals for s in judged(monkeypatch, BEST, ridge(**{"at": 300.0, "length": 399} | other)).stripes]

    assert rivals() == [True, True]
    assert rivals(height=46.0) == [True, True]
    assert rivals(height=44.0, length=400) == [False, True]  # the dim one's rival is the bright one, not the other way
    assert rivals(first=199) == [True, True]
    assert rivals(first=201) == [False, False]
    assert rivals(peaks=2, first=201) == [False, True]


def test_a_ghost_ends_where_the_stripe_beside_it_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    def ghosts(length: int = 300, first: int = 50, height: float = 150.0, **longer: Any) -> list[bool]:
        stripe = ridge(**longer)
        bright = ridge(at=300.0, first=first, length=length, height=height, contrast=10.0)
        found = judged(monkeypatch, *sorted([stripe, bright], key=lambda s: -s.light))
        return sorted(s.ghost for s in found.stripes)

    assert ghosts() == [False, True]
    assert ghosts(length=370, first=15) == [False, False]  # neither end goes on by a tenth
    assert ghosts(length=340, first=15) == [False, True]
    assert ghosts(first=180) == [False, False]  # 0.73 of it beside the stripe
    assert ghosts(first=158) == [False, True]
    assert ghosts(height=220.0) == [False, True]  # 0.606 of its light
    assert ghosts(height=224.0) == [False, False]
    assert ghosts(contrast=6.6) == [False, True]
    assert ghosts(contrast=6.4) == [False]  # is no stripe itself


def test_many_alike_beside_one_another_are_a_pattern(monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [ridge(at=100.0 + 60 * k) for k in range(3)]
    assert len(judged(monkeypatch, *rows[:2]).stripes) == 2
    assert judged(monkeypatch, *rows).refused == {"one_of_many": 3}
    assert len(judged(monkeypatch, *rows[:2], ridge(at=400.0, first=62)).stripes) == 3  # 2.597 in the mean
    assert judged(monkeypatch, *rows[:2], ridge(at=400.0, first=61)).stripes == []  # 2.603
    dim = [*rows[:2], ridge(at=400.0, height=44.0)]
    assert len(judged(monkeypatch, *dim).stripes) == 3
    assert judged(monkeypatch, *rows[:2], ridge(at=400.0, height=46.0)).stripes == []


def test_a_short_ridge_fills_a_gap_of_the_stripe_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """As high and as wide as the stripe, far off its line: nothing else there is its like."""
    after = replace(ridge(first=450), chain=BEST.chain)
    piece = {"first": 410, "length": 25, "at": 130.0, "height": 61.0, "significance": 100.0}

    def found(*others: Stripe, **changed: Any) -> int:
        return sum(
            s.track.first == 410 for s in judged(monkeypatch, BEST, after, ridge(**piece | changed), *others).stripes
        )

    assert found() == 1
    assert found(height=59.0) == 0
    assert found(length=18) == 0
    assert found(height=80.0, width=0.51) == 1
    assert found(height=80.0, width=0.49) == 0  # the best is wider than twice that and a pixel
    assert found(contrast=6.4) == 0
    beside = {"first": 412, "length": 22, "at": 60.0, "significance": 10.0}
    assert found(ridge(height=37.0, **beside)) == 0
    assert found(ridge(height=36.0, **beside)) == 1
    assert found(ridge(height=37.0, **beside | {"first": 424})) == 1  # beside less than half of it


def test_one_of_many_short_ones_is_texture(monkeypatch: pytest.MonkeyPatch) -> None:
    """Six refused ridges whose significance is 0.6 of its own, or more."""
    piece = ridge(at=300.0, first=20, length=60, height=70.0, significance=30.0)

    def count(*significances: float) -> int:
        speckle = [
            ridge(at=400.0 + 40 * k, first=100, length=22, height=101.0, significance=s, contrast=6.6)
            for k, s in enumerate(significances)
        ]
        return len(judged(monkeypatch, BEST, piece, *speckle).stripes)

    assert count(*[18.1] * 5) == 2
    assert count(*[18.1] * 6) == 1
    assert count(*[18.1] * 5, 17.9) == 2
