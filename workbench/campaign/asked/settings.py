"""What one trial is made of: every setting that a plan may fix or vary, by its dotted name."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, get_args

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from calib import CalibConfig
from extraction import ExtractionConfig
from geometry import TYPICAL_SIGMA, InputError
from perceptron_emu import EmulatorConfig
from workbench import defaults


class Part(BaseModel):
    """A table of settings."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, defer_build=True)


class JigPart(Part):
    """[jig]: the string jig."""

    side_mm: float = Field(100.0, gt=0)
    height_mm: float = Field(100.0, gt=0)
    string_diameter_mm: float = Field(0.3, gt=0)
    tolerance_mm: float = Field(0.1, ge=0, description="full width: each anchor within ± half of it in y and z")
    six_strings: bool = False


class RobotPart(Part):
    """[robot]: the arm and the size of its errors (standard deviations)."""

    preset: str = Field(defaults.ROBOT, description="a robot of the presets")
    joint_sigma_deg: float = Field(TYPICAL_SIGMA["joint_sigma_deg"], ge=0)
    theta_sigma_deg: float = Field(TYPICAL_SIGMA["theta_sigma_deg"], ge=0)
    d_sigma_mm: float = Field(TYPICAL_SIGMA["d_sigma_mm"], ge=0)
    a_sigma_mm: float = Field(TYPICAL_SIGMA["a_sigma_mm"], ge=0)
    alpha_sigma_deg: float = Field(TYPICAL_SIGMA["alpha_sigma_deg"], ge=0)
    error_scale: float = Field(1.0, ge=0, description="factor on the four σ of the table: 0.2 for a measured arm")


class SensorPart(Part):
    """[sensor]: the sensor and how far its real mounting lies from the design."""

    preset: str = Field(defaults.SENSOR, description="a sensor of the presets")
    mount_error_mm: float = Field(1.0, ge=0, description="σ of the SCP's translation about its design value")
    mount_error_deg: float = Field(1.5, ge=0, description="σ of the SCP's rotation about its design value")


class PosesPart(Part):
    """[poses]: how the jig is measured."""

    locations: int = Field(3, ge=1, le=50)
    per_location: int = Field(7, ge=1, le=200)
    verify: int = Field(0, ge=0, le=200, description="frames of one further location that is not used for solving")
    tilt_max_deg: float = Field(35.0, ge=0, le=60)
    roll_max_deg: float = Field(180.0, ge=0, le=180)
    plans: int = Field(8, ge=1, le=1000, description="how many different plans of configurations the trials share")


class TrialSettings(Part):
    """All settings of a trial; ``emulator``, ``extraction`` and ``calib`` are those rooms' own configurations."""

    jig: JigPart = JigPart()
    robot: RobotPart = RobotPart()
    sensor: SensorPart = SensorPart()
    poses: PosesPart = PosesPart()
    clutter: bool = Field(False, description="a wall behind the jig, as in a real cell")
    emulator: EmulatorConfig = EmulatorConfig()
    extraction: ExtractionConfig = ExtractionConfig()
    calib: CalibConfig = CalibConfig()


def with_values(settings: TrialSettings, values: Mapping[str, Any]) -> TrialSettings:
    """``settings`` with the dotted names of ``values`` replaced; InputError names the setting and what it must be."""
    data = settings.model_dump(exclude_unset=True)  # what is unset may come from a preset
    for name, value in values.items():
        *path, last = name.split(".")
        table = data
        for part in path:
            table = table.setdefault(part, {})
        table[last] = value
    try:
        return TrialSettings.model_validate(data)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        name = ".".join(str(p) for p in first["loc"])
        wish = first["msg"].removeprefix("Value error, ").replace("Input should be", "must be")
        raise InputError(f"{name} = {first['input']!r}: {wish}") from None


@cache
def leaf_paths(model: type[BaseModel]) -> tuple[str, ...]:
    """Dotted names of all settings of ``model`` that hold one value."""
    out: list[str] = []
    for name, field in model.model_fields.items():
        inner = field.annotation
        if isinstance(inner, type) and issubclass(inner, BaseModel):
            out += [f"{name}.{path}" for path in leaf_paths(inner)]
        else:
            out.append(name)
    return tuple(out)


def is_whole(model: type[BaseModel], name: str) -> bool:
    """Whether the setting takes whole numbers only."""
    here: Any = model
    for part in name.split("."):
        here = here.model_fields[part].annotation
    kinds = {here, *get_args(here)}
    return int in kinds and float not in kinds
