"""The page of an acceptance record, and its tables for the terminal."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from workbench.accept.figures import COVERAGE
from workbench.accept.record import RULE_WORDS, Record
from workbench.files import write_text
from workbench.report import Origin, new_figure, render_page, svg

BANNER = {"conform": "good", "no_limits": "good", "not_proven": "care", "nonconform": "bad"}
WORDS = {
    "conform": "conforms", "nonconform": "does not conform", "not_proven": "not proven",
    "no_limits": "measured, nothing judged",
}  # fmt: skip
_TITLES = {"anova": "table of variance", "components_from": "mean squares that the components come from"}
_MOST_ROWS = 200  # of a table on the page; the JSON has all


@dataclass(frozen=True)
class PageTable:
    """A table of the page, its cells as they are printed."""

    title: str
    headings: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def write_record_page(record: Record, path: Path) -> None:
    """Write the page of a record, whole or not at all; it opens offline.

    Parameters
    ----------
    record
        Of a test.
    path
        The HTML file.

    """
    content = {
        "record": record,
        "banner": BANNER[record.verdict.code],
        "words": WORDS[record.verdict.code],
        "rule": RULE_WORDS[record.rule],
        "shown": shown,
        "coverage": round(100 * COVERAGE),
        "tables": _tables(record.details),
        "pictures": [_gauge_picture(record)] if record.test == "gauge" else [],
    }
    write_text(path, render_page("workbench.accept", "page.html.j2", content, _origin(record)))


def _origin(record: Record) -> Origin:
    return Origin(inputs=record.inputs, passed=record.verdict.passed)


def _tables(details: dict[str, Any]) -> list[PageTable]:
    """Every list of like rows among the details, under its name."""
    out = []
    for name, rows in details.items():
        if isinstance(rows, list) and rows and isinstance(rows[0], dict):
            shown = tuple(tuple(_cell(v) for v in row.values()) for row in rows[:_MOST_ROWS])
            title = _TITLES.get(name, name) + (
                f", the first {_MOST_ROWS} of {len(rows)}" if len(rows) > _MOST_ROWS else ""
            )
            out.append(PageTable(title, tuple(str(k).replace("_", " ") for k in rows[0]), shown))
    return out


def shown(value: float | None) -> str:
    """A number to four digits, a dash where there is none."""
    return "–" if value is None else f"{value:.4g}"


def _cell(value: Any) -> str:
    if isinstance(value, bool | np.bool_):
        return "yes" if value else "no"
    return shown(value) if value is None or isinstance(value, float) else str(value)


def _gauge_picture(record: Record) -> dict[str, str]:
    """How much of the variation each source has, with its interval."""
    figure, axis = new_figure(8, 2.6)
    shown = [f for f in record.figures if f.name in ("EV", "AV", "INT", "GRR", "PV") and f.value is not None]
    for k, f in enumerate(reversed(shown)):
        axis.barh(k, f.value, color="#2a6f97" if f.name != "GRR" else "#b5403a", height=0.6)
        if f.bounds is not None:
            axis.plot([f.bounds.low, f.bounds.high], [k, k], color="black", linewidth=1)
    axis.set_yticks(range(len(shown)), [f.name for f in reversed(shown)])
    axis.set_xlabel("σ")
    return {"data": svg(figure), "words": "Components as standard deviations; lines are their intervals."}
