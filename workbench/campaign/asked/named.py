"""The robots and sensors that a plan names: they must be there, and their content is part of what the plan is."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from geometry import InputError, read_bytes
from workbench.cell import find_emulator, find_robot, find_sensor, preset_path
from workbench.files import TomlSource, urdf_of

if TYPE_CHECKING:
    from workbench.campaign.asked.plan import Plan

SETTINGS = {"robot.preset": "robots", "sensor.preset": "sensors"}


def check_named(plan: Plan, source: TomlSource | None = None) -> None:
    """InputError, with the line of ``source``, where a robot or sensor that ``plan`` names is not there or is none."""
    for setting, name, place in _named(plan):
        try:
            if setting == "robot.preset":
                find_robot(name)
            else:
                find_sensor(name).require_camera()
                find_emulator(name)
        except InputError as error:
            where = "" if source is None else f"{source.where(place)}: "
            raise InputError(f"{where}{setting}: {error}") from None


def contents(plan: Plan) -> dict[str, str]:
    """SHA-256 of every file that ``plan`` names, presets too, by setting and name."""
    out = {}
    for setting, name, _ in _named(plan):
        digest = hashlib.sha256()
        for path in _files(setting, name):
            digest.update(read_bytes(path))
        out[f"{setting} = {name}"] = digest.hexdigest()
    return dict(sorted(out.items()))


def _files(setting: str, name: str) -> Iterator[Path]:
    path = preset_path(SETTINGS[setting], name)
    yield path
    if setting == "robot.preset" and (chain := urdf_of(path)) is not None:
        yield chain.path


def _named(plan: Plan) -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Setting, name and place in the file; what a factor varies, the base does not decide."""
    for setting in SETTINGS:
        part, key = setting.split(".")
        factor = plan.factors.get(setting)
        if factor is None:
            yield setting, getattr(getattr(plan.base, part), key), ("base", part, key)
        elif isinstance(factor, list):
            yield from ((setting, str(value), ("factors", setting)) for value in factor)
