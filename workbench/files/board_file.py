"""board.toml (docs/formats.md): the calibration board that was recorded."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Literal

from geometry import Board, InputError
from workbench.files.strict import FileSection, NotNegative, Positive, Text, Whole, validate
from workbench.files.toml_text import read_toml


class BoardFile(FileSection):
    """board.toml."""

    kind: Literal["checkerboard", "circles", "asymmetric_circles", "charuco"]
    corners: tuple[Whole, Whole] | None = None
    square_mm: Positive | None = None
    pitch_mm: Positive | None = None
    squares: tuple[Whole, Whole] | None = None
    marker_mm: Positive | None = None
    dictionary: Text | None = None
    sigma_flat_mm: NotNegative | None = None
    sigma_print_mm: NotNegative | None = None


SHAPE_KEYS = ("sigma_flat_mm", "sigma_print_mm")  # of every kind, and none is needed
KEYS = {
    "checkerboard": ("corners", "square_mm"),
    "circles": ("corners", "pitch_mm"),
    "asymmetric_circles": ("corners", "pitch_mm"),
    "charuco": ("squares", "square_mm", "marker_mm", "dictionary"),
}


def read_board(path: Path) -> Board:
    """The board of a board.toml.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Board
        What is printed on it.

    Raises
    ------
    InputError
        Naming file and key.

    """
    file = validate(BoardFile, read_toml(path))
    given = file.model_dump(exclude_none=True, exclude={"kind", "name"})
    wanted = KEYS[file.kind]
    for key in wanted:
        if key not in given:
            raise InputError(f'{path}: the key {key} is missing; kind = "{file.kind}" has {", ".join(wanted)}')
    for key in given:
        if key not in (*wanted, *SHAPE_KEYS):
            raise InputError(f'{path}: {key} is no key of kind = "{file.kind}", which has {", ".join(wanted)}')
    try:
        return replace(_board(file), sigma_flat_mm=file.sigma_flat_mm, sigma_print_mm=file.sigma_print_mm)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _board(file: BoardFile) -> Board:
    if file.kind == "charuco":
        columns, rows = file.squares or (0, 0)
        marker, names = file.marker_mm or 0.0, file.dictionary or ""
        return Board("charuco", columns - 1, rows - 1, file.square_mm or 0.0, marker, names)
    columns, rows = file.corners or (0, 0)
    return Board(file.kind, columns, rows, file.square_mm or file.pitch_mm or 0.0)


def board_text(board: Board) -> str:
    """A board as the text of a board.toml."""
    lines = [f'kind = "{board.kind}"']
    if board.kind == "charuco":
        lines += [f"squares = [{board.columns + 1}, {board.rows + 1}]", f"square_mm = {board.pitch_mm!r}"]
        lines += [f"marker_mm = {board.marker_mm!r}", f'dictionary = "{board.dictionary}"']
    else:
        size = "square_mm" if board.kind == "checkerboard" else "pitch_mm"
        lines += [f"corners = [{board.columns}, {board.rows}]", f"{size} = {board.pitch_mm!r}"]
    known = {key: getattr(board, key) for key in SHAPE_KEYS}
    lines += [f"{key} = {value!r}" for key, value in known.items() if value is not None]
    return "\n".join(lines) + "\n"
