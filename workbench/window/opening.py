"""Open what the user named as a window session: a cell dataset, bare images, profiles, or pictures of a board."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from dataclasses import replace

from workbench.files import parse_settings, settings_toml
from workbench.opened import NO_CHAIN, ImageRequest, ImageSet, open_images
from workbench.window.boards import Boards
from workbench.window.calibrator import Calibrator, Search
from workbench.window.detector import Detector
from workbench.window.session import Opened

MakeSearch = Callable[[ImageSet], Search]


def open_session(request: ImageRequest, make_search: MakeSearch | None = None) -> Opened:
    """The session of what the command line, or the page, named.

    Parameters
    ----------
    request
        A dataset (folder with cell.toml, or that file), images, profiles, or a folder with board.toml.
    make_search
        Gives the search for parameters in what was opened; None: the page offers none.

    Returns
    -------
    Opened

    Raises
    ------
    InputError
        Saying what is missing.

    """
    images = open_images(request)
    dataset = images.cell is not None
    boards = None
    if images.board is not None:
        boards = Boards(images.board, images.board_of or {}, images.pictures.read)
    can_search = make_search is not None and images.has_images and boards is None and bool(images.labeller.strings)
    return Opened(
        title=images.title,
        pictures=images.pictures,
        engine=Detector(images.labeller, boards=boards, plane_known=images.plane_known),
        frames=images.images,
        truth=images.truth,
        start=images.recipe,
        skipped=images.skipped,
        plane_known=images.plane_known,
        settings_folder=images.folder,
        to_toml=settings_toml,
        from_toml=parse_settings,
        command=_command(request, images),
        calibrator=Calibrator(images) if dataset else None,
        no_calibration="" if dataset else NO_CHAIN,
        prepare=images.learn_chain if dataset else None,
        look=images.watched.look if images.watched is not None else None,
        search=make_search(images) if make_search is not None and can_search else None,
        reopen=lambda other: open_session(replace(other, out=request.out), make_search),
    )


def _command(request: ImageRequest, images: ImageSet) -> Callable[[str, str], str]:
    """The command line that measures the same, given the recipe file's name and what is looked for."""

    def command(name: str, what: str) -> str:
        first = request.inputs[0]
        base = request.out or (first if first.is_dir() else first.parent)
        named = list(map(str, request.inputs))
        if images.board is not None:
            board = request.board or first / "board.toml"
            parts = ["perceptron-emu", "calibrate-sensor", *named, "--board", str(board)]
            return shlex.join([*parts, "--out", "sensor.toml"])
        cell = images.cell
        strings = what == "strings"
        if not strings and cell is not None:
            return shlex.join(["perceptron-emu", "calibrate", *named, "--recipe", str(base / name), "--json"])
        parts = ["perceptron-emu", "extract" if strings else "profile", *named]
        options = [("--sensor", request.sensor)] + ([("--jig", request.jig)] if strings else [])
        for option, path in options:
            parts += [option, str(path)] if path else []
        parts += ["--recipe", str(base / name), "--csv", "points.csv" if strings else "points"]
        return shlex.join(parts)

    return command
