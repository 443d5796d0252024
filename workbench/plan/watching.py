"""A dataset that grows: with each new image or profile and row of frames.csv the answer and the best next pose.

A file that is being written is never read: what belongs to a round has kept its size and its time for a while, and
frames.csv ends with a whole line. Rows whose image or profile is not there yet wait for it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib import CalibConfig, CalibrationResult
from calib.judge import FEWEST_LEFT_OUT
from extraction import ExtractionConfig
from geometry import Frame, InputError, NoAnswerError, Pose, Surface
from workbench.cell import Observed, observe, solve
from workbench.files import Cell, read_cell
from workbench.plan.choose import LEVER_MM, size_mm
from workbench.plan.next_view import next_views
from workbench.plan.proposal import plan_limits, propose

Array = NDArray[np.float64]

_SIGMAS = 2.0  # of what was asked for, by which a part left out may move the answer: 95 % of what its own noise does


@dataclass(frozen=True, eq=False)
class NextPose:
    """The configuration that tells most, and the size [mm] of the SCP's σ that it would leave."""

    frame: Frame
    size_mm: float


@dataclass(frozen=True, eq=False)
class Round:
    """What is known after some more frames.

    size_mm: the longest axis of the SCP's σ, rotations at 300 mm; None without an answer. reached: whether that is
    what was asked for, by an answer that is "ok" and hangs on no part alone. next_pose: None where none
    can be proposed; next_text says why. held_text: what keeps a σ that is small enough from ending the watch, "" where
    nothing does.
    """

    cell: Cell
    observed: Observed
    result: CalibrationResult
    size_mm: float | None
    reached: bool
    next_pose: NextPose | None
    next_text: str
    held_text: str = ""


def rounds(
    folder: Path,
    extraction: ExtractionConfig | None,
    config: CalibConfig,
    until_mm: float | None = None,
    every_s: float = 1.0,
    say: Callable[[str], None] = lambda _: None,
    sleep: Callable[[float], None] | None = None,
) -> Iterator[Round]:
    """A round for every change of the dataset, until σ is what was asked for, or for ever.

    Parameters
    ----------
    folder
        The dataset's, or its cell.toml. frames.csv may still be absent.
    extraction, config
        As of `observe` and `solve`: a round's answer is what calibrate says of the same files.
    until_mm
        The longest axis of the SCP's σ, rotations at 300 mm, that ends the watch once the verdict is "ok" and no
        part left out in turn moves the answer by more than twice as much.
    every_s
        Between looks; a file counts once it has not changed from one look to the next.
    say
        Told in a sentence what is waited for, once, where it is still so at the next look.
    sleep
        Waits so many seconds.

    Raises
    ------
    InputError
        Where cell.toml, or a file that it names beside frames and points, can not be used.
    """
    try:
        read_cell(folder, recorded=False)
    except InputError as error:
        if ".csv" not in str(error):  # what grows may be half written; the rest is wrong
            raise
    before: dict[Path, tuple[int, int]] = {}
    done: tuple[object, ...] | None = None
    told = last = ""
    while True:
        now = _files(folder)
        still = {path for path, stamp in now.items() if before.get(path) == stamp}
        before = now
        state: tuple[object, ...] | None = None
        try:
            cell = _ready(folder, still)
            state = _state(cell, now)
            words = ""
        except (InputError, _NotYetError) as error:
            words = str(error)
        if words and words == last != told:
            say(words)
            told = words
        told, last = told if words else "", words
        if state is not None and state != done:
            done = state
            try:
                found = _round(cell, extraction, config, until_mm)
            except InputError as error:  # of files that are what they will be: more may mend it
                say(str(error))
            else:
                yield found
                if found.reached:
                    return
        (sleep or time.sleep)(every_s)


class _NotYetError(Exception):
    """What is waited for, in a sentence."""


def _files(folder: Path) -> dict[Path, tuple[int, int]]:
    """Size and time of every file of a dataset; one that vanishes meanwhile is none."""
    root = folder if folder.is_dir() else folder.parent
    out = {}
    for path in root.rglob("*"):
        try:
            stat = path.stat()
        except OSError:
            continue
        if path.is_file():
            out[path] = (stat.st_size, stat.st_mtime_ns)
    return out


def _state(cell: Cell, stamps: dict[Path, tuple[int, int]]) -> tuple[object, ...]:
    """What a round's answer depends on: rows that wait for their profile change nothing."""
    rows = []
    for f in cell.frames:
        hand = None if f.T_base_hand is None else f.T_base_hand.matrix.tobytes()
        read = hand if f.joints_rad is None else f.joints_rad.tobytes()
        file = f.profile or f.image
        rows.append((f.number, f.location, f.role, read, file, stamps.get(cell.folder / file)))
    files = [p for p in cell.files if cell.points is not None or p.suffix != ".csv"]
    return (*rows, *((p, stamps.get(p)) for p in files))


def _ready(folder: Path, still: set[Path]) -> Cell:
    """The dataset with the frames whose files stand still."""
    cell = read_cell(folder, recorded=False)
    table = next((p for p in cell.files if p.name.endswith(".csv") and p in still), None)
    moving = [p.name for p in cell.files if p not in still]
    if moving:
        raise _NotYetError(f"waiting for {', '.join(moving)} to be written to its end")
    if not cell.frames:
        raise _NotYetError(f"waiting for the first row of frames.csv in {cell.folder}")
    if table is not None and not table.read_bytes().endswith((b"\n", b"\r", b"\n\0")):
        raise _NotYetError(f"waiting for the last line of {table.name} to end")
    if cell.points is None:
        named = {f.number: cell.folder / (f.profile or f.image) for f in cell.frames}
        waiting = [f for f in cell.frames if named[f.number] not in still]
        cell = replace(cell, frames=tuple(f for f in cell.frames if f not in waiting))
        if not cell.frames:
            raise _NotYetError(f"waiting for {named[waiting[0].number].name}")
    return _with_points(folder, cell)


def _with_points(folder: Path, cell: Cell) -> Cell:
    """The dataset as recorded, with these of its frames: points.csv is read only once there is something to read."""
    whole = read_cell(folder)
    numbers = {f.number for f in cell.frames}
    return replace(whole, frames=tuple(f for f in whole.frames if f.number in numbers))


def _round(cell: Cell, extraction: ExtractionConfig | None, config: CalibConfig, until_mm: float | None) -> Round:
    observed = observe(cell, extraction)
    result = solve(cell, observed, config)
    size = None if result.covariance is None else float(size_mm(result.covariance, "E"))
    small = until_mm is not None and size is not None and size <= until_mm
    held = held_up(result, until_mm) if small and until_mm is not None else ""
    reached = small and not held
    found, words = (None, "") if reached else _next(cell, result, size)
    return Round(cell, observed, result, size, reached, found, words, held)


def held_up(result: CalibrationResult, until_mm: float) -> str:
    """What keeps an answer whose σ is small enough from being one to end on; "" where nothing does.

    A weak answer, or one at odds with the files, is none. And a set that grows until its σ looks small ends where
    chance made it look small: there must be parts to leave out in turn, and none that alone carries the answer.
    """
    small = f"the longest σ is below the {until_mm:g} mm asked for"
    if result.verdict.code != "ok":
        return f"{small}, by an answer whose verdict is {result.verdict.code}: that ends no watch"
    left = result.left_out
    if left is None or (left.by == "frame" and len(left.parts) < FEWEST_LEFT_OUT):
        return f"{small}, and there is too little yet that could be left out in turn to bear it out"
    lever = np.array([1.0] * 3 + [LEVER_MM] * 3)
    moved = [float(np.linalg.norm(p.shift * lever)) for p in left.parts]
    k = int(np.argmax(moved))
    if moved[k] <= _SIGMAS * until_mm:
        return ""
    return f"{small}, but it hangs on {left.by} {left.parts[k].name}: without it the answer moves by {moved[k]:.2g} mm"


def _next(cell: Cell, result: CalibrationResult, size: float | None) -> tuple[NextPose | None, str]:
    """The most telling configuration beside those measured, or why none is proposed."""
    T = result.T_hand_sensor or cell.T_hand_sensor_design
    places = {n: p.T_base_target for n, p in result.locations.items() if p.T_base_target is not None}
    places = {n: T for n, T in places.items() if result.locations[n].role == "calibrate"} or dict(cell.T_base_jig)
    if T is None or not places:
        return None, f"no answer yet, so that no pose can be weighed: {result.verdict.text}"
    try:
        if all(isinstance(t, Surface) for t in cell.targets):
            return _on_surface(cell, result, T, places, size)
        return _on_strings(cell, T, places)
    except (InputError, NoAnswerError) as error:
        return None, str(error)


def _on_surface(
    cell: Cell, result: CalibrationResult, T: Pose, places: dict[str, Pose], size: float | None
) -> tuple[NextPose | None, str]:
    noise = {} if result.estimate is None else result.estimate.noise
    known = ("hand_sigma_mm" in noise) and ("hand_sigma_deg" in noise)
    hand = (noise["hand_sigma_mm"], noise["hand_sigma_deg"]) if known else None
    used = [f for f in result.frames if f.used and f.location in places]
    plan = next_views(cell, T, places, used, 1, hand_noise=hand, model="full" if result.model == "full" else "scp")
    view = plan.views[0]
    predicted = float(size_mm(plan.before, "E"))
    # what frames scatter beyond the noise stays: the gain is the predicted one, on the σ that there is
    left = view.size_mm if size is None else size * view.size_mm / predicted
    return NextPose(view.frame, left), ""


def _on_strings(cell: Cell, T: Pose, places: dict[str, Pose]) -> tuple[NextPose | None, str]:
    there = replace(cell, T_base_jig=places, T_hand_sensor_design=T)
    proposal = propose(there, 1, "E", "scp", plan_limits(), 0, lambda _done, _total: None)
    mine = [r for r in proposal.rows if r.role == "calibrate"]
    sigma = np.concatenate([proposal.sigma_mm, np.deg2rad(proposal.sigma_deg) * 300.0])
    return NextPose(mine[0], float(np.max(sigma))), ""
