"""The paper's experiment in emulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workbench.cli import exit_codes
from workbench.cli.console import progress_bar, say_on_stdout, standard_error, standard_output


def command(
    out: Annotated[Path, typer.Option(help="Folder for the dataset and the results.")] = Path("demo"),
    seed: Annotated[int, typer.Option(min=0, help="Which robot, jig and noise are drawn.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Run the paper's experiment in emulation: 28 images of a string jig at four places, extracted and calibrated.

    The sensor is mounted as Table 1's calibrated row says, the solution starts from its design row, the arm and the jig
    have errors of the usual size. The dataset in the folder is one like any other, with truth.json beside it.
    """
    from geometry import json_text
    from workbench.demo import print_demo, run_demo
    from workbench.files import Settings
    from workbench.report import calibration_object

    demo = run_demo(out, seed, Settings(), progress_bar)
    if demo.remark:
        standard_error().print(demo.remark, markup=False, soft_wrap=True)
    if as_json:
        say_on_stdout(json_text(calibration_object(demo.result, demo.observed.complaints, demo.cell)))
    elif demo.cell.truth is not None:
        print_demo(standard_output(), demo.result, demo.cell.truth, out)
    if not demo.result.verdict.trustworthy:
        standard_error().print("no trustworthy answer")
        raise typer.Exit(exit_codes.NO_ANSWER)
