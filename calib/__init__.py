"""From points and robot readings to the sensor centre position, with its uncertainty. Knows no image."""

from calib.calibrate import calibrate
from calib.config import CalibConfig
from calib.printed import printed_sigmas
from calib.result import CalibrationResult, DesignSolved, Distances, Estimate, LocationResult, Verdict
from calib.verify import Verification, verify

__all__ = [
    "CalibConfig",
    "CalibrationResult",
    "DesignSolved",
    "Distances",
    "Estimate",
    "LocationResult",
    "Verdict",
    "Verification",
    "calibrate",
    "printed_sigmas",
    "verify",
]
