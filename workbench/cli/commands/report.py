"""Make one HTML page of a campaign."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workbench.cli.console import standard_output


def command(
    run: Annotated[Path, typer.Argument(help="Folder of a finished run of `sweep`.")],
    out: Annotated[Path | None, typer.Option(help="The page; default: report.html in the run's folder.")] = None,
    target_mm: Annotated[float, typer.Option(min=1e-6, max=1000, help="SCP translation error asked for \\[mm].")] = 0.1,
    target_deg: Annotated[float, typer.Option(min=1e-6, max=180, help="SCP rotation error asked for \\[deg].")] = 0.03,
    level: Annotated[float, typer.Option(min=0.5, max=0.999, help="Share of trials that must reach it.")] = 0.95,
) -> None:
    """Write a page: SCP error against every factor, whether σ is true, verdicts, worst trials, and what to do."""
    from workbench.campaign import AskedAccuracy, write_page

    path = write_page(run, AskedAccuracy(target_mm, target_deg, level), out)
    standard_output().print(f"{path}")
