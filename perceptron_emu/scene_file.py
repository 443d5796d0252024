"""scene.toml: a jig, meshes and panels before one sensor or around a cell, each with its place and material."""

from __future__ import annotations

import difflib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from geometry import InputError, Pose, Sensor, parse_toml, read_text
from jig_cad import read_jig
from jig_cad.solids import jig_solids
from perceptron_emu.check import check_scene
from perceptron_emu.mesh_file import Unit, read_mesh
from perceptron_emu.scene import ALUMINIUM, BLACK_PLATE, MATTE, WALL, Material, Scene, Solid, panel

MATERIALS = {"matte": MATTE, "black": BLACK_PLATE, "aluminium": ALUMINIUM, "wall": WALL}

Vector = tuple[float, float, float]
Frame = Literal["sensor", "jig", "base"]


class SceneTable(BaseModel):
    """A table of scene.toml: unknown keys, NaN and infinities are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)
    name: str = ""


class PlaceTable(SceneTable):
    """A place: rotations about fixed X, Y, Z [deg] and a translation [mm].

    frame: in {P}, in the jig's axes, or in the robot's base. Default: {P} before one sensor, the base around a cell.
    """

    rotation_deg: Vector = (0.0, 0.0, 0.0)
    translation_mm: Vector = (0.0, 0.0, 0.0)
    frame: Frame | None = None
    material: str = "matte"


class SceneJig(SceneTable):
    """[jig]: its file and T_sensor_jig; solids = false leaves out plates and posts."""

    file: str
    rotation_deg: Vector = (0.0, 0.0, 0.0)
    translation_mm: Vector
    solids: bool = True


class MeshTable(PlaceTable):
    """[[mesh]]: STL, OBJ, PLY or GLB. unit: default mm, for GLB m (as glTF has it). open = true allows one with
    holes.
    """

    file: str
    unit: Unit | None = None
    open: bool = False


class PanelTable(PlaceTable):
    """[[panel]]: a flat panel in its own x-y plane, centred."""

    width_mm: Annotated[float, Field(gt=0)]
    height_mm: Annotated[float, Field(gt=0)]
    material: str = "wall"


class MaterialTable(SceneTable):
    """[materials.NAME]: the albedo, the gloss and its width."""

    diffuse: float = 0.5
    specular: float = 0.0
    roughness: float = 0.3
    scatter_mm: float = 0.0


class SceneFile(SceneTable):
    """The tables of a scene.toml.

    Parameters
    ----------
    jig : SceneJig, optional
        Its file and pose; a scene around a cell has none.
    mesh : tuple of MeshTable
        Mesh files with place and material.
    panel : tuple of PanelTable
        Flat panels.
    materials : dict of str to MaterialTable
        By name, beside matte, black, aluminium and wall.
    string_material : str, optional
        Name of the thread's material.
    """

    jig: SceneJig | None = None
    mesh: tuple[MeshTable, ...] = ()
    panel: tuple[PanelTable, ...] = ()
    materials: dict[str, MaterialTable] = {}
    string_material: str | None = None


@dataclass(frozen=True, eq=False)
class Surroundings:
    """What a scene.toml places around a cell, whose own files place jig and sensor.

    Parameters
    ----------
    parts : tuple of (frame, Solid)
        The frame each stands still in, and the solid, its T_sensor_mesh the pose in that frame.
    string_material : Material, optional
        The thread's surface; that of the sensor's file where None.
    """

    parts: tuple[tuple[Frame, Solid], ...] = ()
    string_material: Material | None = None

    def standing_in(self, frame: Frame) -> tuple[Solid, ...]:
        """The solids of one frame."""
        return tuple(solid for own, solid in self.parts if own == frame)


def read_scene(path: Path | str, sensor: Sensor) -> Scene:
    """The scene of a scene.toml before a sensor, its files found beside it.

    Parameters
    ----------
    path : Path or str
        The scene.toml.
    sensor : Sensor
        Stands at the origin of {P}.

    Returns
    -------
    Scene
        Ready to be rendered.

    Raises
    ------
    InputError
        Naming file and key for anything that can not be, and for a scene that the sensor can not see.
    """
    path = Path(path)
    file = _parse(path)
    materials = _materials(path, file)
    jig, T_sensor_jig, solids = None, Pose.identity(), []
    if file.jig is not None:
        jig = read_jig(path.parent / file.jig.file)
        T_sensor_jig = Pose.from_fixed_xyz_deg(file.jig.rotation_deg, file.jig.translation_mm)
        if file.jig.solids:
            for name, mesh in jig_solids(jig, strings=False).items():
                solids.append(Solid(mesh, ALUMINIUM if name.startswith("post") else BLACK_PLATE, T_sensor_jig, name))
    for where, frame, solid in _parts(path, file, materials):
        if frame == "base":
            raise InputError(f'{where}: frame = "base", but a scene before one sensor has no robot')
        if frame == "jig" and jig is None:
            raise InputError(f'{where}: frame = "jig", but the scene has no [jig]')
        solids.append(replace(solid, T_sensor_mesh=T_sensor_jig @ solid.T_sensor_mesh) if frame == "jig" else solid)
    scene = Scene(sensor, jig, T_sensor_jig, tuple(solids), _thread(path, file, materials))
    try:
        check_scene(scene)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None
    return scene


def read_surroundings(path: Path | str) -> Surroundings:
    """What a scene.toml places around a cell.

    Parameters
    ----------
    path : Path or str
        The scene.toml.

    Returns
    -------
    Surroundings
        Its parts by the frame they stand in.

    Raises
    ------
    InputError
        As in `read_scene`, and for a [jig], which the cell has.
    """
    path = Path(path)
    file = _parse(path)
    if file.jig is not None:
        raise InputError(
            f"{path}: [jig]: the cell places its own jig, by jig.toml and [locations]; leave this table out"
        )
    materials = _materials(path, file)
    parts = tuple((frame or "base", solid) for _, frame, solid in _parts(path, file, materials))
    return Surroundings(parts, _thread(path, file, materials))


def _parse(path: Path) -> SceneFile:
    data = parse_toml(read_text(path), str(path))
    try:
        return SceneFile.model_validate(data)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(f"{path}: {key}: {first['msg']}{_suggestion(first)}") from error


def _suggestion(error: Any) -> str:
    if error["type"] != "extra_forbidden":
        return ""
    known = [f for table in (SceneFile, SceneJig, MeshTable, PanelTable, MaterialTable) for f in table.model_fields]
    near = difflib.get_close_matches(str(error["loc"][-1]), known, n=1)
    return f'; did you mean "{near[0]}"?' if near else ""


def _parts(path: Path, file: SceneFile, materials: dict[str, Material]) -> Iterator[tuple[str, Frame | None, Solid]]:
    """Meshes and panels with where they stand in the file and the frame they are placed in."""
    for i, table in enumerate(file.mesh):
        where = f"{path}: mesh[{i}]"
        material = _find(where, table.material, materials)
        mesh = read_mesh(path.parent / table.file, table.unit, allow_open=table.open)
        yield where, table.frame, Solid(mesh, material, _pose(table), table.name or Path(table.file).stem)
    for i, flat in enumerate(file.panel):
        where = f"{path}: panel[{i}]"
        material = _find(where, flat.material, materials)
        solid = panel(flat.width_mm, flat.height_mm, _pose(flat), material, flat.name or f"panel {i}")
        yield where, flat.frame, solid


def _materials(path: Path, file: SceneFile) -> dict[str, Material]:
    return MATERIALS | {k: _material(path, k, m) for k, m in file.materials.items()}


def _thread(path: Path, file: SceneFile, materials: dict[str, Material]) -> Material | None:
    return _find(f"{path}: string_material", file.string_material, materials) if file.string_material else None


def _pose(table: PlaceTable) -> Pose:
    return Pose.from_fixed_xyz_deg(np.array(table.rotation_deg), np.array(table.translation_mm))


def _material(path: Path, name: str, table: MaterialTable) -> Material:
    try:
        return Material(table.diffuse, table.specular, table.roughness, table.scatter_mm)
    except InputError as error:
        raise InputError(f"{path}: materials.{name}: {error}") from error


def _find(where: str, name: str, materials: dict[str, Material]) -> Material:
    if name not in materials:
        raise InputError(f'{where}: material "{name}" is not known; there are {", ".join(sorted(materials))}')
    return materials[name]
