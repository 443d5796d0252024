"""A dataset looked through file by file, also a half-filled one: what is there, missing or doubtful, and for what."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeVar

import numpy as np

from geometry import Arm, Frame, InputError, Sensor, Target
from jig_cad import Jig
from workbench.files.cell import CellFile, read_cell
from workbench.files.images import SUFFIXES, read_image
from workbench.files.robots import read_robot
from workbench.files.sensor_file import read_sensor
from workbench.files.strict import validate
from workbench.files.tables import controller_poses, read_frames, read_points
from workbench.files.target_file import read_target
from workbench.files.toml_text import read_toml
from workbench.files.truth_file import read_truth

FEWEST_FRAMES = 6  # of role calibrate: below it hardly any set of views tells the SCP from the target's place
MOST_STRANGERS = 5  # images without a row that are named one by one
MOST_ROWS = 20  # wrong rows of a table that are named one by one

T = TypeVar("T")
State = Literal["ok", "missing", "doubtful", "broken"]


@dataclass(frozen=True)
class FileFinding:
    """What was found of one file or frame. missing, broken: `calibrate` can not use it."""

    state: State
    what: str
    detail: str


def examine_cell(path: Path) -> Iterator[FileFinding]:
    """Look through a dataset as it stands.

    Parameters
    ----------
    path
        The folder, or the cell.toml in it.

    Yields
    ------
    FileFinding
        For cell.toml, every file that it names, every frame with what it would be used for, and the whole.

    """
    cell_path = path / "cell.toml" if path.is_dir() else path
    folder = cell_path.parent
    if not cell_path.exists():
        yield FileFinding("missing", str(cell_path), "`perceptron-emu init FOLDER` writes a first one")
        return
    try:
        source = read_toml(cell_path)
        file = validate(CellFile, source)
    except InputError as error:
        yield FileFinding("broken", cell_path.name, str(error))
        return
    yield FileFinding("ok", cell_path.name, file.name or "has no name")
    found: list[FileFinding] = []
    sensor = _look(found, "sensor", folder, file.sensor, lambda p, _: read_sensor(p), _sensor_words)
    target_name = file.target or file.jig
    own = [given.target for given in file.locations.values() if given.target]
    target: Target | None = None
    if target_name is not None or not own:
        target = _look(found, "jig or target", folder, target_name, lambda p, _: read_target(p), _target_words)
    for name in dict.fromkeys(own):
        _look(found, "target of a location", folder, name, lambda p, _: read_target(p), _target_words)
    robot = None
    if file.robot is not None:
        robot = _look(found, "robot", folder, file.robot, read_robot, _robot_words)
    found.extend(_about_start(file))
    found.extend(_about_frames(folder, file, robot, sensor, target))
    found.extend(_about_truth(folder))
    yield from found
    if all(f.state not in ("broken", "missing") or f.what.startswith("frame ") for f in found):
        yield from _as_a_whole(cell_path)


def _look(
    found: list[FileFinding],
    key: str,
    folder: Path,
    name: str | None,
    read: Callable[[Path, Callable[[str], None]], T],
    words: Callable[[T], str],
) -> T | None:
    """One file that cell.toml names, as read, its findings added to ``found``."""
    if not name:
        found.append(FileFinding("missing", key, "cell.toml does not name it"))
        return None
    path = folder / name
    if not path.exists():
        found.append(FileFinding("missing", name, f"cell.toml names it as {key}, and it is not there"))
        return None
    said: list[str] = []
    try:
        value = read(path, said.append)
        found.append(FileFinding("ok", name, words(value)))
    except InputError as error:
        found.append(FileFinding("broken", name, str(error)))
        return None
    found.extend(FileFinding("doubtful", name, text) for text in said)
    return value


def _sensor_words(sensor: Sensor) -> str:
    if sensor.camera is None:
        return "gives profiles"
    c = sensor.camera
    return f"images of {c.width_px} × {c.height_px} px, {c.bit_depth} bits"


def _robot_words(robot: Arm) -> str:
    low, high = robot.dh_part().stated_limits
    free = int(np.sum(np.isinf(low) | np.isinf(high)))
    return f"{robot.n_joints} joints" + (f", {free} of them without limits" if free else "")


def _target_words(target: Target) -> str:
    if isinstance(target, Jig):
        return f"{len(target.strings)} strings: {', '.join(target.strings)}"
    return f"kind {getattr(target, 'kind', 'own')}"


def _about_start(file: CellFile) -> Iterator[FileFinding]:
    if file.scp_initial is None:
        yield FileFinding(
            "doubtful",
            "[scp_initial]",
            "is absent: a start is found from the data, and the figures of the design are null",
        )
    else:
        t = ", ".join(f"{v:g}" for v in file.scp_initial.translation_mm)
        yield FileFinding("ok", "[scp_initial]", f"the sensor at {t} mm in the hand by design")


def _about_frames(
    folder: Path, file: CellFile, robot: Arm | None, sensor: Sensor | None, target: Target | None
) -> Iterator[FileFinding]:
    if file.frames is None or not (folder / file.frames).exists():
        yield FileFinding("missing", file.frames or "frames", "no table of frames: a row for each image is needed")
        return
    said: list[str] = []
    wrong: list[InputError] = []
    try:
        frames = read_frames(
            folder / file.frames,
            None if robot is None else robot.n_joints,
            may_be_empty=True,
            remark=said.append,
            poses=None if file.poses is None else controller_poses(file.poses),
            wrong=wrong.append,
        )
    except InputError as error:
        yield FileFinding("broken", file.frames, str(error))
        return
    yield from (FileFinding("doubtful", file.frames, text) for text in said)
    yield from _wrong_rows(file.frames, wrong)
    if not frames and not wrong:
        yield FileFinding(
            "missing", file.frames, "holds a header and no rows yet: one for each image or profile is needed"
        )
    elif not wrong:
        yield FileFinding("ok", file.frames, f"{len(frames)} rows")
    points = folder / (file.points or "points.csv")
    from_points = points.exists() and not any(f.image and (folder / f.image).exists() for f in frames)
    with_points: set[int] | None = None
    if from_points:
        try:
            strings = target.strings if isinstance(target, Jig) else ()
            on_surfaces = frozenset(() if strings else (f.number for f in frames))
            with_points = set(read_points(points, strings, surfaces=on_surfaces))
            yield FileFinding("ok", points.name, f"in place of images, with points of {len(with_points)} frames")
        except InputError as error:
            with_points = set()
            yield FileFinding("broken", points.name, str(error))
    usable: Counter[tuple[str, str]] = Counter()
    for frame in frames:
        finding = _frame(folder, frame, robot, sensor, with_points)
        usable[frame.location, frame.role] += finding.state in ("ok", "doubtful")
        yield finding
    yield from _strangers(folder, frames)
    if frames:
        yield from _counts(usable)


def _wrong_rows(name: str, wrong: list[InputError]) -> Iterator[FileFinding]:
    """Rows that can not be read, each by its line: all are mended in one go."""
    yield from (FileFinding("broken", name, str(error)) for error in wrong[:MOST_ROWS])
    if len(wrong) > MOST_ROWS:
        yield FileFinding("broken", name, f"and {len(wrong) - MOST_ROWS} further rows that can not be used")


def _frame(
    folder: Path, frame: Frame, robot: Arm | None, sensor: Sensor | None, with_points: set[int] | None
) -> FileFinding:
    """What a frame would be used for, or why it would be left out."""
    what, use = f"frame {frame.number}", f"{frame.role} at {frame.location}"
    if robot is not None and frame.joints_rad is not None and frame.T_base_hand is None:
        low, high = robot.dh_part().stated_limits
        out = np.flatnonzero((frame.joints_rad < low) | (frame.joints_rad > high))
        if len(out):
            j = int(out[0])
            reading, limits = np.rad2deg(frame.joints_rad[j]), np.rad2deg([low[j], high[j]])
            why = f"joint {j + 1} reads {reading:g}°, its limits are {limits[0]:g}° … {limits[1]:g}°"
            return FileFinding("missing", what, f"{use}: left out, robot_out_of_range: {why}")
    if with_points is not None:
        if frame.number not in with_points:
            return FileFinding("missing", what, f"{use}: left out, no_spots: no row of points has its number")
        return FileFinding("ok", what, f"{use}, by its points")
    if frame.profile:
        there = (folder / frame.profile).is_file()
        state: State = "ok" if there else "missing"
        why = frame.profile if there else f"left out, no_profile: {folder / frame.profile} is not there"
        return FileFinding(state, what, f"{use}: {why}")
    if not frame.image:
        return FileFinding("missing", what, f"{use}: left out, image_unreadable: the row names no image")
    if sensor is None or sensor.camera is None:
        there = (folder / frame.image).is_file()
        return FileFinding(
            "doubtful" if there else "missing", what, f"{use}: {frame.image}, not looked at without a camera"
        )
    said: list[str] = []
    try:
        image = read_image(folder / frame.image, sensor, said.append)
    except InputError as error:
        return FileFinding("missing", what, f"{use}: left out, image_unreadable: {error}")
    full = float(np.mean(image >= sensor.camera.saturation_dn))
    if said:
        return FileFinding("doubtful", what, f"{use}: {said[0]}")
    if int(image.max()) == int(image.min()):
        return FileFinding("doubtful", what, f"{use}: {frame.image} is of one grey level: no laser in it")
    return FileFinding("ok", what, f"{use}: {frame.image}" + (f", {full:.1%} saturated" if full > 0.001 else ""))


def _strangers(folder: Path, frames: tuple[Frame, ...]) -> Iterator[FileFinding]:
    """Images that no row names."""
    named = {(folder / f.image).resolve() for f in frames if f.image}
    images = folder / "images"
    there = sorted(p for p in images.iterdir() if p.suffix.lower() in SUFFIXES) if images.is_dir() else []
    strangers = [p for p in there if p.resolve() not in named]
    for path in strangers[:MOST_STRANGERS]:
        yield FileFinding("doubtful", f"images/{path.name}", "no row of the frames names it: it is not used")
    if len(strangers) > MOST_STRANGERS:
        yield FileFinding("doubtful", "images", f"and {len(strangers) - MOST_STRANGERS} further images without a row")


def _counts(usable: Counter[tuple[str, str]]) -> Iterator[FileFinding]:
    """How many frames are there for what."""
    for role in ("calibrate", "verify"):
        places = {location: n for (location, r), n in usable.items() if r == role}
        text = ", ".join(f"{n} at {location}" for location, n in places.items())
        total = sum(places.values())
        if role == "calibrate":
            state: State = "ok" if total >= FEWEST_FRAMES else "missing" if total < 3 else "doubtful"
            few = "" if state == "ok" else f": fewer than {FEWEST_FRAMES} hardly tell the sensor's pose"
            yield FileFinding(state, "to calibrate", (text or "no frame") + few)
        elif total:
            yield FileFinding("ok", "to verify", text)
        else:
            yield FileFinding(
                "doubtful", "to verify", "no frame: nothing would check the answer at a place not solved with"
            )


def _about_truth(folder: Path) -> Iterator[FileFinding]:
    path = folder / "truth.json"
    if not path.exists():
        return
    try:
        yield FileFinding("ok", path.name, f"truth of {len(read_truth(path).frames)} frames, used by `validate` alone")
    except InputError as error:
        yield FileFinding("broken", path.name, str(error))


def _as_a_whole(path: Path) -> Iterator[FileFinding]:
    """What only shows where the files are put together."""
    try:
        read_cell(path)
    except InputError as error:
        yield FileFinding("broken", "the dataset", str(error))
    else:
        yield FileFinding("ok", "the dataset", f"`perceptron-emu calibrate {path.parent}` can read it")
