"""A sensor's twin from its own images."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from workbench.cli.console import progress_bar, say_on_stdout, say_remark, standard_error, standard_output


def command(
    folder: Annotated[
        Path, typer.Argument(metavar="DATASET|IMAGES", help="A dataset, or a folder of stripe images: PNG, TIFF, BMP.")
    ],
    sensor: Annotated[
        Path, typer.Option(help="sensor.toml of these images: its geometry stands, its light is fitted.")
    ],
    out: Annotated[Path, typer.Option(help="File for the twin, a sensor.toml.")],
    seed: Annotated[int, typer.Option(min=0, help="Of the emulated images.")] = 0,
    report: Annotated[Path | None, typer.Option(help="HTML page: recorded and emulated side by side.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Fit the emulation keys of a sensor to its recorded stripe images, with σ, and show what still differs."""
    from geometry import json_text
    from workbench.files import read_emulator, read_image, read_sensor
    from workbench.twin import find_images, fit_twin, twin_object, write_twin

    model, emulator = read_sensor(sensor), read_emulator(sensor)
    model.require_camera()
    images = [(p.name, read_image(p, model, say_remark)) for p in find_images(folder)]
    with progress_bar("fitting", 1) as progress:
        twin = fit_twin(images, model, emulator, seed, progress)
    write_twin(twin, out, report)
    if twin.clipped:
        say_remark(
            f"{folder}: most points of the stripes have saturated pixels, so width and flanks alone tell power, waist "
            f"and blur; record with a shorter exposure for a twin that knows more"
        )
    answer = twin_object(twin)
    if as_json:
        say_on_stdout(json_text(answer))
        return
    table = Table("key", "value", "σ", "told by the images", title=f"twin of {folder}", title_justify="left")
    for key in twin.keys:
        name = f"\\[{key.table}] {key.name}"
        table.add_row(name, f"{key.value:.4g}", f"{key.sigma:.2g}", f"{100 * key.told:.0f} %")
    standard_output().print(table)
    shown = ", ".join(f"{name} {value:.2f}" for name, value in answer["distances"].items())
    standard_error().print(f"two-sample distances: {shown}; {out} written", soft_wrap=True, markup=False)
