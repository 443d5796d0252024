"""Frames made ready to solve: hand pose, labelled axis points, candidate poses of the jig, or a reason why not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.config import CalibConfig
from calib.label.location import label_location
from calib.observation import FrameObservation, Observations
from calib.pose.fit import fit_pose
from geometry import AxisPoints, InputError, NoAnswerError, Pose, RobotModel, Sensor, log_so3, stack_poses
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
    hands = hand_poses(observations.frames, robot)
    return tuple(_station(f, hands[i], robot) for i, f in enumerate(observations.frames))


def hand_poses(frames: Sequence[FrameObservation], robot: RobotModel | None) -> Pose:
    """T_base_hand (F): as given, else of the joint readings by the robot. InputError where there is neither."""
    out: dict[int, Pose] = {i: f.T_base_hand for i, f in enumerate(frames) if f.T_base_hand is not None}
    read = [i for i in range(len(frames)) if i not in out]
    for i in read:
        if robot is None or frames[i].joints_rad is None:
            where = f"frame {frames[i].frame}"
            raise InputError(f"{where} has neither joint readings with a robot nor a hand pose T_base_hand")
    if robot is not None and read:
        moved = robot.hand_pose(np.array([frames[i].joints_rad for i in read]))
        out |= {i: moved[k] for k, i in enumerate(read)}
    return stack_poses([out[i] for i in range(len(frames))])


def label(
    ready: tuple[Station, ...],
    sensor: Sensor,
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
    """Whether a labelled frame has no point far from its string, and its pose is near the chain's: labels are right."""
    if not s.usable or "pose_residual" in s.axis.flag:
        return False
    apart = predicted.inverse() @ s.candidates[0]
    turn = float(np.linalg.norm(log_so3(apart.R)))
    return bool(np.linalg.norm(apart.t) < NEAR_MM and turn < NEAR_RAD)


def _station(frame: FrameObservation, hand: Pose, robot: RobotModel | None) -> Station:
    reason = frame.reason
    if frame.T_base_hand is None and robot is not None and frame.joints_rad is not None and reason is None:
        reason = None if bool(robot.within_limits(frame.joints_rad)) else "robot_out_of_range"
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
