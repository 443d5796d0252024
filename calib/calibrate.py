"""From observed frames to the sensor centre position: labels, axis points, poses, SCP, verdict."""

from __future__ import annotations

from calib.config import CalibConfig
from calib.observation import Observations
from calib.result import CalibrationResult
from geometry import RobotModel
from jig_cad import Jig


def calibrate(
    observations: Observations, jig: Jig, robot: RobotModel | None, config: CalibConfig | None = None
) -> CalibrationResult:
    """Solve the sensor centre position from all frames; ``robot`` may be None where every frame has T_base_hand."""
    raise NotImplementedError
