"""Tune detection on saved stripe images, by hand in the browser or by search."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from workbench.opened import ImageRequest


def command(
    inputs: Annotated[
        list[Path], typer.Argument(metavar="IMAGES|DATASET", help="A cell dataset, or image files or their folder.")
    ],
    sensor: Annotated[Path | None, typer.Option(help="sensor.toml; needed for bare images.")] = None,
    jig: Annotated[Path | None, typer.Option(help="jig.toml; without it, bare images give unlabelled spots.")] = None,
    config: Annotated[list[Path] | None, typer.Option(help="Settings TOML to start from.")] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for saved settings and the search; default: the opened folder.")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0 takes a free one.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    watch: Annotated[bool, typer.Option("--watch", help="Take in images as they come into the folder.")] = False,
    auto: Annotated[int | None, typer.Option(min=1, help="Search the parameters in this many trials instead.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search and of its split.")] = 0,
) -> None:
    """Tune detection on saved stripe images: the process window in the browser, or a search with --auto."""
    from workbench.opened import ImageRequest

    request = ImageRequest(tuple(inputs), sensor, jig, tuple(config or ()), out, watch)
    if auto is not None:
        from workbench.cli.tune_auto import run_auto

        run_auto(request, auto, seed)
        return
    _serve(request, port, browser)


def _serve(request: ImageRequest, port: int, browser: bool) -> None:
    from workbench.cli.console import say_on_stdout
    from workbench.window import open_session
    from workbench.window.serve import serve

    def announce(address: str) -> None:
        say_on_stdout(f"process window: {address}  (Ctrl+C ends it)")
        sys.stdout.flush()

    serve(open_session(request), port, browser, announce)
