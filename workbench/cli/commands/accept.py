"""Acceptance tests with a record."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import typer
from rich.markup import escape
from rich.table import Table

from workbench.cli import exit_codes
from workbench.cli.console import progress_bar, say_on_stdout, say_remark, standard_output

if TYPE_CHECKING:
    from workbench.accept import Limit, PlacedProfile, Record, Recorded

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
AsJson = Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")]
Remarks = Annotated[
    list[str] | None, typer.Option("--remark", help="A line for the record: who, where, serial number.")
]


Profiles = Annotated[
    list[Path],
    typer.Argument(metavar="PROFILES…|IMAGES…|DATASET", help="Files or folders, in order; or one cell dataset."),
]
Uncertainty = Annotated[
    float | None, typer.Option(min=0, max=1e3, help="Expanded uncertainty (k = 2) of the diameter by the certificate.")
]
Form = Annotated[float | None, typer.Option(min=0, max=1e3, help="The ball's own form deviation by its certificate.")]
SensorFile = Annotated[Path | None, typer.Option(help="sensor.toml or preset; needed for images.")]
Step = Annotated[
    float | None,
    typer.Option(min=-1e4, max=1e4, help="From profile to profile, along the normal of the laser sheet (x of {P})."),
]
Positions = Annotated[
    Path | None, typer.Option(help="Table profile, x_mm (y_mm, z_mm): where the sensor stood, in {P}.")
]
Scp = Annotated[Path | None, typer.Option(help="Of a cell: a result of calibrate --json; else \\[scp_initial].")]
Location = Annotated[str | None, typer.Option(help="Of a cell: the location that is tested.")]
Zone = Annotated[
    float | None,
    typer.Option(min=5, max=89, help="Points up to so far from a section's apex count; else the arc that is found."),
]
Settings = Annotated[
    list[Path] | None, typer.Option("--config", "--recipe", help="The recipe of all tools, TOML; may be repeated.")
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


@app.command()
def ball(
    paths: Profiles,
    diameter_mm: Annotated[float, typer.Option(min=1e-6, max=1e5, help="The ball's diameter by its certificate.")],
    diameter_uncertainty_mm: Uncertainty = None,
    form_mm: Form = None,
    sensor: SensorFile = None,
    step_mm: Step = None,
    positions: Positions = None,
    scp: Scp = None,
    location: Location = None,
    zone_deg: Zone = None,
    max_form_mm: Annotated[
        float | None, typer.Option(min=0, max=1e6, help="Limit of PF; of PF_section where no places are told.")
    ] = None,
    max_size_mm: Annotated[float | None, typer.Option(min=0, max=1e6, help="Limit of the size of PS.")] = None,
    rule: RuleOption = "conformity",
    remark: Remarks = None,
    config: Settings = None,
    out: Out = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """Probing error of form and size on a ball (PF, PS): profiles or images across it, places told where known."""
    from workbench.accept import BallStandard, accept_ball

    found = _recorded(paths, sensor, step_mm, positions, scp, location, config)
    form = "PF" if found.is_scan else "PF_section"
    limits = _limits((form, max_form_mm), ("PS", max_size_mm))
    standard = BallStandard(diameter_mm, diameter_uncertainty_mm, form_mm)
    with progress_bar("searching", len(found.profiles)) as progress:
        record = accept_ball(found, standard, limits, rule, zone_deg, remark or [], progress)
    _deliver(record, out, report, as_json=as_json)


@app.command()
def spacing(
    paths: Profiles,
    diameter_mm: Annotated[float, typer.Option(min=1e-6, max=1e5, help="The balls' diameter by their certificate.")],
    distance_mm: Annotated[float, typer.Option(min=1e-6, max=1e6, help="Of their centres, by the certificate.")],
    distance_uncertainty_mm: Annotated[
        float | None, typer.Option(min=0, max=1e6, help="Expanded uncertainty (k = 2) of the distance.")
    ] = None,
    diameter_uncertainty_mm: Uncertainty = None,
    form_mm: Form = None,
    sensor: SensorFile = None,
    step_mm: Step = None,
    positions: Positions = None,
    scp: Scp = None,
    location: Location = None,
    zone_deg: Zone = None,
    max_spacing_mm: Annotated[float | None, typer.Option(min=0, max=1e6, help="Limit of the size of SD.")] = None,
    rule: RuleOption = "conformity",
    remark: Remarks = None,
    config: Settings = None,
    out: Out = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """Sphere spacing error (SD) of a ball bar of two like balls, scanned with the places told."""
    from workbench.accept import BallStandard, accept_spacing

    found = _recorded(paths, sensor, step_mm, positions, scp, location, config)
    standard = BallStandard(diameter_mm, diameter_uncertainty_mm, form_mm)
    limits = _limits(("SD", max_spacing_mm))
    with progress_bar("searching", len(found.profiles)) as progress:
        record = accept_spacing(
            found, standard, distance_mm, distance_uncertainty_mm, limits, rule, zone_deg, remark or [], progress
        )
    _deliver(record, out, report, as_json=as_json)


@app.command()
def flatness(
    paths: Profiles,
    form_mm: Annotated[
        float | None, typer.Option(min=0, max=1e3, help="The plane's own flatness by its certificate.")
    ] = None,
    sensor: SensorFile = None,
    step_mm: Step = None,
    positions: Positions = None,
    scp: Scp = None,
    location: Location = None,
    max_flatness_mm: Annotated[
        float | None, typer.Option(min=0, max=1e6, help="Limit of F; of straightness where no places are told.")
    ] = None,
    rule: RuleOption = "conformity",
    remark: Remarks = None,
    config: Settings = None,
    out: Out = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """Flatness error (F) on a plane standard, and straightness within each profile."""
    from workbench.accept import accept_flatness

    found = _recorded(paths, sensor, step_mm, positions, scp, location, config)
    limits = _limits(("F" if found.is_scan else "straightness", max_flatness_mm))
    with progress_bar("searching", len(found.profiles)) as progress:
        record = accept_flatness(found, form_mm, limits, rule, remark or [], progress)
    _deliver(record, out, report, as_json=as_json)


@app.command()
def repeat(
    paths: Annotated[
        list[Path],
        typer.Argument(metavar="TABLE.csv|PROFILES…", help="A table of values; with --feature, profiles or images."),
    ],
    feature: Annotated[
        Literal["plane", "sphere", "edge", "wedge", "gap"] | None,
        typer.Option(help="What stands still before the sensor; without it a table of values is read."),
    ] = None,
    of: Annotated[
        str | None, typer.Option(help="The measurand that is judged, such as height_mm, gap_mm; a table's column.")
    ] = None,
    diameter_mm: Annotated[float | None, typer.Option(min=1e-6, max=1e5, help="Of --feature sphere, if known.")] = None,
    reference_mm: Annotated[
        float | None, typer.Option(min=-1e6, max=1e6, help="The master's value, for bias and Cgk.")
    ] = None,
    tolerance_mm: Annotated[
        float | None, typer.Option(min=1e-9, max=1e6, help="Full width of the tolerance, for Cg and Cgk.")
    ] = None,
    sensor: SensorFile = None,
    max_sigma_mm: Annotated[float | None, typer.Option(min=0, max=1e6, help="Limit of the standard deviation.")] = None,
    max_sigma_z_mm: Annotated[
        float | None, typer.Option(min=0, max=1e6, help="Limit of z's standard deviation, place by place.")
    ] = None,
    min_cg: Annotated[float | None, typer.Option(min=0, max=1e6, help="Limit of Cg.")] = None,
    min_cgk: Annotated[float | None, typer.Option(min=0, max=1e6, help="Limit of Cgk.")] = None,
    rule: RuleOption = "conformity",
    remark: Remarks = None,
    config: Settings = None,
    out: Out = None,
    report: Report = None,
    as_json: AsJson = False,
) -> None:
    """Repeatability of one thing measured again and again, with Cg and Cgk of a master."""
    from geometry import InputError
    from workbench.accept import Limit, accept_repeat, read_series, series_of

    limits = _limits(("sigma", max_sigma_mm), ("sigma_z", max_sigma_z_mm))
    limits += [Limit(n, x, at_most=False) for n, x in (("Cg", min_cg), ("Cgk", min_cgk)) if x is not None]
    if min_cg is not None and tolerance_mm is None:
        raise InputError("--min-cg needs --tolerance-mm: Cg is a share of a tolerance")
    if min_cgk is not None and (tolerance_mm is None or reference_mm is None):
        raise InputError("--min-cgk needs --tolerance-mm and --reference-mm: Cgk counts the bias against the master")
    if feature is None:
        if len(paths) != 1 or sensor is not None or max_sigma_z_mm is not None:
            raise InputError("profiles and images need --feature, what stands still; without it one table is read")
        series, files = [read_series(paths[0], of or "value", say_remark)], tuple(paths)
        profiles: tuple[PlacedProfile, ...] = ()
        notes: list[str] = []
    else:
        from workbench.files import read_settings

        found = _recorded(paths, sensor, None, None, None, None, config)
        panels = read_settings(config or []).gapflush
        with progress_bar("measuring", len(found.profiles)) as progress:
            series, lost = series_of(found, feature, diameter_mm, panels, progress)
        notes = [f"{len(lost)} profiles left out: {lost[0]}"] if lost else []
        profiles, files = found.profiles, found.files
    record = accept_repeat(
        series, files, limits, rule, of=of, reference=reference_mm, tolerance=tolerance_mm, profiles=profiles,
        notes=notes, remarks=remark or [],
    )  # fmt: skip
    _deliver(record, out, report, as_json=as_json)


def _recorded(
    paths: list[Path],
    sensor: Path | None,
    step_mm: float | None,
    positions: Path | None,
    scp: Path | None,
    location: str | None,
    config: list[Path] | None,
) -> Recorded:
    from workbench.accept import ProfileRecording, read_recorded
    from workbench.files import read_settings

    stripe = read_settings(config or []).stripe
    what = ProfileRecording(tuple(paths), sensor, step_mm, positions, scp, location, stripe)
    with progress_bar("reading profiles", 1) as progress:
        return read_recorded(what, say_remark, progress)


def _limits(*asked: tuple[str, float | None]) -> list[Limit]:
    from workbench.accept import Limit

    return [Limit(name, value) for name, value in asked if value is not None]


def _deliver(record: Record, out: Path | None, report: Path | None, *, as_json: bool) -> None:
    """Write and print a record; exit code 1 where it does not pass."""
    from geometry import json_text
    from workbench.accept import record_object, write_record_page
    from workbench.files import write_text

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
    from workbench.accept import shown

    console = standard_output()
    table = Table(title=escape(f"{record.title}\n{record.standard}"), title_justify="left")
    for heading in ("figure", "value", "95 % interval", "unit"):
        table.add_column(heading, justify="left" if heading in ("figure", "unit") else "right")
    for f in record.figures:
        interval = "" if f.bounds is None else f"{shown(f.bounds.low)} … {shown(f.bounds.high)}"
        table.add_row(escape(f.name), shown(f.value), interval, f.unit)
    console.print(table)
    for line in record.not_judged:
        console.print(f"not judged: {line}", markup=False, soft_wrap=True)
    for line in record.notes:
        console.print(f"note: {line}", markup=False, soft_wrap=True)
    console.print(f"verdict: {record.verdict.code}", markup=False)
    console.print(record.verdict.text, markup=False, soft_wrap=True)
