"""Labels for the spots of a dataset through its robot chain, and for bare images from the jig alone."""

from __future__ import annotations

from calib import CalibConfig, CalibrationResult, Observations
from calib.label.frame import label_frame
from calib.label.location import label_location
from calib.label.refine import LabelledFrame
from calib.stations import hand_poses
from geometry import AxisPoints, NoAnswerError, Pose, Sensor, SurfacePoints
from jig_cad import Jig
from workbench.cell.pipeline import Observed, solve
from workbench.cell.points_table import FrameTable
from workbench.files import Cell


def label_dataset(
    cell: Cell, observed: Observed, config: CalibConfig | None = None, result: CalibrationResult | None = None
) -> list[FrameTable]:
    """Every frame's spots with labels; the chain is the solved one where the dataset gives a trustworthy solution.

    result: of the same observations, where it is known already.
    """
    config = config or CalibConfig()
    result = _solution(cell, observed, config) if result is None else _trusted(result)
    labels: dict[int, LabelledFrame] = {}
    for location in observed.observations.locations:
        labels |= _label_one_location(cell, observed.observations, location, result, config)
    return [
        FrameTable(f.frame, f.image, f.points, f.axis, f.reason)
        if f.axis is not None
        else _table(f.frame, f.image, f.points, labels.get(f.frame), f.reason)
        for f in observed.observations.frames
    ]


def label_image(frame: int, image: str, points: SurfacePoints, jig: Jig, sensor: Sensor) -> FrameTable:
    """One image's spots with labels from the jig's geometry alone."""
    return _table(frame, image, points, label_frame(points, jig, sensor, None, CalibConfig()), None)


def poses_in_sensor(cell: Cell, observed: Observed, result: CalibrationResult) -> dict[int, Pose]:
    """T_sensor_jig by frame number through the solved robot chain; empty where the solution can not be trusted."""
    solved = _trusted(result)
    if solved is None or solved.T_hand_sensor is None:
        return {}
    places = {name: place.T_base_jig for name, place in solved.locations.items() if place.T_base_jig is not None}
    frames = [f for f in observed.observations.frames if f.location in places]
    if not frames:
        return {}
    hands = hand_poses(frames, solved.robot or cell.robot)
    return {f.frame: (hands[i] @ solved.T_hand_sensor).inverse() @ places[f.location] for i, f in enumerate(frames)}


def _solution(cell: Cell, observed: Observed, config: CalibConfig) -> CalibrationResult | None:
    try:
        return _trusted(solve(cell, observed, config))
    except NoAnswerError:
        return None


def _trusted(result: CalibrationResult) -> CalibrationResult | None:
    return result if result.verdict.trustworthy and result.T_hand_sensor is not None else None


def _label_one_location(
    cell: Cell, observations: Observations, location: str, result: CalibrationResult | None, config: CalibConfig
) -> dict[int, LabelledFrame]:
    frames = [f for f in observations.frames if f.location == location and f.reason is None and f.axis is None]
    if not frames:
        return {}
    robot = cell.robot if result is None or result.robot is None else result.robot
    scp = cell.T_hand_sensor_design if result is None or result.T_hand_sensor is None else result.T_hand_sensor
    solved = result.locations.get(location) if result is not None else None
    jig_pose = solved.T_base_jig if solved is not None else cell.T_base_jig.get(location)
    labelled = label_location(
        [f.points for f in frames],
        hand_poses(frames, robot),
        scp,
        cell.jig,
        observations.sensor,
        config,
        T_base_jig=jig_pose,
        refined=solved is not None,
    )
    return {f.frame: label for f, label in zip(frames, labelled, strict=True)}


def _table(
    frame: int, image: str, points: SurfacePoints, label: LabelledFrame | None, reason: str | None
) -> FrameTable:
    if label is None:
        return FrameTable(frame, image, points, AxisPoints.empty(), reason)
    return FrameTable(frame, image, points, label.axis, reason or label.reason, label.T_sensor_jig)
