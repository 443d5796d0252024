"""The laser-line sensor: its sheet, and what looks at it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from geometry.errors import InputError
from geometry.sensor.camera import Camera
from geometry.sensor.sheet import Sheet


@dataclass(frozen=True, eq=False)
class Sensor:
    """A laser-line sensor; a measured point is (0, y, z) in its frame {P}.

    Parameters
    ----------
    sheet : Sheet
        The laser fan in the plane x = 0.
    camera : Camera or None
        What sees the sheet; None where the sensor gives profiles.
    name : str
        As its maker or its file calls it.
    """

    sheet: Sheet
    camera: Camera | None = None
    name: str = ""

    def require_camera(self) -> Camera:
        """The camera; InputError where the sensor has none."""
        if self.camera is None:
            raise InputError(f"the sensor{f' {self.name}' * bool(self.name)} has no camera: images mean nothing to it")
        return self.camera

    def with_camera(self, **changes: Any) -> Sensor:
        """The same sensor with some of its camera's fields changed."""
        return replace(self, camera=replace(self.require_camera(), **changes))
