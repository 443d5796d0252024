"""The laser-line sensor: its sheet, and what looks at it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.sensor.camera import Camera
from geometry.sensor.direct import DirectMap
from geometry.sensor.optics import Optics
from geometry.sensor.profile import ProfileOutput
from geometry.sensor.sheet import Sheet
from geometry.sensor.uncertainty import CAMERA_PARAMETERS, SensorUncertainty

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Sensor:
    """A laser-line sensor; a measured point is (0, y, z) in its frame {P}.

    Parameters
    ----------
    sheet : Sheet
        The laser fan in the plane x = 0.
    camera : Camera or None
        What sees the sheet; None where the sensor gives profiles.
    optics : Optics or None
        What is stated of light and lens; None where nothing is.
    profile : ProfileOutput or None
        How a sensor without a camera tells its points.
    uncertainty : SensorUncertainty or None
        Of the sensor's own calibration.
    name : str
        As its maker or its file calls it.
    housing_mm : Array or None
        Least and largest corner (2, 3) in {P} of the box that its housing fills; None where it is not stated.
    direct : DirectMap or None
        What takes pixels to the sheet in place of the camera's model; None where the camera does.

    Raises
    ------
    InputError
        Where the parts do not go together.
    """

    sheet: Sheet
    camera: Camera | None = None
    optics: Optics | None = None
    profile: ProfileOutput | None = None
    uncertainty: SensorUncertainty | None = None
    name: str = ""
    housing_mm: Array | None = None
    direct: DirectMap | None = None

    def __post_init__(self) -> None:
        if self.housing_mm is not None and not np.all(self.housing_mm[0] < self.housing_mm[1]):
            raise InputError("[housing] min_mm must lie below max_mm in x, y and z")
        if self.camera is not None and self.profile is not None:
            raise InputError("a sensor has [camera] or [profile], not both: it gives images or profiles")
        if self.camera is None and self.direct is not None:
            raise InputError("[direct] takes pixels to the laser plane: it needs [image] and [camera] beside it")
        if self.camera is None and self.uncertainty is not None:
            stray = [name for name in self.uncertainty.parameters if name in CAMERA_PARAMETERS]
            if stray:
                raise InputError(f"[uncertainty] {stray[0]} is a camera's, and the sensor has none")

    def require_camera(self) -> Camera:
        """The camera; InputError where the sensor has none."""
        if self.camera is None:
            named = f' "{self.name}"' if self.name else ""
            raise InputError(f"the sensor{named} has no camera: this needs a sensor.toml with [image] and [camera]")
        return self.camera

    @property
    def viewpoints_mm(self) -> Array:
        """What a point must lie open to, in {P} (K, 3) [mm]: the emitter, and the camera where there is one."""
        return np.stack([self.sheet.origin_mm, *([] if self.camera is None else [self.camera.centre_mm])])

    def with_camera(self, **changes: Any) -> Sensor:
        """The same sensor with some of its camera's fields changed."""
        return replace(self, camera=replace(self.require_camera(), **changes))
