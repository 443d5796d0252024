"""sensor.toml (docs/formats.md): the geometry every room needs, and the emulator's own keys beside it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import Field

from geometry import Camera, InputError, Pose, Sensor, Sheet, toml_value
from perceptron_emu import EmulatorConfig
from workbench.files.strict import FileSection, Matrix3, Names, Positive, Real, Vector3, Whole, validate
from workbench.files.toml_text import TomlSource, read_toml

GEOMETRY_OF_LASER = ("origin_mm", "fan_deg")
ATOL_ROTATION = 1e-4  # files are written with as few as four decimals; the rotation is made orthogonal on reading


class ImageSection(FileSection):
    """[image]."""

    width_px: Whole
    height_px: Whole
    bit_depth: Whole = 8
    black_level: Real = 0.0


class CameraPoseSection(FileSection):
    """[camera.pose]: T_sensor_camera."""

    rotation: Matrix3
    translation_mm: Vector3


class CameraSection(FileSection):
    """[camera]: OpenCV's model."""

    fx_px: Positive
    fy_px: Positive
    cx_px: Real
    cy_px: Real
    distortion: tuple[Real, ...] = ()
    pose: CameraPoseSection


class LaserSection(FileSection):
    """[laser]: where the fan opens; its further keys belong to the emulator."""

    origin_mm: Vector3 = (0.0, 0.0, 0.0)
    fan_deg: Positive = 45.0


class SensorFile(FileSection):
    """The part of sensor.toml that every room needs."""

    image: ImageSection
    camera: CameraSection
    laser: LaserSection = Field(default_factory=LaserSection)


@dataclass(frozen=True, eq=False)
class SensorDescription:
    """A sensor as its file gives it: the shared parameters and those of its emulation, with the file's own tables."""

    model: Sensor
    emulator: EmulatorConfig
    emulator_keys: dict[str, Any]


def read_sensor(path: Path) -> SensorDescription:
    """The sensor of a sensor.toml; InputError names file, line and key."""
    source = read_toml(path)
    own = {k: v for k, v in source.data.items() if k in SensorFile.model_fields}
    laser = source.data.get("laser", {})
    if isinstance(laser, dict):
        own["laser"] = {k: v for k, v in laser.items() if k in (*GEOMETRY_OF_LASER, "name")}
    emulation = _emulation_keys(source)
    also: Names = {(): tuple(SensorFile.model_fields), ("laser",): GEOMETRY_OF_LASER}
    emulator = validate(EmulatorConfig, source, emulation, also)
    file = validate(SensorFile, source, own, {(): tuple(EmulatorConfig.model_fields)})
    try:
        return SensorDescription(_model(file), emulator, emulation)
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def _emulation_keys(source: TomlSource) -> dict[str, Any]:
    """The tables of the file without the shared keys and without the names that are welcome everywhere."""
    out: dict[str, Any] = {}
    for key, value in source.data.items():
        if key in ("image", "camera", "name"):
            continue
        shared = ("name", *GEOMETRY_OF_LASER) if key == "laser" else ("name",)
        out[key] = {k: v for k, v in value.items() if k not in shared} if isinstance(value, dict) else value
    return out if out.get("laser", {}) != {} else {k: v for k, v in out.items() if k != "laser"}


def _model(file: SensorFile) -> Sensor:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = file.camera.pose.rotation, file.camera.pose.translation_mm
    camera = Camera(
        width_px=file.image.width_px,
        height_px=file.image.height_px,
        fx_px=file.camera.fx_px,
        fy_px=file.camera.fy_px,
        cx_px=file.camera.cx_px,
        cy_px=file.camera.cy_px,
        T_sensor_camera=Pose.from_matrix(pose, ATOL_ROTATION),
        distortion=file.camera.distortion,
        bit_depth=file.image.bit_depth,
        black_level=file.image.black_level,
    )
    sheet = Sheet(np.array(file.laser.origin_mm), float(np.deg2rad(file.laser.fan_deg)))
    return Sensor(sheet, camera, name=file.name)


def sensor_text(sensor: SensorDescription) -> str:
    """The sensor as the text of a sensor.toml; read back it is the same to the last bit."""
    m, sheet = sensor.model.require_camera(), sensor.model.sheet
    lines = ["# laser-line sensor; frame {P}: laser plane x = 0, y lateral, z depth"]
    lines += [f"name = {toml_value(sensor.model.name)}"] if sensor.model.name else []
    lines += ["[image]", f"width_px = {m.width_px}", f"height_px = {m.height_px}", f"bit_depth = {m.bit_depth}"]
    lines += [f"black_level = {toml_value(float(m.black_level))}"]
    lines += ["[camera]            # OpenCV's model; pixel (0, 0) is the centre of the top-left pixel"]
    lines += [f"{k} = {toml_value(float(getattr(m, k)))}" for k in ("fx_px", "fy_px", "cx_px", "cy_px")]
    lines += [f"distortion = {toml_value([float(v) for v in m.distortion])}"]
    lines += ["[camera.pose]       # T_sensor_camera: camera (x right, y down, z forward) in {P}"]
    lines += [f"rotation = {toml_value(m.T_sensor_camera.R.tolist())}"]
    lines += [f"translation_mm = {toml_value(m.T_sensor_camera.t.tolist())}"]
    lines += ["[laser]", f"origin_mm = {toml_value(sheet.origin_mm.tolist())}"]
    lines += [f"fan_deg = {toml_value(round(float(np.rad2deg(sheet.fan_rad)), 12))}"]
    lines += [f"{k} = {toml_value(v)}" for k, v in sensor.emulator_keys.get("laser", {}).items()]
    for name, table in sensor.emulator_keys.items():
        if name != "laser" and isinstance(table, dict):
            lines += [f"[{name}]", *(f"{k} = {toml_value(v)}" for k, v in table.items())]
    return "\n".join(lines) + "\n"
