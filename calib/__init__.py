"""From points and robot readings to the sensor centre position, with its uncertainty. Knows no image."""

from calib.calibrate import calibrate
from calib.config import CalibConfig
from calib.result import CalibrationResult, DesignSolved, Distances, Estimate, LocationResult, Verdict

__all__ = [
    "CalibConfig",
    "CalibrationResult",
    "DesignSolved",
    "Distances",
    "Estimate",
    "LocationResult",
    "Verdict",
    "calibrate",
]
