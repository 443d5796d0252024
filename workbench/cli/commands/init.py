"""Write a starter dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workbench import defaults
from workbench.cli.console import say_remark, standard_error


def command(
    folder: Annotated[Path, typer.Argument(help="A new or empty folder.")] = Path("cell"),
    robot: Annotated[str, typer.Option(help="robot.toml or preset.")] = defaults.ROBOT,
    sensor: Annotated[str, typer.Option(help="sensor.toml or preset.")] = defaults.SENSOR,
    jig: Annotated[str, typer.Option(help="jig.toml or preset.")] = defaults.JIG,
    target: Annotated[
        str | None, typer.Option(help="sphere, balls, plane, edge, wedge or a target.toml, in place of the jig.")
    ] = None,
    presets: Annotated[bool, typer.Option("--list", help="List the presets and write nothing.")] = False,
) -> None:
    """Write a commented starter dataset from presets: fill it with a recording, or render it."""
    import assets
    from workbench.cell import write_starter

    if presets:
        for kind in ("robots", "sensors", "jigs"):
            standard_error().print(f"{kind}: {', '.join(assets.list_presets(kind))}", markup=False, soft_wrap=True)
        return
    measured = write_starter(folder, robot, sensor, jig, target)
    profiles = " --profiles csv" if measured == "profiles" else ""
    say_remark(
        f"{folder}: fill frames.csv and {measured}/, then see what is missing: perceptron-emu doctor {folder}; "
        f"or emulate a recording: perceptron-emu render {folder} --out recording{profiles}"
    )
