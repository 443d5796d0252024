"""From pictures to numbers: the board and the stripe of every view."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.sensor import BoardView, Corners, StripePoints
from extraction.board import (
    BoardCorners,
    NoBoard,
    board_counts,
    find_board,
    room_light_in_both,
    second_stripe,
    stripe_on_board,
)
from geometry import Board, InputError, Sensor
from workbench.files import Image, ViewFiles, picture_sensor, read_image

FULL_SHARE = 0.28  # of a board's pixels at full level: its white squares are flooded, corners and stripe with them
BLOWN_SHARE = 0.5  # of a picture's pixels at full level, in which no board is found
SOFT_BLUR_PX = 3.0  # Gaussian σ of an edge beyond which a board is out of focus
SOFT_SHARE = 0.15  # the same, of the distance of neighbours: hardly an edge is whole within a corner's window
SOFT_TIMES, SOFT_LEAST_PX = 2.5, 1.5  # the same, of the sharpest view's: that board stood beyond the depth of field
SECOND_SHARE = 0.3  # of the stripe's points, as many of a second one: worth a word
COUNTED = 3  # pictures by which a board is said to be counted wrongly: one may show another
ALONE = 3  # pictures or views of which the same is said, up to which each has its own sentence
MOVED_PX = 0.5  # of a corner between the two pictures of a view, beside five of its σ
FLOODED = "board and stripe are both saturated, with laser on and off: nothing is left to measure; expose shorter"
BLOWN = (
    "the board's white squares are saturated with the laser off: its corners may be off; expose that picture shorter"
)


@dataclass(frozen=True, eq=False)
class BoardFolder:
    """The views of a folder as numbers, and what was seen on the way.

    lost: (name, why) of views without a board.
    """

    sensor: Sensor
    board: Board
    views: tuple[BoardView, ...]
    lost: tuple[tuple[str, str], ...]
    remarks: tuple[str, ...]
    pictures: dict[str, Image]


def read_recording(
    files: Sequence[ViewFiles],
    board: Board,
    channel: str | None = None,
    progress: Callable[[int, int], None] = lambda done, of: None,
) -> BoardFolder:
    """Find board and stripe in every view.

    Parameters
    ----------
    files
        As `find_views` gives them.
    board
        What was recorded.
    channel
        Of colour pictures; the largest of the channels where None.
    progress
        Told how many of how many views are done.

    Returns
    -------
    BoardFolder
        Views with a board; those without are named with the reason.

    Raises
    ------
    InputError
        Where a file can not be read, or pictures differ in size or depth.

    """
    paths = tuple(dict.fromkeys(p for f in files for p in (f.board, f.stripe) if p is not None))
    sensor = picture_sensor(paths, channel)
    said: list[str] = []
    _check_counts(files, sensor, board)
    views, lost, pictures, blur = [], [], {}, {}
    for i, file in enumerate(files):
        image = read_image(file.board, sensor, said.append, lossy=True)
        lit = image
        if file.stripe is not None and file.stripe != file.board:
            lit = read_image(file.stripe, sensor, said.append, lossy=True)
        found = find_board(image, board)
        if isinstance(found, NoBoard):
            full = _full_share(image)
            bright = f"; {100 * full:.0f} % of the picture are saturated: expose shorter" if full > BLOWN_SHARE else ""
            lost.append((file.name, found.reason + bright))
        else:
            view, more = _view(file, board, image, lit, found)
            said += more
            views.append(view)
            pictures[file.name] = image
            blur[file.name] = found.blur_px
        progress(i + 1, len(files))
    soft, sentences = _out_of_focus(views, blur)
    said += sentences
    views = [replace(v, soft=v.name in soft) for v in views]
    said += _never_whole(views, board)
    unseen = {name for name, _ in lost}
    if len(unseen) > len(views):
        first = next(f for f in files if f.name in unseen)
        said += _other_counts(read_image(first.board, sensor, lossy=True), board)
    return BoardFolder(sensor, board, tuple(views), tuple(lost), tuple(_together(dict.fromkeys(said))), pictures)


def _out_of_focus(views: Sequence[BoardView], blur_px: Mapping[str, float]) -> tuple[set[str], list[str]]:
    """The names of the views whose boards are out of focus, and what is said of them."""
    from scipy.spatial import cKDTree  # a tenth of a second, and a dataset with its sensor needs none of it

    sharpest = min(blur_px.values(), default=0.0)
    soft, beyond = list[str](), False
    for v in views:
        blur = blur_px[v.name]
        pitch = float(np.median(cKDTree(v.corners.uv_px).query(v.corners.uv_px, k=2)[0][:, 1]))
        far = blur > max(SOFT_TIMES * sharpest, SOFT_LEAST_PX)
        if far or blur > SOFT_BLUR_PX or blur > SOFT_SHARE * pitch:
            soft, beyond = [*soft, v.name], beyond or far
    against = f"; the sharpest view's by {sharpest:.1f} px" if beyond else ""
    alone = [[name] for name in soft] if len(soft) <= ALONE else [soft]
    said = []
    for names in alone:
        low, high = (f"{f(blur_px[n] for n in names):.1f}" for f in (min, max))
        what = "the board is" if len(names) == 1 else "boards are"
        px = low if low == high else f"{low} to {high}"
        said.append(
            f"{', '.join(names)}: {what} out of focus (edges blurred by {px} px{against}): stop down, or keep the "
            "board within the depth of field"
        )
    return set(soft), said


def _together(said: Iterable[str]) -> list[str]:
    """Sentences "NAME: what", those that say the same of many names as one."""
    names: dict[str, list[str]] = {}
    for sentence in said:
        name, _, what = sentence.partition(": ")
        names.setdefault(what or sentence, []).append(name if what else "")
    out = []
    for what, of in names.items():
        if len(of) > ALONE:
            out.append(f"{of[0]} and {len(of) - 1} more: {what}")
        else:
            out += [f"{name}: {what}" if name else what for name in of]
    return out


def _never_whole(views: Sequence[BoardView], board: Board) -> list[str]:
    """Whether every view shows one smaller grid of a checkerboard than is stated: it is counted wrongly, or hidden."""
    if board.kind != "checkerboard" or len(views) < 2:
        return []
    seen = {tuple(sorted((np.ptp(v.corners.xy_mm, axis=0) / board.pitch_mm).round().astype(int) + 1)) for v in views}
    if len(seen) > 1 or seen == {tuple(sorted((board.columns, board.rows)))}:
        return []
    short, long = seen.pop()
    return [
        f"every view shows {long} × {short} inner corners, board.toml says {board.columns} × {board.rows}: are they "
        "counted right (between squares, not the squares)? The calibration itself does not hang on their number"
    ]


def _view(file: ViewFiles, board: Board, image: Image, lit: Image, found: BoardCorners) -> tuple[BoardView, list[str]]:
    corners = Corners(found.xy_mm, found.uv_px, found.covariance_px2)
    bare = BoardView(file.name, corners, StripePoints.nothing(), axes=found.axes, named=found.named)
    said = list[str]()
    single = file.stripe == file.board
    flooded = _flooded(image, found)
    if file.stripe is not None and flooded and (single or _flooded(lit, found)):
        return bare, [*said, f"{file.name}: {FLOODED}"]
    if flooded:
        said.append(f"{file.name}: {BLOWN}")
    if file.stripe is None:
        return bare, said
    if not single and room_light_in_both(lit, image, board, found):
        moved = _moved(lit, board, found)
        if moved is not None:
            text = f"{file.name}: the board moved by {moved:.1f} px between laser off and on: its stripe is left out"
            return bare, [*said, text]
    off = None if single else image
    peaks = stripe_on_board(lit, off, board, found)
    if single and not len(peaks):
        said.append(
            f"{file.name}: no stripe stands out from the print in a single picture: take two of every pose, with the "
            "laser off and on"
        )
    if off is not None and second_stripe(lit, off, board, found, peaks) > SECOND_SHARE:
        said.append(
            f"{file.name}: a second stripe stands beside the one that is used (the laser's reflection?): the brighter "
            "one is used; cover what shines"
        )
    return replace(bare, stripe=StripePoints(peaks.uv_px, peaks.normal, peaks.sigma_px)), said


def _flooded(image: Image, found: BoardCorners) -> bool:
    """Whether the bright squares of a board are at full level."""
    low, high = np.floor(found.uv_px.min(axis=0)).astype(int), np.ceil(found.uv_px.max(axis=0)).astype(int) + 1
    return _full_share(image[max(low[1], 0) : high[1], max(low[0], 0) : high[0]]) > FULL_SHARE


def _full_share(image: Image) -> float:
    """Share of the pixels at full level: of 8 bits 255, else the highest there is."""
    if not image.size:
        return 0.0
    full = 255 if image.dtype == np.uint8 else int(image.max())
    return float((image >= full).mean())


def _moved(lit: Image, board: Board, found: BoardCorners) -> float | None:
    """How far [px] the corners stand elsewhere in the picture with the stripe; None where they do not."""
    again = find_board(lit, board)
    if isinstance(again, NoBoard):
        return None
    distance = np.linalg.norm(again.uv_px[:, None] - found.uv_px[None], axis=-1)
    nearest = min((distance.min(axis=i) for i in (0, 1)), key=np.median)  # one of them may show a part only
    sigma = np.sqrt(np.median(np.trace(found.covariance_px2, axis1=1, axis2=2)))
    shift = float(np.median(nearest))
    return shift if shift > MOVED_PX + 5 * sigma else None


def _check_counts(files: Sequence[ViewFiles], sensor: Sensor, board: Board) -> None:
    """InputError where the first pictures all show a checkerboard of other counts, and none the one that is stated.

    One that lacks a row or a column may be the stated one, hidden in part: it is found, and said.
    """
    if board.kind != "checkerboard" or len(files) < COUNTED:
        return
    seen = {board_counts(read_image(file.board, sensor, lossy=True)) for file in files[:COUNTED]}
    counts = seen.pop()
    if seen or counts is None or _may_be(counts, board) or _may_be(counts[::-1], board):
        return
    raise InputError(f"the first {COUNTED} pictures show {_counted_wrongly(counts, board)}")


def _may_be(counts: tuple[int, int], board: Board) -> bool:
    """Whether a board of these counts may be the stated one, a row or a column of it hidden."""
    return all(0 <= a - b <= 1 for a, b in zip((board.columns, board.rows), counts, strict=True))


def _counted_wrongly(counts: tuple[int, int], board: Board) -> str:
    return (
        f"a board of {max(counts)} × {min(counts)} inner corners where board.toml says {board.columns} × {board.rows}: "
        "count the corners between squares, not the squares"
    )


def _other_counts(image: Image, board: Board) -> list[str]:
    """Whether a board of other counts is seen where the stated one is not."""
    counts = board_counts(image) if board.kind == "checkerboard" else None
    if counts is None or sorted(counts) == sorted((board.columns, board.rows)):
        return []
    return [f"a picture shows {_counted_wrongly(counts, board)}"]
