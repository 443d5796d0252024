"""What calibration is given: the frames of a cell, with their spots and the robot's readings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from geometry import AxisPoints, Pose, Sensor, SurfacePoints

Array = NDArray[np.float64]
Role = Literal["calibrate", "verify"]


@dataclass(frozen=True, eq=False)
class FrameObservation:
    """One image's spots and where the robot's hand was.

    points: the unlabelled spots. axis: labelled axis points where they are given instead (points.csv).
    joints_rad: joint readings (n,), or None where only T_base_hand is known. joints_inferred: they follow from it.
    reason: why the frame can not be used already ("image_unreadable"), or None.
    """

    frame: int
    location: str
    role: Role
    points: SurfacePoints = field(default_factory=SurfacePoints.empty)
    joints_rad: Array | None = None
    T_base_hand: Pose | None = None
    axis: AxisPoints | None = None
    image: str = ""
    reason: str | None = None
    joints_inferred: bool = False


@dataclass(frozen=True, eq=False)
class Observations:
    """All frames of a cell, the sensor, the design SCP, and jig poses that are given (may be empty)."""

    frames: tuple[FrameObservation, ...]
    sensor: Sensor
    T_hand_sensor_design: Pose
    T_base_jig: dict[str, Pose] = field(default_factory=dict)

    @property
    def locations(self) -> tuple[str, ...]:
        """Names of the jig's locations in the order of their first frame."""
        return tuple(dict.fromkeys(f.location for f in self.frames))
