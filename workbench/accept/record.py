"""The record of an acceptance test: what was measured, asked and proven, and by which standard as far as it goes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from workbench.accept.figures import COVERAGE, Check, Conformity, Figure, Limit, Rule, judge
from workbench.files import sha256_of

RULE_WORDS = {
    "conformity": "passes what is proven to conform (ISO 14253-1, the supplier's proof)",
    "nonconformity": "fails what is proven not to conform (ISO 14253-1, the user's proof)",
    "simple": "the value alone decides, its uncertainty is stated beside it",
}


@dataclass(frozen=True, eq=False)
class Record:
    """A test that was made.

    test: its name on the command line; title and standard: what it is, and what it follows. figures, checks, verdict:
    what was measured and decided. details: more numbers, by name, for the JSON. not_judged: sentences on what the
    standard asks and a line sensor's data can not show. inputs: files and their hashes.
    """

    test: str
    title: str
    standard: str
    figures: tuple[Figure, ...]
    checks: tuple[Check, ...]
    verdict: Conformity
    rule: Rule
    details: dict[str, Any] = field(default_factory=dict)
    not_judged: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    remarks: tuple[str, ...] = ()
    inputs: tuple[tuple[str, str], ...] = ()


def make_record(
    test: str,
    title: str,
    standard: str,
    figures: Sequence[Figure],
    limits: Sequence[Limit],
    rule: Rule,
    inputs: Sequence[Path],
    *,
    details: dict[str, Any] | None = None,
    not_judged: Sequence[str] = (),
    notes: Sequence[str] = (),
    remarks: Sequence[str] = (),
) -> Record:
    """A record with its verdict.

    Parameters
    ----------
    test, title, standard
        What was tested, and by what.
    figures
        What was measured.
    limits
        On figures of these names.
    rule
        What passes.
    inputs
        Files that were read.
    details
        More numbers, by name.
    not_judged
        What the standard asks and these data can not show.
    notes
        Of the test.
    remarks
        The user's own words: who, where, which instrument.

    Returns
    -------
    Record

    """
    checks, verdict = judge(limits, figures, rule)
    hashes = tuple((str(p), sha256_of(p)) for p in inputs)
    return Record(
        test, title, standard, tuple(figures), checks, verdict, rule, details or {}, tuple(not_judged), tuple(notes),
        tuple(remarks), hashes,
    )  # fmt: skip


def record_object(record: Record) -> dict[str, Any]:
    """The object that ``accept --json`` prints."""
    return {
        "test": record.test,
        "title": record.title,
        "standard": record.standard,
        "verdict": {"code": record.verdict.code, "text": record.verdict.text, "passed": record.verdict.passed},
        "rule": record.rule,
        "coverage": COVERAGE,
        "figures": {f.name: _figure_object(f) for f in record.figures},
        "checks": [
            {
                "figure": c.figure.name,
                "at_most" if c.limit.at_most else "at_least": c.limit.value,
                "decision": c.decision,
                "passed": c.passed,
            }
            for c in record.checks
        ],
        **record.details,
        "not_judged": list(record.not_judged),
        "notes": list(record.notes),
        "remarks": list(record.remarks),
        "inputs": [{"file": name, "sha256": digest} for name, digest in record.inputs],
    }


def _figure_object(figure: Figure) -> dict[str, Any]:
    b = figure.bounds
    return {
        "value": figure.value,
        "unit": figure.unit,
        "interval": None if b is None else [b.low, b.high],
        "one_sided": None if b is None else {"at_least": b.least, "at_most": b.most},
        "words": figure.words,
    }
