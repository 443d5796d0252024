"""sensor.toml (docs/formats.md): the geometry every room needs, and the emulator's own keys beside it."""

from __future__ import annotations

from dataclasses import fields, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from geometry import Camera, InputError, Pose, Sensor, Sheet, toml_value
from geometry.sensor import AUTO, DirectMap, Optics, ProfileOutput, SensorUncertainty
from perceptron_emu import EmulatorConfig
from workbench.files.strict import (
    FileSection,
    Matrix3,
    Names,
    NotNegative,
    Positive,
    Real,
    Text,
    Vector3,
    Whole,
    YesNo,
    suggestion,
    validate,
)
from workbench.files.toml_text import TomlSource, read_toml

OPTICS_KEYS = tuple(f.name for f in fields(Optics))
GEOMETRY_OF_LASER = ("origin_mm", "fan_deg")
USUAL_STANDOFF_MM = 200.0  # of line profilers that suit a jig, from the face to the field; the fan is nearly parallel
ATOL_ROTATION = 1e-4  # files are written with as few as four decimals; the rotation is made orthogonal on reading


class ImageSection(FileSection):
    """[image]."""

    width_px: Whole
    height_px: Whole
    bit_depth: Whole = 8
    black_level: Real = 0.0
    saturation_dn: Whole | None = None
    channel: Literal["red", "green", "blue", "grey", "max"] | None = None


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


class ProfileSection(FileSection):
    """[profile]: in place of [image] and [camera], of a sensor that gives profiles."""

    format: Text = AUTO
    sigma_y_mm: Positive | None = None
    sigma_z_mm: Positive | None = None
    field_of_view_mm: tuple[tuple[Real, Real], ...] | None = None
    pitch_mm: Positive | None = None
    start_mm: Real | None = None
    unit: Whole | None = None
    width: Whole | None = None
    z_towards_sensor: YesNo = False


class SensorUncertaintySection(FileSection):
    """[uncertainty]: standard deviations by name, or names with a covariance; angles of the plane in degrees."""

    source: Literal["calibrated", "data sheet", "drawing"] | None = None
    parameters: tuple[Text, ...] | None = None
    covariance: tuple[tuple[Real, ...], ...] | None = None
    tangent_covariance: tuple[tuple[Real, ...], ...] | None = None
    fx_px: NotNegative | None = None
    fy_px: NotNegative | None = None
    cx_px: NotNegative | None = None
    cy_px: NotNegative | None = None
    k1: NotNegative | None = None
    k2: NotNegative | None = None
    p1: NotNegative | None = None
    p2: NotNegative | None = None
    k3: NotNegative | None = None
    k4: NotNegative | None = None
    k5: NotNegative | None = None
    k6: NotNegative | None = None
    s1: NotNegative | None = None
    s2: NotNegative | None = None
    s3: NotNegative | None = None
    s4: NotNegative | None = None
    tau_x: NotNegative | None = None
    tau_y: NotNegative | None = None
    plane_tilt_y_deg: NotNegative | None = None
    plane_tilt_z_deg: NotNegative | None = None
    plane_shift_mm: NotNegative | None = None
    scale_y: NotNegative | None = None
    scale_z: NotNegative | None = None


SIGMAS = tuple(
    k
    for k in SensorUncertaintySection.model_fields
    if k not in ("name", "source", "parameters", "covariance", "tangent_covariance")
)


class HousingSection(FileSection):
    """[housing]: the box in {P} that the sensor's housing fills."""

    min_mm: Vector3
    max_mm: Vector3


class DirectSection(FileSection):
    """[direct]: a map from pixels to the laser plane, in place of the camera's model."""

    homography: Matrix3 | None = None
    polynomial: tuple[tuple[Whole, Whole, Real, Real], ...] | None = None
    rms_mm: NotNegative = 0.0
    seen_px: tuple[Real, Real, Real, Real] | None = None


class SensorFile(FileSection):
    """The part of sensor.toml that every room needs."""

    image: ImageSection | None = None
    camera: CameraSection | None = None
    profile: ProfileSection | None = None
    laser: LaserSection = Field(default_factory=LaserSection)
    uncertainty: SensorUncertaintySection | None = None
    direct: DirectSection | None = None
    housing: HousingSection | None = None


SHARED_TABLES = (
    "image",
    "camera",
    "profile",
    "uncertainty",
    "direct",
    "housing",
)  # of no concern to the emulator; [laser] is both's


def read_sensor(path: Path) -> Sensor:
    """The sensor of a sensor.toml; what only its emulation needs is `read_emulator`'s.

    Parameters
    ----------
    path
        The file.

    Returns
    -------
    Sensor
        Sheet and camera in {P}, and the optics where the file states them.

    Raises
    ------
    InputError
        Naming file, line and key.

    """
    file, emulator = _read(path)
    try:
        return replace(_sensor(file), optics=stated_optics(emulator), housing_mm=_housing(file.housing))
    except InputError as error:
        raise InputError(f"{path}: {error}") from None


def read_emulator(path: Path) -> EmulatorConfig:
    """How the sensor of a sensor.toml is emulated; the keys that the file states are the model's fields set."""
    return _read(path)[1]


def _read(path: Path) -> tuple[SensorFile, EmulatorConfig]:
    source = read_toml(path)
    own = {k: v for k, v in source.data.items() if k in SensorFile.model_fields}
    laser = source.data.get("laser", {})
    if isinstance(laser, dict):
        own["laser"] = {k: v for k, v in laser.items() if k in (*GEOMETRY_OF_LASER, "name")}
    also: Names = {(): tuple(SensorFile.model_fields), ("laser",): GEOMETRY_OF_LASER}
    emulator = validate(EmulatorConfig, source, _emulation_keys(source), also)
    return validate(SensorFile, source, own, {(): tuple(EmulatorConfig.model_fields)}), emulator


def _emulation_keys(source: TomlSource) -> dict[str, Any]:
    """The tables of the file without the shared keys and without the names that are welcome everywhere."""
    out: dict[str, Any] = {}
    for key, value in source.data.items():
        if key in (*SHARED_TABLES, "name"):
            continue
        shared = ("name", *GEOMETRY_OF_LASER) if key == "laser" else ("name",)
        out[key] = {k: v for k, v in value.items() if k not in shared} if isinstance(value, dict) else value
    return out if out.get("laser", {}) != {} else {k: v for k, v in out.items() if k != "laser"}


def stated_optics(emulator: EmulatorConfig) -> Optics | None:
    """What a configuration states of light and lens, its defaults left out."""
    stated = emulator.model_dump(exclude_unset=True, include={"laser", "optics"})
    values = {k: v for table in stated.values() for k, v in table.items() if k in OPTICS_KEYS}
    return Optics(**values) if values else None


def _sensor(file: SensorFile) -> Sensor:
    sheet = Sheet(np.array(_emitter(file)), float(np.deg2rad(file.laser.fan_deg)))
    uncertainty = None if file.uncertainty is None else _uncertainty(file.uncertainty)
    if file.profile is not None:
        for name, table in (("image", file.image), ("camera", file.camera), ("direct", file.direct)):
            if table is not None:
                raise InputError(f"[{name}] and [profile] stand side by side: a sensor gives images or profiles")
        return Sensor(sheet, profile=_profile(file.profile), uncertainty=uncertainty, name=file.name)
    if file.image is None or file.camera is None:
        missing = "image" if file.image is None else "camera"
        raise InputError(f"the table [{missing}] is missing; a sensor without a camera has [profile]")
    direct = None if file.direct is None else _direct(file.direct)
    return Sensor(sheet, _camera(file.image, file.camera), uncertainty=uncertainty, name=file.name, direct=direct)


def _direct(given: DirectSection) -> DirectMap:
    matrix = None if given.homography is None else np.array(given.homography, dtype=float)
    return DirectMap(matrix, given.polynomial or (), given.rms_mm, given.seen_px)


def _housing(given: HousingSection | None) -> NDArray[np.float64] | None:
    return None if given is None else np.array([given.min_mm, given.max_mm])


def _emitter(file: SensorFile) -> Vector3:
    """Where the fan opens: as stated; of a profile sensor that counts z towards itself, beyond its field."""
    profile = file.profile
    if profile is None or not profile.z_towards_sensor or "origin_mm" in file.laser.model_fields_set:
        return file.laser.origin_mm
    if profile.field_of_view_mm is None:
        return (0.0, 0.0, USUAL_STANDOFF_MM)
    return (0.0, 0.0, max(z for _, z in profile.field_of_view_mm) + USUAL_STANDOFF_MM)


def _camera(image: ImageSection, camera: CameraSection) -> Camera:
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = camera.pose.rotation, camera.pose.translation_mm
    return Camera(
        width_px=image.width_px,
        height_px=image.height_px,
        fx_px=camera.fx_px,
        fy_px=camera.fy_px,
        cx_px=camera.cx_px,
        cy_px=camera.cy_px,
        T_sensor_camera=Pose.from_matrix(pose, ATOL_ROTATION),
        distortion=camera.distortion,
        bit_depth=image.bit_depth,
        black_level=image.black_level,
        stated_saturation_dn=image.saturation_dn,
        channel=image.channel,
    )


def _profile(given: ProfileSection) -> ProfileOutput:
    polygon = given.field_of_view_mm
    return ProfileOutput(
        format=given.format,
        sigma_y_mm=given.sigma_y_mm,
        sigma_z_mm=given.sigma_z_mm,
        field_of_view_mm=None if polygon is None else np.array(polygon, dtype=float).reshape(-1, 2),
        pitch_mm=given.pitch_mm,
        start_mm=given.start_mm,
        unit=given.unit,
        width=given.width,
        z_towards_sensor=given.z_towards_sensor,
    )


def _uncertainty(given: SensorUncertaintySection) -> SensorUncertainty:
    """Degrees of the file become radians, of names and numbers alike."""
    values = given.model_dump(exclude_none=True, include=set(SIGMAS))
    if given.parameters is None and given.covariance is None and given.tangent_covariance is None:
        sigma = {_inside(name): value * _scale(name) for name, value in values.items()}
        return SensorUncertainty.from_sigma(sigma, given.source)
    if given.parameters is None or given.covariance is None:
        missing = "parameters" if given.parameters is None else "covariance"
        raise InputError(f"[uncertainty] {missing} is missing: parameters and covariance go together")
    for name in given.parameters:
        if name not in SIGMAS:
            raise InputError(f'[uncertainty] "{name}" is no parameter of a sensor{suggestion(name, SIGMAS)}')
    if values:
        raise InputError(f"[uncertainty] {next(iter(values))} stands beside covariance: give σ by name or a covariance")
    names = tuple(map(_inside, given.parameters))
    covariance = _matrix("covariance", given.covariance, given.parameters)
    tangent = given.tangent_covariance
    return SensorUncertainty(
        names,
        covariance,
        given.source,
        None if tangent is None else _matrix("tangent_covariance", tangent, given.parameters),
    )


def _matrix(key: str, rows: tuple[tuple[float, ...], ...], names: tuple[str, ...]) -> NDArray[np.float64]:
    """A covariance of the file in the units of the code."""
    count = len(names)
    if [len(row) for row in rows] != [count] * count:
        raise InputError(f"[uncertainty] {key} must be {count} × {count}, a row and a column for each parameter")
    scale = np.array([_scale(name) for name in names])
    return np.asarray(np.array(rows, dtype=float).reshape(count, count) * np.outer(scale, scale))


def _inside(name: str) -> str:
    """The name of a file's parameter in the code: angles are radians there."""
    return f"{name[:-4]}_rad" if name.endswith("_deg") else name


def _scale(name: str) -> float:
    return float(np.deg2rad(1.0)) if name.endswith("_deg") else 1.0


def sensor_text(sensor: Sensor, emulator: EmulatorConfig) -> str:
    """Sensor and emulation as the text of a sensor.toml; read back they are the same to the last bit."""
    keys = emulator.model_dump(exclude_unset=True)
    lines = ["# laser-line sensor; frame {P}: laser plane x = 0, y lateral, z depth"]
    lines += [f"name = {toml_value(sensor.name)}"] if sensor.name else []
    lines += [] if sensor.camera is None else _camera_lines(sensor.camera)
    lines += [] if sensor.profile is None else _profile_lines(sensor.profile)
    lines += ["[laser]", f"origin_mm = {toml_value(sensor.sheet.origin_mm.tolist())}"]
    lines += [f"fan_deg = {toml_value(round(float(np.rad2deg(sensor.sheet.fan_rad)), 12))}"]
    lines += [f"{k} = {toml_value(v)}" for k, v in keys.get("laser", {}).items() if v is not None]
    lines += [] if sensor.uncertainty is None else _uncertainty_lines(sensor.uncertainty)
    lines += [] if sensor.direct is None else _direct_lines(sensor.direct)
    if sensor.housing_mm is not None:
        corners = zip(("min_mm", "max_mm"), sensor.housing_mm.tolist(), strict=True)
        lines += [
            "[housing]           # the box that the sensor fills",
            *(f"{k} = {toml_value(v)}" for k, v in corners),
        ]
    for name, table in keys.items():
        if name != "laser":
            lines += [f"[{name}]", *(f"{k} = {toml_value(v)}" for k, v in table.items() if v is not None)]
    return "\n".join(lines) + "\n"


def _camera_lines(c: Camera) -> list[str]:
    lines = ["[image]", f"width_px = {c.width_px}", f"height_px = {c.height_px}", f"bit_depth = {c.bit_depth}"]
    lines += [f"black_level = {toml_value(float(c.black_level))}"]
    lines += [] if c.stated_saturation_dn is None else [f"saturation_dn = {c.stated_saturation_dn}"]
    lines += [] if c.channel is None else [f"channel = {toml_value(c.channel)}"]
    lines += ["[camera]            # OpenCV's model; pixel (0, 0) is the centre of the top-left pixel"]
    lines += [f"{k} = {toml_value(float(getattr(c, k)))}" for k in ("fx_px", "fy_px", "cx_px", "cy_px")]
    lines += [f"distortion = {toml_value([float(v) for v in c.distortion])}"]
    lines += ["[camera.pose]       # T_sensor_camera: camera (x right, y down, z forward) in {P}"]
    lines += [f"rotation = {toml_value(c.T_sensor_camera.R.tolist())}"]
    return [*lines, f"translation_mm = {toml_value(c.T_sensor_camera.t.tolist())}"]


def _profile_lines(p: ProfileOutput) -> list[str]:
    polygon = None if p.field_of_view_mm is None else p.field_of_view_mm.tolist()
    values = {**{f.name: getattr(p, f.name) for f in fields(p)}, "field_of_view_mm": polygon}
    return ["[profile]", *(f"{k} = {toml_value(v)}" for k, v in values.items() if v is not None)]


def _direct_lines(direct: DirectMap) -> list[str]:
    if direct.homography is not None:
        lines = ["[direct]            # u v 1 -> y z 1, in place of the camera's model"]
        lines += [f"homography = {toml_value(direct.homography.tolist())}"]
    else:
        lines = ["[direct]            # i, j, y, z of u^i v^j, from the image's centre over its half diagonal"]
        lines += [f"polynomial = {toml_value([list(row) for row in direct.polynomial])}"]
    lines += [f"rms_mm = {toml_value(direct.rms_mm)}"]
    return lines if direct.seen_px is None else [*lines, f"seen_px = {toml_value(list(direct.seen_px))}"]


def _uncertainty_lines(u: SensorUncertainty) -> list[str]:
    """As parameters and covariance, in the file's units, rounded where degrees would show the last bits of π."""
    names = [f"{n[:-4]}_deg" if n.endswith("_rad") else n for n in u.parameters]
    scale = np.array([_scale(name) for name in names])
    covariance = u.covariance / np.outer(scale, scale)
    lines = ["[uncertainty]"] + ([f"source = {toml_value(u.source)}"] if u.source else [])
    if not names:
        return lines
    alone = u.tangent_covariance is None
    if alone and np.array_equal(u.covariance, np.diag(np.diag(u.covariance))):
        sigma = np.sqrt(np.diag(covariance))
        return lines + [f"{k} = {toml_value(float(f'{v:.15g}'))}" for k, v in zip(names, sigma, strict=True)]
    lines += [f"parameters = {toml_value(names)}"]
    for key, matrix in (("covariance", u.covariance), ("tangent_covariance", u.tangent_covariance)):
        if matrix is not None:
            rows = [[float(f"{v:.15g}") for v in row] for row in matrix / np.outer(scale, scale)]
            lines += [f"{key} = {toml_value(rows)}"]
    return lines
