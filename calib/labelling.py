"""Which spot is which string: labels from the jig's geometry, among clutter."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

from calib.config import CalibConfig
from calib.jig_pose_types import JigPoseCandidate
from geometry import AxisPoints, Pose, SensorModel, SurfacePoints
from jig_cad import Jig

LabelReason = Literal["no_spots", "too_few_spots", "not_labelled"]


@dataclass(frozen=True, eq=False)
class LabelledFrame:
    """One frame's strings: axis points in the order of the jig's strings, and the pose that explains them.

    candidates: poses that explain the same labels (the mirror), most likely first. cost: χ² of the chosen pose,
    anchors' tolerance included, at ``dof``. reason: why nothing was labelled, or None.
    """

    axis: AxisPoints = field(default_factory=AxisPoints.empty)
    T_sensor_jig: Pose | None = None
    candidates: tuple[JigPoseCandidate, ...] = ()
    cost: float = float("nan")
    dof: int = 0
    reason: LabelReason | None = None


def label_frame(
    points: SurfacePoints,
    jig: Jig,
    sensor: SensorModel,
    T_sensor_jig_guess: Pose | None,
    config: CalibConfig,
) -> LabelledFrame:
    """Label one frame's spots.

    With a guess of the pose (wrong by several mm and a few degrees) three or four strings suffice; without, five are
    needed (four where nothing else fits) and the half turn is chosen so that x_jig · x_sensor > 0.
    """
    raise NotImplementedError
