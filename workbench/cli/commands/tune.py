"""Tune detection on saved stripe images, by hand in the browser or by search."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

if TYPE_CHECKING:
    from collections.abc import Callable

    from workbench.files import Recipe
    from workbench.opened import ImageRequest, ImageSet
    from workbench.window import Opened, Search

What = Literal["strings", "stripe"]


def command(
    inputs: Annotated[
        list[Path],
        typer.Argument(metavar="DATASET|IMAGES", help="A cell dataset, image or profile files, or their folder."),
    ],
    sensor: Annotated[
        Path | None, typer.Option(help="sensor.toml or preset of bare images; without it they are looked at in px.")
    ] = None,
    jig: Annotated[
        Path | None, typer.Option(help="jig.toml of bare images; without it their stripe is measured.")
    ] = None,
    config: Annotated[
        list[Path] | None, typer.Option("--config", "--recipe", help="The recipe to start from, TOML.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for saved settings and the search; default: the opened folder.")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="Port on 127.0.0.1; 0 takes a free one.")] = 0,
    browser: Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")] = True,
    what: Annotated[
        What | None, typer.Option(help="What is looked for; default: strings with a jig, else the stripe.")
    ] = None,
    board: Annotated[Path | None, typer.Option(help="board.toml: the pictures are of a calibration board.")] = None,
    watch: Annotated[bool, typer.Option("--watch", help="Take in images as they come into the folder.")] = False,
    auto: Annotated[int | None, typer.Option(min=1, help="Search the parameters in this many trials instead.")] = None,
    seed: Annotated[int, typer.Option(min=0, help="Seed of the search and of its split.")] = 0,
    as_json: Annotated[
        bool, typer.Option("--json", help="With --auto: print one JSON object on standard output.")
    ] = False,
) -> None:
    """Tune detection on saved stripe images: the process window in the browser, or a search with --auto."""

    def request() -> ImageRequest:
        from workbench.opened import ImageRequest

        return ImageRequest(tuple(inputs), sensor, jig, tuple(config or ()), out, watch, what, board)

    if auto is not None:
        from workbench.cli.tune_auto import run_auto

        run_auto(request(), auto, seed, as_json=as_json)
        return
    if as_json:
        from geometry import InputError

        raise InputError("--json needs --auto: the process window shows its numbers in the browser")
    missing = next((path for path in inputs if not path.exists()), None)
    if missing is not None:
        from geometry import InputError

        raise InputError(f"{missing}: no such file or folder")
    _serve(request, port, browser)


def _search(images: ImageSet) -> Search:
    """The search of the page, without its library until it is asked for."""

    def run(recipe: Recipe, trials: int, progress: Callable[[int, int, float], None]) -> dict[str, Any]:
        from workbench.cli.tune_auto import page_search

        return page_search(images)(recipe, trials, progress)

    return run


def _serve(make_request: Callable[[], ImageRequest], port: int, browser: bool) -> None:
    """The page is up before what measures is imported."""
    from workbench.window.serve import serve

    def announce(address: str) -> None:
        sys.stdout.write(f"process window: {address}  (Ctrl+C ends it)\n")
        sys.stdout.flush()

    def opened() -> Opened:
        from workbench.window import open_session

        return open_session(make_request(), _search)

    serve(opened, port, browser, announce)
