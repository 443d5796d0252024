"""Frames made ready to solve: hand pose, labelled axis points, candidate poses of the jig, or a reason why not."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.jig_pose import fit_pose
from calib.label_location import label_location
from calib.observation import FrameObservation, Observations
from geometry import AxisPoints, InputError, NoAnswerError, Pose, RobotModel, SensorModel, log_so3, stack_poses
from jig_cad import Jig

Array = NDArray[np.float64]

MIN_STRINGS = 3
NEAR_MM, NEAR_RAD = 5.0, float(np.deg2rad(1.0))  # the surface offset needs the pose to a degree


@dataclass(frozen=True, eq=False)
class Station:
    """A frame with its hand pose by the robot, labelled points and the poses T_sensor_jig that explain them (K).

    reason: why it can not be used, or None.
    """

    observation: FrameObservation
    T_base_hand: Pose
    axis: AxisPoints
    candidates: Pose
    reason: str | None

    @property
    def usable(self) -> bool:
        """Whether the frame has points and a pose to start from."""
        return self.reason is None


_NO_POSES = Pose(np.zeros((0, 3, 3)), np.zeros((0, 3)))


def stations(observations: Observations, robot: RobotModel | None) -> tuple[Station, ...]:
    """Every frame with its hand pose; not labelled yet. InputError where neither joints nor pose are given."""
    return tuple(_station(f, robot) for f in observations.frames)


def label(
    ready: tuple[Station, ...],
    sensor: SensorModel,
    T_hand_sensor: Pose,
    T_base_jig: dict[str, Pose],
    jig: Jig,
    config: CalibConfig,
    refined: bool = False,
) -> tuple[Station, ...]:
    """Label all frames, location by location; ``T_base_jig`` where known."""
    out = {s.observation.frame: s for s in ready}
    for name in dict.fromkeys(s.observation.location for s in ready):
        group = [s for s in ready if s.observation.location == name and s.observation.reason is None]
        open_ones = [s for s in group if s.observation.axis is None and s.reason != "robot_out_of_range"]
        for s in group:
            if s.observation.axis is not None:
                out[s.observation.frame] = _given(s, jig)
        if open_ones:
            hands = stack_poses([s.T_base_hand for s in open_ones])
            spots = [s.observation.points for s in open_ones]
            found = label_location(spots, hands, T_hand_sensor, jig, sensor, config, T_base_jig.get(name), refined)
            for s, f in zip(open_ones, found, strict=True):
                poses = [c.T_sensor_jig for c in f.candidates] or (
                    [f.T_sensor_jig] if f.T_sensor_jig is not None else []
                )
                reason = f.reason or (None if poses else "not_labelled")
                out[s.observation.frame] = replace(s, axis=f.axis, candidates=stack_poses(poses), reason=reason)
    return tuple(out[s.observation.frame] for s in ready)


def stays(s: Station, predicted: Pose) -> bool:
    """Whether a labelled frame has no flag and its pose is so near the chain's that its surface offsets are right."""
    if not s.usable or any(s.axis.flag):
        return False
    apart = predicted.inverse() @ s.candidates[0]
    turn = float(np.linalg.norm(log_so3(apart.R)))
    return bool(np.linalg.norm(apart.t) < NEAR_MM and turn < NEAR_RAD)


def _station(frame: FrameObservation, robot: RobotModel | None) -> Station:
    reason = frame.reason
    if frame.T_base_hand is not None:
        hand = frame.T_base_hand
    elif frame.joints_rad is None or robot is None:
        raise InputError(f"frame {frame.frame} has neither joint readings with a robot nor a hand pose T_base_hand")
    else:
        hand = robot.hand_pose(frame.joints_rad)
        if reason is None and not bool(robot.within_limits(frame.joints_rad)):
            reason = "robot_out_of_range"
    return Station(frame, hand, AxisPoints.empty(), _NO_POSES, reason)


def _given(s: Station, jig: Jig) -> Station:
    """A frame whose labelled axis points were given; a pose that does not exist leaves it out."""
    axis = s.observation.axis
    if s.reason == "robot_out_of_range" or axis is None:
        return replace(s, axis=axis or AxisPoints.empty())
    if len(set(axis.label)) < MIN_STRINGS:
        return replace(s, axis=axis, reason="too_few_spots" if len(axis) else "no_spots")
    try:
        found = fit_pose(axis, jig)
    except NoAnswerError:
        return replace(s, axis=axis, reason="not_labelled")
    return replace(s, axis=axis, candidates=stack_poses([c.T_sensor_jig for c in found.candidates]), reason=None)
