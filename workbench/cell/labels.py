"""Labels for the spots of a dataset through its robot chain, and for bare images from the jig alone."""

from __future__ import annotations

from dataclasses import replace

from calib import CalibConfig, CalibrationResult
from calib.hands import hand_poses
from calib.label import label_frame
from geometry import Frame, Pose, Sensor
from jig_cad import Jig
from workbench.cell.pipeline import Observed, solve
from workbench.files import Cell


def label_dataset(
    cell: Cell, observed: Observed, config: CalibConfig | None = None, result: CalibrationResult | None = None
) -> tuple[Frame, ...]:
    """Every frame with the labels that calibration gave it: one labelling for result and points alike.

    result: of the same frames, where it is known already.
    """
    return (solve(cell, observed, config) if result is None else result).frames


def label_alone(frame: Frame, jig: Jig, sensor: Sensor) -> Frame:
    """A frame labelled from the jig's geometry alone.

    Parameters
    ----------
    frame
        With its spots.
    jig, sensor
        What the names follow from.

    Returns
    -------
    Frame
        With the reason where nothing could be labelled.

    """
    found = label_frame(frame.points, jig, sensor, None, CalibConfig())
    return replace(frame, axis=found.axis, reason=found.reason, T_sensor_target=found.T_sensor_jig)


def poses_in_sensor(result: CalibrationResult) -> dict[int, Pose]:
    """T_sensor_jig by frame number through the solved robot chain; empty where the solution can not be trusted."""
    if not result.verdict.trustworthy or result.T_hand_sensor is None:
        return {}
    places = {name: p.T_base_target for name, p in result.locations.items() if p.T_base_target is not None}
    frames = [f for f in result.frames if f.location in places]
    if not frames:
        return {}
    hands = hand_poses(frames, result.robot)
    return {f.number: (hands[i] @ result.T_hand_sensor).inverse() @ places[f.location] for i, f in enumerate(frames)}
