"""Acceptance tests with a record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.markup import escape
from rich.table import Table

from workbench.cli import exit_codes
from workbench.cli.console import say_on_stdout, say_remark, standard_output

if TYPE_CHECKING:
    from workbench.accept import Record

app = typer.Typer(add_completion=False, no_args_is_help=True, rich_markup_mode="rich")

Rule = Literal["conformity", "nonconformity", "simple"]
RuleOption = Annotated[
    Rule,
    typer.Option(
        help="What passes: conformity, what is proven to keep its limits (ISO 14253-1, the supplier's proof); "
        "nonconformity, all but what is proven to break one (the user's); simple, by the value alone."
    ),
]
Out = Annotated[Path | None, typer.Option(help="File of the record, JSON.")]
Report = Annotated[Path | None, typer.Option(help="File of the record, HTML.")]
AsJson = Annotated[bool, typer.Option("--json", help="Print the record as one JSON object on standard output.")]
Remarks = Annotated[
    list[str] | None, typer.Option("--remark", help="A line for the record: who, where, serial number.")
]


@app.callback()
def _tests() -> None:
    """Make a usual acceptance test and write its record, with limits, intervals and what they prove.

    Exit code 1 where a limit is not kept, by the rule that was chosen.
    """


@app.command()
def gauge(
    table: Annotated[
        Path, typer.Argument(metavar="TABLE.csv", help="Columns part, operator, value; or trials in columns 1, 2, …")
    ],
    part: Annotated[str, typer.Option(help="Name of the column of parts.")] = "part",
    operator: Annotated[str, typer.Option(help="Name of the column of operators.")] = "operator",
    trial: Annotated[str, typer.Option(help="Name of the column of trials, where there is one.")] = "trial",
    value: Annotated[str, typer.Option(help="Name of the column of values.")] = "value",
    reference: Annotated[str, typer.Option(help="Name of the column of the parts' own values, for Cgk.")] = "reference",
    tolerance_mm: Annotated[
        float | None, typer.Option(min=1e-9, max=1e6, help="Full width of the tolerance, for its shares, Cg and Cgk.")
    ] = None,
    pool_above: Annotated[
        float, typer.Option(min=0, max=1, help="Pool the interaction with the trials where its p-value is above.")
    ] = 0.25,
    max_grr_percent: Annotated[
        float | None,
        typer.Option(min=0, max=1e6, help="Limit of %GRR: of the tolerance where one is given, else of the variation."),
    ] = None,
    max_grr_mm: Annotated[float | None, typer.Option(min=0, max=1e6, help="Limit of GRR, as σ.")] = None,
    min_ndc: Annotated[int | None, typer.Option(min=1, help="Fewest distinct categories.")] = None,
    min_cg: Annotated[float | None, typer.Option(min=0, max=1e6, help="Limit of Cg.")] = None,
    min_cgk: Annotated[float | None, typer.Option(min=0, max=1e6, help="Limit of Cgk.")] = None,
    rule: RuleOption = "conformity",
    remark: Remarks = None,
    out: Out = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """Gauge R&R by analysis of variance: EV, AV, PV, %GRR, ndc, Cg and Cgk of parts × operators × trials."""
    from geometry import InputError
    from workbench.accept import GaugeColumns, Limit, accept_gauge

    if tolerance_mm is None and (min_cg is not None or min_cgk is not None):
        raise InputError("--min-cg and --min-cgk need --tolerance-mm: Cg and Cgk are shares of a tolerance")
    share = "percent_GRR" if tolerance_mm is None else "percent_GRR_tolerance"
    asked = [
        (share, max_grr_percent, True), ("GRR", max_grr_mm, True), ("ndc", min_ndc, False), ("Cg", min_cg, False),
        ("Cgk", min_cgk, False),
    ]  # fmt: skip
    limits = [Limit(name, float(x), at_most) for name, x, at_most in asked if x is not None]
    columns = GaugeColumns(part, operator, trial, value, reference)
    record = accept_gauge(table, columns, limits, rule, tolerance_mm, pool_above, remark or [], say_remark)
    _deliver(record, out, report, as_json=as_json)


def _deliver(record: Record, out: Path | None, report: Path | None, *, as_json: bool) -> None:
    """Write and print a record; exit code 1 where it does not pass."""
    from workbench.accept import record_object, write_record_page
    from workbench.files import write_text
    from workbench.report import json_text

    text = json_text(record_object(record))
    if out is not None:
        write_text(out, text + "\n")
    if report is not None:
        write_record_page(record, report)
    if as_json:
        say_on_stdout(text)
    else:
        _show(record)
    if not record.verdict.passed:
        raise typer.Exit(exit_codes.THRESHOLD)


def _show(record: Record) -> None:
    from workbench.report import number

    console = standard_output()
    table = Table(title=escape(f"{record.title}\n{record.standard}"), title_justify="left")
    for heading in ("figure", "value", "95 % interval", "unit"):
        table.add_column(heading, justify="left" if heading in ("figure", "unit") else "right")
    for f in record.figures:
        interval = "" if f.bounds is None else f"{number(f.bounds.low, 4)} … {number(f.bounds.high, 4)}"
        table.add_row(escape(f.name), number(f.value, 4), interval, f.unit)
    console.print(table)
    for line in record.not_judged:
        console.print(f"not judged: {line}", markup=False, soft_wrap=True)
    for line in record.notes:
        console.print(f"note: {line}", markup=False, soft_wrap=True)
    console.print(f"verdict: {record.verdict.code}", markup=False)
    console.print(record.verdict.text, markup=False, soft_wrap=True)
