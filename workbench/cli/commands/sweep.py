"""Run a campaign of many pixel-to-transform trials."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated

import typer

from workbench.cli.console import progress_bar, say_on_stdout, standard_output


def command(
    plan: Annotated[Path, typer.Argument(metavar="PLAN.toml", help="The plan of the campaign.")],
    out: Annotated[Path | None, typer.Option(help="Folder of the run; default: the plan's name without .toml.")] = None,
    workers: Annotated[int | None, typer.Option(min=1, help="Processes on this machine; default: all cores.")] = None,
    dask: Annotated[
        str | None, typer.Option(help="Address of a Dask scheduler, tcp://…, in place of processes.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Run the plan's trials: render, extract, calibrate, a row each. The same command goes on where it was stopped."""
    from workbench.campaign import read_plan, run_campaign

    checked = read_plan(plan)
    folder = out or plan.with_suffix("")
    try:
        with progress_bar("trials", 0, rate=True, quiet=as_json) as progress:
            summary = run_campaign(checked, folder, workers, dask, progress)
    except KeyboardInterrupt as error:
        raise typer.Abort(str(error)) from None
    if as_json:
        say_on_stdout(json.dumps({"folder": str(summary.folder), "trials": summary.trials, "resumed": summary.resumed}))
        return
    standard_output().print(
        f"{summary.trials} trials in {summary.folder} (trials.parquet, frames.parquet, timings.parquet); "
        f"`perceptron-emu report {summary.folder}` makes a page of them."
    )
