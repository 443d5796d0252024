"""Validate point extraction against truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.table import Table

from workbench import defaults
from workbench.cli import exit_codes
from workbench.cli.console import progress_bar, say_on_stdout, standard_error, standard_output

if TYPE_CHECKING:
    from workbench.report import Origin


def command(
    dataset: Annotated[
        Path | None,
        typer.Argument(metavar="DATASET", help="A dataset with truth.json; without it, frames are rendered."),
    ] = None,
    sensor: Annotated[str, typer.Option(help="sensor.toml or preset of the frames to render.")] = defaults.SENSOR,
    jig: Annotated[str, typer.Option(help="jig.toml or preset of the frames to render.")] = defaults.JIG,
    twin: Annotated[
        Path | None, typer.Option(help="A sensor's twin, as `twin` wrote it: its frames in place of --sensor's.")
    ] = None,
    frames: Annotated[
        int, typer.Option(min=2, max=100_000, help="Frames as the files say; as many again under varied conditions.")
    ] = 60,
    draw_sensor: Annotated[
        int | None,
        typer.Option(
            min=0,
            max=10_000,
            help=f"Sensors drawn from the file's \\[uncertainty]; default: {defaults.DRAWN_SENSORS}, where it has one.",
        ),
    ] = None,
    seed: Annotated[int, typer.Option(min=0, help="Same seed, same frames.")] = 0,
    config: Annotated[
        list[Path] | None, typer.Option("--config", "--recipe", help="The recipe of all tools, TOML; may be repeated.")
    ] = None,
    thresholds: Annotated[
        Path | None, typer.Option(help="TOML of thresholds, such as min_detection_rate; exit code 1 where one fails.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder of report.html, result.json, strings.csv, frames.csv.")] = Path(
        "validation"
    ),
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Measure point extraction against truth: detection, false points, labels, bias, scatter, honest σ, the bound."""
    from geometry import InputError
    from workbench.files import read_settings, settings_text
    from workbench.validate import (
        WORDS,
        Thresholds,
        failures,
        figures,
        in_words,
        read_thresholds,
        validate_dataset,
        validate_drawn,
        write_pages,
    )

    if twin is not None:
        if dataset is not None:
            raise InputError(
                f"{dataset} and --twin {twin}: frames are either recorded or rendered of the twin; give one"
            )
        sensor = _of_a_twin(twin)
    if dataset is not None and draw_sensor:
        raise InputError(f"{dataset} is recorded: --draw-sensor draws sensors for frames that are rendered")
    settings = read_settings(config or [])
    limits = read_thresholds(thresholds) if thresholds is not None else Thresholds()
    with progress_bar("validating", 1) as progress:
        if dataset is not None:
            validation = validate_dataset(dataset, settings, progress)
        else:
            validation = validate_drawn(
                sensor, jig, frames, seed, settings, progress, draw_sensor, stripe=twin is not None
            )
    result = figures(validation.measured)
    failed = failures(result, limits)
    about = _origin(dataset, settings_text(settings), None if thresholds is None else not failed)
    write_pages(out, validation.measured, result, limits, failed, validation.worst, about)
    if as_json:
        say_on_stdout((out / "result.json").read_text(encoding="utf-8").rstrip("\n"))
    else:
        _show(result, WORDS)
        standard_output().print(in_words(result), soft_wrap=True, markup=False)
        standard_error().print(f"{out / 'report.html'} written", markup=False)
    for failure in failed:
        shown = "none" if failure.value is None else f"{failure.value:.5g}"
        standard_error().print(f"threshold {failure.key} = {failure.limit:g} not held: {shown}", markup=False)
    if failed:
        raise typer.Exit(exit_codes.THRESHOLD)


def _origin(dataset: Path | None, settings: str, passed: bool | None) -> Origin:
    """What the record is of: the dataset's files, or frames that were rendered for it."""
    from workbench.files import read_cell
    from workbench.report import origin_of

    if dataset is None:
        return replace(origin_of((), Path(), settings, passed), dataset="frames rendered for this record")
    cell = read_cell(dataset)
    images = [cell.folder / (f.image or f.profile) for f in cell.frames if f.image or f.profile]
    return origin_of([*cell.files, *images], cell.folder, settings, passed)


def _of_a_twin(path: Path) -> str:
    """The sensor file of a twin, refused where it states no light: any sensor file would be emulated by defaults."""
    from geometry import InputError
    from workbench.files import read_emulator

    if not read_emulator(path).speckle.model_fields_set:
        raise InputError(
            f"{path} is no twin: it states no [speckle]; make one by `perceptron-emu twin FOLDER --sensor`"
        )
    return str(path)


def _show(result: dict[str, float | None], words: dict[str, str]) -> None:
    table = Table(title="extraction against truth, nominal conditions", title_justify="left", show_header=False)
    for key, value in result.items():
        if value is None:
            shown = "–"
        elif key in ("frames", "points", "too_faint", "sensors", "stripe_points"):
            shown = f"{value:.0f}"
        else:
            shown = f"{100 * value:.2f} %" if key.endswith("_rate") else f"{value:.4f}"
        table.add_row(words[key].replace("[", "\\["), shown)
    standard_output().print(table)
