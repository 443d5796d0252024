"""Make one HTML page of a campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workbench.cli.console import progress_bar, say_on_stdout, standard_output


def command(
    run: Annotated[Path, typer.Argument(metavar="RUN", help="Folder of a finished run of `sweep`.")],
    out: Annotated[Path | None, typer.Option(help="The page; default: report.html in the run's folder.")] = None,
    target_mm: Annotated[float, typer.Option(min=1e-6, max=1000, help="SCP translation error asked for \\[mm].")] = 0.1,
    target_deg: Annotated[float, typer.Option(min=1e-6, max=180, help="SCP rotation error asked for \\[deg].")] = 0.03,
    level: Annotated[float, typer.Option(min=0.5, max=0.999, help="Share of trials that must reach it.")] = 0.95,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Write a page: SCP error against every factor, whether σ is true, verdicts, worst trials, and what to do."""
    from geometry import json_text
    from workbench.campaign import AskedAccuracy, read_run, run_object, write_page

    target = AskedAccuracy(target_mm, target_deg, level)
    with progress_bar("page", 1, quiet=as_json):
        path = write_page(run, target, out)
    if as_json:
        say_on_stdout(json_text({"page": str(path)} | run_object(read_run(run), target)))
    else:
        standard_output().print(f"{path}", markup=False, soft_wrap=True)
