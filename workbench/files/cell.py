"""A cell dataset as a folder: cell.toml and the files it names, read into one value and written from it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Literal

import numpy as np
from pydantic import Field, field_validator

import assets
from calib.bundle import Evidence
from calib.mount import Mount
from geometry import (
    Arm,
    Frame,
    InputError,
    Pose,
    Remark,
    Role,
    Sensor,
    Surface,
    Target,
    Workspace,
    did_you_mean,
    target_at,
)
from geometry.sensor import ProfileOutput
from jig_cad import Jig
from jig_cad.files import table_model
from perceptron_emu import EmulatorConfig
from workbench.files.robots import read_robot
from workbench.files.sensor_file import ATOL_ROTATION, read_emulator, read_sensor
from workbench.files.strict import Coordinate, FileSection, Matrix4, Positive, Text, Vector3, suggestion, validate
from workbench.files.tables import (
    LONGEST_NAME,
    ControllerPoses,
    EvidenceSection,
    GivenPoints,
    PosesSection,
    controller_poses,
    names_profiles,
    read_evidence,
    read_frames,
    read_points,
)
from workbench.files.target_file import read_target
from workbench.files.toml_text import Location, TomlSource, read_toml
from workbench.files.truth_file import Truth, read_truth


class ScpSection(FileSection):
    """[scp_initial]: T_hand_sensor by design, of a fixed sensor T_base_sensor; about fixed X, Y, Z, R = Rz·Ry·Rx."""

    rotation_deg: Vector3
    translation_mm: Vector3


class MountSection(FileSection):
    """[mount]: whether the hand carries the sensor, or the target before a sensor that stands."""

    sensor: Literal["hand", "fixed"] = "hand"


class LocationSection(FileSection):
    """[locations.NAME]: where the target stands, if known; decides the half turn. role: of views to be planned.

    target: a file in place of cell.toml's. T_hand_jig: in place of T_base_jig where the hand carries the target.
    """

    T_base_jig: Matrix4 | None = None
    T_hand_jig: Matrix4 | None = None
    target: Text | None = None
    role: Literal["calibrate", "verify"] | None = None


class BoxSection(FileSection):
    """[[workspace.box]]: a box in the base frame that nothing may enter."""

    min_mm: Vector3
    max_mm: Vector3


class WorkspaceSection(FileSection):
    """[workspace]: what must not be touched. floor_z_mm = false: there is no floor below."""

    floor_z_mm: Coordinate | Literal[False] = 0.0
    link_radius_mm: Positive | None = None
    box: tuple[BoxSection, ...] = ()


class CellFile(FileSection):
    """The keys of cell.toml; files are named relative to it."""

    sensor: Text
    jig: Text | None = None
    target: Text | None = None
    robot: Text | None = None
    frames: Text | None = None
    points: Text | None = None
    scp_initial: ScpSection | None = None
    poses: PosesSection | None = None
    workspace: WorkspaceSection = Field(default_factory=WorkspaceSection)
    mount: MountSection = Field(default_factory=MountSection)
    evidence: EvidenceSection = Field(default_factory=EvidenceSection)
    locations: dict[str, LocationSection] = Field(default_factory=dict)

    @field_validator("locations", mode="before")
    @classmethod
    def _without_name(cls, value: object) -> object:
        if isinstance(value, dict) and isinstance(value.get("name"), str):
            return {k: v for k, v in value.items() if k != "name"}
        return value


@dataclass(frozen=True, eq=False)
class Cell:
    """A cell dataset: sensor, jig, robot, design SCP, frames; images stay on disk until they are needed.

    points: by frame number, where a points.csv stands in place of images. T_base_jig: by location, where given.
    roles: of the locations in cell.toml that say one. robot: None where hand poses stand in place of joint readings.
    robot_path, sensor_path: the files. files: all that were read, images aside.
    emulator: how images of the cell are made, no knowledge of a recorded one. remarks: a sentence for all that is
    doubtful in the files and was read nevertheless. workspace: the floor and boxes that nothing may touch.
    mount: "fixed" where the sensor stands and the hand carries the target: T_hand_sensor_design is then T_base_sensor,
    T_base_jig is T_hand_jig. evidence: what is known beside the frames. takes_profiles: whether frames.csv has a column
    for profiles, not images.
    """

    folder: Path
    sensor: Sensor
    target: Target | Mapping[str, Target]
    robot: Arm | None
    frames: tuple[Frame, ...]
    T_hand_sensor_design: Pose | None
    T_base_jig: dict[str, Pose] = field(default_factory=dict)
    points: dict[int, GivenPoints] | None = None
    truth: Truth | None = None
    roles: dict[str, Role] = field(default_factory=dict)
    name: str = ""
    robot_path: Path | None = None
    sensor_path: Path | None = None
    emulator: EmulatorConfig = field(default_factory=EmulatorConfig)
    remarks: tuple[str, ...] = ()
    files: tuple[Path, ...] = ()
    workspace: Workspace = field(default_factory=Workspace)
    mount: Mount = "hand"
    evidence: tuple[Evidence, ...] = ()
    takes_profiles: bool = False

    @property
    def jig(self) -> Jig:
        """The string jig; InputError where other targets were measured."""
        if isinstance(self.target, Jig):
            return self.target
        kinds = {t.kind if isinstance(t, Surface) else "strings" for t in self.targets}
        raise InputError(
            f"{self.folder / 'cell.toml'}: this needs a string jig at all locations, and the target is "
            f"{' and '.join(sorted(kinds))}"
        )

    @property
    def has_surfaces(self) -> bool:
        """Whether balls, plates or other surfaces are measured, at one location at least."""
        return any(isinstance(target, Surface) for target in self.targets)

    @property
    def targets(self) -> tuple[Target, ...]:
        """All targets, each once."""
        if not isinstance(self.target, Mapping):
            return (self.target,)
        return tuple({id(t): t for t in self.target.values()}.values())

    @property
    def design(self) -> Pose:
        """The SCP by design; InputError where cell.toml gives none."""
        if self.T_hand_sensor_design is None:
            raise InputError(
                f"{self.folder / 'cell.toml'}: [scp_initial] is missing: this needs the sensor's place by its drawing"
            )
        return self.T_hand_sensor_design

    @property
    def arm(self) -> Arm:
        """The robot; InputError where the cell has hand poses alone."""
        if self.robot is None:
            raise InputError(
                f"{self.folder / 'cell.toml'}: the key robot is missing: this needs the arm's table and joint readings"
            )
        return self.robot


def read_cell(path: Path, *, recorded: bool = True) -> Cell:
    """The dataset of a folder or of its cell.toml; images are not opened here.

    Parameters
    ----------
    path
        The folder, or the cell.toml in it.
    recorded
        Whether frames must be there; a cell that is yet to be recorded has none.

    Returns
    -------
    Cell
        Sensor, jig, robot, design SCP, frames, and points and truth where the folder holds them.

    Raises
    ------
    InputError
        Naming file, line and key, and what is right there.

    """
    source = read_toml(_cell_path(path))
    file = validate(CellFile, source)
    folder = source.path.parent
    sensor_path = _named(folder, file.sensor, source, "sensor")
    robot_path = None if file.robot is None else _named(folder, file.robot, source, "robot")
    remarks: list[str] = []
    robot = None if robot_path is None else read_robot(robot_path, remarks.append)
    frames, frames_path = _frames(folder, file, source, robot, remarks.append, recorded=recorded)
    if frames:
        _check_location_names(file, frames, source)
    truth = folder / "truth.json"
    evidence = _evidence(file, folder, robot, source, remarks.append) if recorded else ()
    if recorded and frames:
        _check_distances(file, frames, source, remarks.append)
    target = _read_targets(folder, file, source, frames)
    scp = file.scp_initial
    points = _points(folder, file, frames, frames_path, target, remarks.append) if recorded else None
    points_path = None if points is None else folder / (file.points or "points.csv")
    return Cell(
        folder=folder,
        sensor=_sensor(sensor_path, frames, remarks.append) if recorded else read_sensor(sensor_path),
        target=target,
        robot=robot,
        frames=frames,
        T_hand_sensor_design=None if scp is None else Pose.from_fixed_xyz_deg(scp.rotation_deg, scp.translation_mm),
        T_base_jig=_places(source, file),
        points=points,
        truth=read_truth(truth) if truth.exists() else None,
        roles={name: given.role for name, given in file.locations.items() if given.role},
        name=file.name,
        robot_path=robot_path,
        sensor_path=sensor_path,
        emulator=read_emulator(sensor_path),
        remarks=tuple(remarks),
        files=_files(source, file, (sensor_path, robot_path, frames_path), points_path),
        workspace=_workspace(file.workspace, source),
        mount=file.mount.sensor,
        evidence=evidence,
        takes_profiles=names_profiles(frames_path),
    )


def _evidence(
    file: CellFile, folder: Path, robot: Arm | None, source: TomlSource, remark: Remark
) -> tuple[Evidence, ...]:
    n_joints = None if robot is None else robot.n_joints
    return read_evidence(file.evidence, folder, n_joints, source.where(("evidence",)), remark)


def _check_distances(file: CellFile, frames: tuple[Frame, ...], source: TomlSource, remark: Remark) -> None:
    """A distance to a place that no frame saw tells nothing, which is said: misspelt, or yet to be seen."""
    seen = list(dict.fromkeys(row.location for row in frames))
    for given in file.evidence.distance:
        for name in (n for n in given.between if n not in seen):
            remark(
                f"{source.where(('evidence',))}: [[evidence.distance]] between names location {name}, at which no "
                f"frame was taken: the distance is not used{suggestion(name, seen)}"
            )


def _places(source: TomlSource, file: CellFile) -> dict[str, Pose]:
    """The target's places: in the base, or in the hand that carries it before a fixed sensor."""
    fixed = file.mount.sensor == "fixed"
    right, wrong = ("T_hand_jig", "T_base_jig") if fixed else ("T_base_jig", "T_hand_jig")
    out: dict[str, Pose] = {}
    for name, given in file.locations.items():
        if getattr(given, wrong) is not None:
            carries = "the hand carries the target" if fixed else "the hand carries the sensor"
            raise InputError(
                f"{source.where(('locations', name, wrong))}: [locations.{name}] {wrong}: with [mount] sensor = "
                f'"{file.mount.sensor}" {carries}, and {right} is right'
            )
        if (matrix := getattr(given, right)) is not None:
            out[name] = _pose(source, name, matrix, right)
    return out


def _workspace(given: WorkspaceSection, source: TomlSource) -> Workspace:
    names = tuple(b.name or f"[[workspace.box]] {k}" for k, b in enumerate(given.box, start=1))
    boxes = np.array([(b.min_mm, b.max_mm) for b in given.box], dtype=float).reshape(-1, 2, 3)
    floor = None if given.floor_z_mm is False else float(given.floor_z_mm)
    try:
        return Workspace(floor, boxes, names, given.link_radius_mm)
    except InputError as error:
        raise InputError(f"{source.where(('workspace',))}: {error}") from None


def _sensor(path: Path, frames: Sequence[Frame], remark: Remark) -> Sensor:
    """The sensor; where the rows name profiles and no image, a camera of its file stands for nothing in them."""
    sensor = read_sensor(path)
    if sensor.camera is None or any(row.image for row in frames) or not any(row.profile for row in frames):
        return sensor
    remark(
        f"{path}: describes a camera, but the frames are profiles: they are taken as the sensor gives them, the camera "
        "is not used and σ are estimated from the profiles; [profile] in place of [image] and [camera] can state them"
    )
    return replace(sensor, camera=None, direct=None, uncertainty=None, profile=ProfileOutput())


def _files(source: TomlSource, file: CellFile, read: Sequence[Path | None], points: Path | None) -> tuple[Path, ...]:
    """cell.toml and the files that were read; a points.csv beside images is a result, and no input."""
    folder = source.path.parent
    targets = [given.target for given in file.locations.values()]
    given = [folder / n for n in (file.jig, file.target, *targets) if n]
    told = [folder / n for n in (file.evidence.tracker, file.evidence.sockets) if n]
    named = dict.fromkeys((*given, *(() if points is None else (points,)), *told))
    return tuple(p for p in (source.path, *read, *named) if p is not None and p.is_file())


def _frames(
    folder: Path, file: CellFile, source: TomlSource, robot: Arm | None, remark: Remark, *, recorded: bool
) -> tuple[tuple[Frame, ...], Path]:
    if file.frames is None:
        if recorded:
            raise InputError(f"{source.path}: the key frames is missing, it names the frames.csv")
        return (), folder
    path = folder / file.frames
    if not recorded and not path.exists():
        return (), path
    path = _named(folder, file.frames, source, "frames")
    n_joints = None if robot is None else robot.n_joints
    poses = None if file.poses is None else _controller_poses(file.poses, source)
    return read_frames(path, n_joints, may_be_empty=not recorded, remark=remark, poses=poses), path


def _controller_poses(section: PosesSection, source: TomlSource) -> ControllerPoses:
    try:
        return controller_poses(section)
    except InputError as error:
        raise InputError(f"{source.where(('poses',))}: {error}") from None


def read_jig_file(path: Path) -> Jig:
    """The jig of a jig.toml, or of a target.toml of kind "strings"; InputError names file, line and key."""
    source = read_toml(path)
    table_model(source.data, source.where(("kind",)))
    target = read_target(path)
    if not isinstance(target, Jig):
        raise InputError(f"{path}: a string jig is needed here")
    return target


def _read_targets(
    folder: Path, file: CellFile, source: TomlSource, frames: tuple[Frame, ...]
) -> Target | Mapping[str, Target]:
    """The target that cell.toml names as ``jig`` or ``target``, or by location where locations name their own."""
    own = {name: given.target for name, given in file.locations.items() if given.target is not None}
    if not own:
        return _read_target(folder, file, source)
    read: dict[str, Target] = {}
    for name, target in own.items():
        if target not in read:
            read[target] = read_target(_named(folder, target, source, "target", ("locations", name, "target")))
    out = {name: read[target] for name, target in own.items()}
    others = {f.location for f in frames if f.location not in out} | (set(file.locations) - set(out))
    if others:
        common = _read_target(folder, file, source)
        out |= dict.fromkeys(sorted(others), common)
    kinds = {id(t): t for t in out.values()}
    return next(iter(kinds.values())) if len(kinds) == 1 else out


def _read_target(folder: Path, file: CellFile, source: TomlSource) -> Target:
    """The target of the file that cell.toml names as ``jig`` or as ``target``."""
    if file.jig is not None and file.target is not None:
        raise InputError(f"{source.where(('target',))}: the keys jig and target name one thing twice: keep one of them")
    if file.target is None:
        if file.jig is None:
            raise InputError(f"{source.path}: the key jig is missing; or target, which names a target.toml")
        return read_jig_file(_named(folder, file.jig, source, "jig"))
    path = _named(folder, file.target, source, "target")
    if "kind" not in read_toml(path).data:
        raise InputError(f'{path}: the key kind is missing: kind = "strings" for lines between anchors')
    return read_target(path)


def _cell_path(path: Path) -> Path:
    if path.is_dir():
        if not (path / "cell.toml").exists():
            raise InputError(f"{path}: the folder holds no cell.toml; `perceptron-emu init FOLDER` writes a first one")
        return path / "cell.toml"
    return path


def _named(folder: Path, name: str, source: TomlSource, key: str, where: Location = ()) -> Path:
    path = folder / name
    if any(len(part.encode()) > LONGEST_NAME for part in path.parts):
        raise InputError(f"{source.where(where or (key,))}: {key} is too long for the name of a file")
    if not name or not path.is_file():
        taken = {source.path.name, *(v for k, v in source.data.items() if k != key and isinstance(v, str))}
        near = did_you_mean(name, [p.name for p in folder.iterdir() if p.is_file() and p.name not in taken])
        raise InputError(
            f'{source.where(where or (key,))}: {key} = "{name}", but {path} is no file'
            + (near or _preset(name, key) or ": put it there, or name the file that holds it")
        )
    return path


def _preset(name: str, key: str) -> str:
    """What to do where the ``name`` is a preset's: a cell holds its own files."""
    if not name or f"{key}s" not in assets.KINDS or name not in assets.list_presets(f"{key}s"):
        return ""
    return f": it is a preset, and `perceptron-emu init --{key} {name} FOLDER` writes a cell with its file"


def _pose(source: TomlSource, name: str, T_base_jig: Sequence[Sequence[float]], key: str) -> Pose:
    try:
        if not np.allclose(T_base_jig[3], (0, 0, 0, 1), rtol=0, atol=1e-9):
            raise InputError("the last row of a 4 × 4 transform is 0, 0, 0, 1")
        return Pose.from_matrix(T_base_jig, ATOL_ROTATION)
    except InputError as error:
        raise InputError(f"{source.where(('locations', name, key))}: [locations.{name}] {key}: {error}") from None


def _check_location_names(file: CellFile, frames: tuple[Frame, ...], source: TomlSource) -> None:
    """A place given but never seen is harmless, unless a place that was seen is not given: then one is misspelt."""
    seen = list(dict.fromkeys(row.location for row in frames))
    without_pose = [name for name in seen if name not in file.locations]
    for name in file.locations:
        if name not in seen and without_pose:
            near = suggestion(name, seen)
            raise InputError(f"{source.where(('locations', name))}: no frame was taken at location {name}{near}")


def _points(
    folder: Path,
    file: CellFile,
    frames: tuple[Frame, ...],
    frames_path: Path,
    target: Target | Mapping[str, Target],
    remark: Remark,
) -> dict[int, GivenPoints] | None:
    """Points in place of images: named in cell.toml, or points.csv where not one of the images exists."""
    path = folder / (file.points or "points.csv")
    has_images = any(name and (folder / name).exists() for row in frames for name in (row.image, row.profile))
    if file.points is None and (has_images or not path.exists()):
        if frames and not any(row.image or row.profile for row in frames):
            raise InputError(f"{frames_path}: the columns image and profile are empty, and there is no points.csv")
        return None
    at = {row.number: target_at(target, row.location) for row in frames}
    features = tuple(dict.fromkeys(name for t in at.values() for name in t.features))
    surfaces = frozenset(number for number, t in at.items() if isinstance(t, Surface))
    points = read_points(path, features, remark, surfaces)
    known = {row.number for row in frames}
    strangers = sorted(set(points) - known)
    if strangers:
        raise InputError(f"{path}: frame {strangers[0]} stands in no row of {frames_path.name}")
    return points
