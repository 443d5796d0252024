"""One record of a dataset from its file to the answer; stages add to it by ``dataclasses.replace``."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from geometry.configuration import ArmConfiguration
from geometry.points import AxisPoints, SurfacePoints
from geometry.pose import Pose

Array = NDArray[np.float64]
Role = Literal["calibrate", "verify"]

NO_POSES = Pose(np.zeros((0, 3, 3)), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class Frame:
    """One image or profile, where the robot's hand was, and all that was found of it.

    Parameters
    ----------
    number : int
        As in frames.csv.
    location : str
        Where the target stood.
    role : "calibrate" or "verify"
        Whether it may enter the solution or only the figures.
    joints_rad : ndarray (n,) or None
        Joint readings; None where only the hand's pose is known.
    T_base_hand : Pose or None
        The hand's pose as given.
    image, profile : str
        Its file: an image or a profile.
    configuration : ArmConfiguration or None
        Which of the arm's solutions the controller says it was in.
    sensor_fixed : bool
        The sensor stands still and the hand carries the target: ``hand`` and ``T_base_hand`` are then T_hand_base.
    line : int
        Where it stands in frames.csv, 0 where it is in none.
    points : SurfacePoints
        Spots or stripe points as extraction gives them, not labelled.
    axis : AxisPoints
        Labelled points on the target; from labelling, or as given.
    labels_given : bool
        The labels are the user's.
    joints_inferred : bool
        The readings follow from the hand's pose by the nominal table.
    reason : str or None
        Why the frame can not be used ("image_unreadable", "not_labelled" …).
    hand : Pose or None
        T_base_hand as given, else of the readings by the robot.
    candidates : Pose (K)
        Poses T_sensor_target that explain the labelled points.
    n_points : int
        How many points its profile has, of which those in ``axis`` lie on the target; 0 where there is no profile.
    used : bool
        The points entered the solution (calibrate) or the figures (verify).
    residual_mm : ndarray (N,)
        Distance of each labelled point from its feature, the location's own fit; NaN where there is none.
    T_sensor_target : Pose or None
        This frame's own pose, from its points alone.
    """

    number: int
    location: str
    role: Role = "calibrate"
    joints_rad: Array | None = None
    T_base_hand: Pose | None = None
    image: str = ""
    profile: str = ""
    configuration: ArmConfiguration | None = None
    line: int = 0
    sensor_fixed: bool = False
    points: SurfacePoints = field(default_factory=SurfacePoints.empty)
    axis: AxisPoints = field(default_factory=AxisPoints.empty)
    labels_given: bool = False
    joints_inferred: bool = False
    reason: str | None = None
    hand: Pose | None = None
    candidates: Pose = NO_POSES
    n_points: int = 0
    used: bool = False
    residual_mm: Array = field(default_factory=lambda: np.zeros(0))
    T_sensor_target: Pose | None = None

    @property
    def usable(self) -> bool:
        """Whether nothing speaks against using its labelled points."""
        return self.reason is None

    @property
    def at(self) -> Pose:
        """T_base_hand; ValueError before the stage that finds it."""
        if self.hand is None:
            raise ValueError(f"frame {self.number} has no hand pose yet")
        return self.hand

    @property
    def axis_uv_px(self) -> Array:
        """The image points (N, 2) of the labelled points, NaN where only (y, z) was given."""
        uv = np.full((len(self.axis), 2), np.nan)
        seen = self.axis.spot >= 0
        if len(self.points):
            uv[seen] = self.points.uv_px[self.axis.spot[seen]]
        return uv


def locations_of(frames: tuple[Frame, ...]) -> dict[str, list[Frame]]:
    """The frames of every location, in the order of their first frame."""
    out: dict[str, list[Frame]] = {}
    for frame in frames:
        out.setdefault(frame.location, []).append(frame)
    return out
