"""Find string points and write them as CSV."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from workbench.cli.console import progress_bar, say_on_stdout, standard_error

if TYPE_CHECKING:
    from extraction import ExtractionConfig
    from workbench.cell import Extracted


def command(
    inputs: Annotated[
        list[Path], typer.Argument(metavar="DATASET|IMAGES", help="A cell dataset, or image files or their folder.")
    ],
    sensor: Annotated[Path | None, typer.Option(help="sensor.toml or preset; needed for bare images.")] = None,
    jig: Annotated[Path | None, typer.Option(help="jig.toml; without it, bare images give unlabelled spots.")] = None,
    csv: Annotated[Path | None, typer.Option(help="File for the points; default: standard output.")] = None,
    overlay: Annotated[Path | None, typer.Option(help="Folder for pictures of what was detected.")] = None,
    stages: Annotated[bool, typer.Option("--stages", help="With --overlay: a picture of every stage too.")] = False,
    config: Annotated[
        list[Path] | None, typer.Option("--config", "--recipe", help="The recipe of all tools, TOML; may be repeated.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Find the string points of stripe images: pixel, surface point, axis point, σ and label of each, as CSV."""
    from geometry import InputError, json_text
    from workbench.cell import extract_inputs, rows
    from workbench.files import points_text, read_settings, write_text

    settings = read_settings(config or [])
    with progress_bar("extracting", len(inputs)) as progress:
        extracted = extract_inputs(inputs, sensor, jig, settings, progress)
    for line in _remarks(extracted):
        standard_error().print(line, soft_wrap=True, markup=False)
    table = rows(extracted.frames, extracted.sensor)
    if overlay is not None:
        _overlays(extracted, overlay, settings.extraction if stages else None)
    elif stages:
        raise InputError("--stages needs --overlay DIR, the folder for its pictures")
    if as_json:
        say_on_stdout(json_text(_as_object(extracted, table)))
    if csv is None:
        if not as_json:
            say_on_stdout(points_text(table).rstrip("\n"))
    else:
        write_text(csv, points_text(table))
        labelled = sum(len(t.axis) for t in extracted.frames)
        spots = sum(len(t.points) for t in extracted.frames)
        standard_error().print(f"{csv}: {labelled} labelled of {spots} spots in {len(extracted.frames)} frames")


def _as_object(extracted: Extracted, table: list[dict[str, object]]) -> dict[str, object]:
    """Frame by frame its points, by the names of the table's columns; what a row does not have is not there."""
    points: dict[object, list[dict[str, object]]] = {frame.number: [] for frame in extracted.frames}
    for row in table:
        points[row["frame"]].append({name: value for name, value in row.items() if name != "frame"})
    frames = [
        {
            "frame": frame.number,
            "image": frame.image,
            "reason": extracted.complaints.get(frame.number) or frame.reason or None,
            "points": points[frame.number],
        }
        for frame in extracted.frames
    ]
    return {"frames": frames, "remarks": list(extracted.remarks)}


def _remarks(extracted: Extracted) -> Iterator[str]:
    yield from (f"remark: {text}" for text in extracted.remarks)
    for frame in extracted.frames:
        if frame.number in extracted.complaints:
            yield f"warning: frame {frame.number}: {extracted.complaints[frame.number]}"
        elif frame.reason:
            what = f"{len(frame.points)} spots ({frame.image or 'points'})"
            yield f"warning: frame {frame.number}: {frame.reason}, {what}"


def _overlays(extracted: Extracted, folder: Path, stages: ExtractionConfig | None) -> None:
    """Write the overlays; ``stages``: the settings whose stages are wanted as well."""
    from workbench.files import read_image
    from workbench.report import save_overlays, save_stages

    with progress_bar("overlays", len(extracted.frames)) as progress:
        for i, frame in enumerate(extracted.frames, start=1):
            path = extracted.paths.get(frame.number)
            if path is not None and frame.number not in extracted.complaints:
                image = read_image(path, extracted.sensor)
                save_overlays(folder, image, extracted.sensor, frame)
                if stages is not None:
                    save_stages(folder, image, extracted.sensor, frame, stages)
            progress(i, len(extracted.frames))
