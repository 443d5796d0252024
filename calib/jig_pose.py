"""Jig pose of one frame by weighted least squares over the strings' crossings of the laser plane."""

from __future__ import annotations

from calib.jig_pose_types import JigPoseResult
from geometry import AxisPoints, Pose
from jig_cad import Jig


def jig_pose(axis: AxisPoints, jig: Jig, guess: Pose | None = None, anchor_sigma_mm: float = 0.0) -> JigPoseResult:
    """All poses T_sensor_jig that explain labelled axis points, by weighted least squares.

    axis: at least three points. guess: pose that picks among exact candidates, and a start where too few strings remain.
    anchor_sigma_mm: σ of the anchors in y and z, carried into the weights where not 0.
    Raises NoAnswerError where fewer than three strings are given or none converges.
    """
    raise NotImplementedError
