"""Recording a cell in emulation: rendered images with truth in a dataset folder; resumes, same seed same bytes."""

from __future__ import annotations

import json
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from calib.mount import Mount
from geometry import DH_ROWS, Arm, Frame, InputError, Pose, Role
from jig_cad import Jig
from perceptron_emu import Material, Scene, Solid
from workbench.emulate.extras import NONE, Extras, Renderer, truth_points
from workbench.emulate.recipe import recipe_name
from workbench.files import Cell, Truth, TruthFrame, is_whole, read_truth, write_cell, write_png, write_text

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

READING_DECIMALS = 4  # digits of a joint reading in degrees, as a controller shows them
PARTS = ".parts"


@dataclass(frozen=True, eq=False)
class TrueCell:
    """What stands behind a recording: the true robot, jig and mounting, the jig's places and what is around them.

    jig: None where a ball, plate or another body is measured, which is then among the solids. solids: by location, in
    the target's axes; plates and posts as well as anything else in the light's way. carried: solids on the sensor, in
    {P}. string_material: the thread's surface, None for that of the sensor's file. mount: "fixed" where
    T_hand_sensor is T_base_sensor and T_base_jig is T_hand_jig.
    """

    robot: Arm
    jig: Jig | None
    T_hand_sensor: Pose
    T_base_jig: dict[str, Pose]
    solids: dict[str, tuple[Solid, ...]] = field(default_factory=dict)
    carried: tuple[Solid, ...] = ()
    string_material: Material | None = None
    mount: Mount = "hand"

    def T_sensor_target(self, configuration: Configuration) -> Pose:
        """Where the sensor has the target at a configuration."""
        hand = self.robot.pose(configuration.true_rad)
        carrying = hand.inverse() if self.mount == "fixed" else hand
        return (carrying @ self.T_hand_sensor).inverse() @ self.T_base_jig[configuration.location]


@dataclass(frozen=True, eq=False)
class Configuration:
    """One frame to record: the joints as read (n,) [rad] and as they truly stand."""

    frame: int
    location: str
    role: Role
    reading_rad: Array
    true_rad: Array


def with_joint_noise(
    views: Sequence[tuple[str, Role, Array]], robot: Arm, rng: np.random.Generator
) -> tuple[Configuration, ...]:
    """Configurations of (location, role, joints): readings rounded as in the file, true angles off by the joints' σ."""
    out, sigma = [], robot.dh_part().uncertainty.joint_sigma_rad
    for frame, (location, role, joints) in enumerate(views):
        reading = np.deg2rad(np.round(np.rad2deg(joints), READING_DECIMALS))
        true = reading + rng.normal(0, sigma, len(reading))
        out.append(Configuration(frame, location, role, reading, true))
    return tuple(out)


def record(
    folder: Path,
    cell: Cell,
    true: TrueCell,
    configurations: Sequence[Configuration],
    seed: int,
    progress: Progress | None = None,
    renderer: Renderer = "own",
    extras: Extras = NONE,
) -> Cell:
    """Render every configuration into ``folder`` as a dataset with truth.json.

    Frames that stand in the folder already, of the same recipe and with the same extras, are kept.

    Parameters
    ----------
    folder
        Made where it is not there.
    cell
        What a user knows: nominal robot and jig, design SCP, sensor; its frames are replaced.
    true
        What stands behind the images.
    configurations
        One a frame.
    seed
        The same seed gives the same bytes.
    progress
        Told the frames done and the frames in all.
    renderer
        "own" casts rays, "pyrender" uses OpenGL's depth.
    extras
        What is written beside images and truth.

    Returns
    -------
    Cell
        The dataset as it stands in the folder.

    """
    recipe = _recipe(cell, true, configurations, seed, renderer)
    rows = tuple(_row(c) for c in configurations)
    finished = _finished(folder, recipe, rows, extras)
    if finished is None:
        frames = []
        for i, configuration in enumerate(configurations):
            frames.append(_frame(folder, cell, true, configuration, (seed, recipe, renderer, extras)))
            if progress:
                progress(i + 1, len(configurations))
        finished = _truth(true, frames, recipe)
    done = replace(cell, folder=folder, frames=rows, truth=finished)
    write_cell(done, folder, READING_DECIMALS)
    shutil.rmtree(folder / PARTS, ignore_errors=True)
    return done


def frame_scene(cell: Cell, true: TrueCell, configuration: Configuration) -> Scene:
    """What the sensor sees at one configuration."""
    T_sensor_jig = true.T_sensor_target(configuration)
    solids = true.solids.get(configuration.location, ())
    placed = tuple(replace(s, T_sensor_mesh=T_sensor_jig @ s.T_sensor_mesh) for s in solids)
    return Scene(cell.sensor, true.jig, T_sensor_jig, (*placed, *true.carried), true.string_material)


def _row(c: Configuration) -> Frame:
    return Frame(c.frame, c.location, c.role, c.reading_rad, image=f"images/{c.frame:03d}.png")


def _frame(
    folder: Path, cell: Cell, true: TrueCell, configuration: Configuration, how: tuple[int, str, Renderer, Extras]
) -> TruthFrame:
    """Render one frame, or take it from the folder where it was rendered already."""
    seed, recipe, renderer, extras = how
    number = configuration.frame
    part, image = folder / PARTS / f"{number:03d}.json", folder / "images" / f"{number:03d}.png"
    known = _part(part, recipe)
    if known is not None and all(is_whole(p) for p in (image, *extras.files(folder, number))):
        return known
    scene = frame_scene(cell, true, configuration)
    frame = extras.render(folder, number, scene, cell.emulator, seed, renderer)
    pose = true.T_sensor_target(configuration).matrix.tolist()
    truth = TruthFrame(frame=number, T_sensor_jig=pose, points=truth_points(frame))
    write_png(image, frame.image)
    write_text(part, json.dumps({"recipe": recipe, **truth.model_dump()}))
    return truth


def _part(path: Path, recipe: str) -> TruthFrame | None:
    """The truth of a frame that was rendered before by the same recipe; what was cut or emptied is rendered anew."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        return TruthFrame.model_validate(data) if data.pop("recipe", None) == recipe else None
    except (OSError, ValueError, AttributeError, TypeError, RecursionError):
        return None


def _truth(true: TrueCell, frames: list[TruthFrame], recipe: str) -> Truth:
    table, jig = true.robot.dh_part(), true.jig
    columns = {row.file_key: row.to_file(getattr(table, row.column)) for row in DH_ROWS}
    return Truth(
        name=recipe,
        T_hand_sensor=true.T_hand_sensor.matrix.tolist(),
        dh=[{key: float(column[i]) for key, column in columns.items()} for i in range(table.n_joints)],
        anchors_mm=dict(zip(jig.anchors, map(tuple, jig.anchors_mm.tolist()), strict=True)) if jig else {},
        locations={name: pose.matrix.tolist() for name, pose in true.T_base_jig.items()},
        frames=tuple(frames),
    )


def _finished(folder: Path, recipe: str, rows: Sequence[Frame], extras: Extras) -> Truth | None:
    """The truth of a recording that is complete already, else None."""
    path = folder / "truth.json"
    wanted = [p for row in rows for p in (folder / row.image, *extras.files(folder, row.number))]
    try:
        truth = read_truth(path)
    except InputError:  # absent, or cut: it is written anew
        return None
    return truth if truth.name == recipe and all(is_whole(p) for p in wanted) else None


def _recipe(cell: Cell, true: TrueCell, configurations: Sequence[Configuration], seed: int, renderer: str) -> str:
    """A name of everything that decides the images."""
    from importlib.metadata import version

    seen_by = cell.sensor.sheet, cell.sensor.require_camera(), cell.emulator
    stands = [(c.frame, c.location, c.true_rad) for c in configurations]
    return recipe_name(version("perceptron-emu"), renderer, seed, *seen_by, true, stands)
