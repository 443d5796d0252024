"""README's figures are those of a fresh run, within their stated spread.

Of the table over 2,112 emulated cells it proves only that README repeats docs/accuracy.md, which a campaign of hours
makes.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from benchmarks.readme_figures import README, Line, lines
from tests.recordings import MISSING, recording

LINES = lines(recording("cell_a").parent)
TEXT = README.read_text(encoding="utf-8")


@pytest.mark.parametrize(
    "line", [pytest.param(x, marks=pytest.mark.slow) if x.long else x for x in LINES], ids=lambda x: x.template[:40]
)
def test_readme_says_what_a_fresh_run_gives(line: Line) -> None:
    if line.needs is not None and not line.needs.is_dir():
        pytest.skip(MISSING)
    assert line.off(TEXT) == []


def test_a_number_that_is_off_by_one_digit_is_noticed() -> None:
    """The check itself: half a last digit passes, a whole one does not, a lost line is said."""
    line = Line("it is {a:.2f} mm, {b:.0f} times", lambda: {"a": 1.234, "b": 2100.4}, {"b": 3.0})
    assert line.off("so it is 1.23 mm, 2,103\ntimes.") == []
    assert [x.split(": ")[1].split(" ")[0] for x in line.off("it is 1.24 mm, 2,104 times")] == ["a", "b"]
    assert "no line like" in line.off("it was 1.23 mm")[0]


def test_the_campaigns_table_is_that_of_its_page() -> None:
    """README's 95 % bounds are the rounded ones of docs/accuracy.md, which benchmarks/docs_accuracy.py writes."""
    page = (Path(README).parent / "docs" / "accuracy.md").read_text(encoding="utf-8")
    bounds = {}
    for row in re.findall(r"^\| (as built|measured) \| `(\w+)` \| (\d+) \| 35° \|(.*)\|$", page, re.MULTILINE):
        mm, degrees = re.findall(r"([\d.]+) \(", row[3])
        bounds[row[:3]] = [float(mm), float(degrees)]
    rows = TEXT.partition("| arm | poses |")[2].partition("\n\n")[0].splitlines()[2:]
    arm, told = "", {}
    for row in rows:
        name, poses, *cells = (cell.strip() for cell in row.strip("|").split("|"))
        arm = name.partition(" (")[0] or arm
        for model, cell in zip(("scp", "full"), cells, strict=True):
            told[arm.removesuffix(" by its maker"), model, poses] = re.findall(r"[\d.]+", cell)
    assert len(told) == 8
    for case, numbers in told.items():
        for number, bound in zip(numbers, bounds[case], strict=True):
            digits = len(number.partition(".")[2])
            assert abs(float(number) - bound) <= 0.5000001 * 10.0**-digits, case
