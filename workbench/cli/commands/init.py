"""Write a starter dataset."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from workbench import defaults
from workbench.cli.console import say_remark, standard_error


def command(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="A new or empty folder.")] = Path("cell"),
    robot: Annotated[str, typer.Option(help="robot.toml or preset.")] = defaults.ROBOT,
    sensor: Annotated[str, typer.Option(help="sensor.toml or preset.")] = defaults.SENSOR,
    jig: Annotated[str, typer.Option(help="jig.toml or preset.")] = defaults.JIG,
    target: Annotated[
        str | None, typer.Option(help="In place of the jig: sphere, balls, plane, edge, wedge or a target.toml.")
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
    if target is None:
        _say_whether_seen(folder)
    profiles = " --profiles csv" if measured == "profiles" else ""
    say_remark(
        f"{folder}: fill frames.csv and {measured}/, then see what is missing: perceptron-emu doctor {folder}; "
        f"or emulate a recording: perceptron-emu render {folder} --out recording{profiles}"
    )


def _say_whether_seen(folder: Path) -> None:
    """A remark where the sensor can not see the jig whole: nobody should build it first."""
    from geometry import InputError
    from workbench.files import read_cell
    from workbench.plan import plan_limits, seen_whole

    cell = read_cell(folder, recorded=False)
    try:
        whole = seen_whole(cell.sensor, cell.jig, plan_limits())
    except InputError:  # a profile sensor that states no field of view: nothing is known
        return
    if not whole.fits:
        say_remark(whole.sentence(cell.sensor, cell.jig))
