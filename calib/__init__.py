"""From points and robot readings to the sensor centre position, with its uncertainty. Knows no image."""

from calib.as_json import frame_object, location_object, result_object
from calib.calibrate import calibrate
from calib.config import CalibConfig
from calib.printed import printed_sigmas
from calib.result import (
    CalibrationResult,
    Culprit,
    DesignSolved,
    Distances,
    Estimate,
    LocationResult,
    Nominal,
    Pull,
    Verdict,
)
from calib.verify import Verification, verify

__all__ = [
    "CalibConfig",
    "CalibrationResult",
    "Culprit",
    "DesignSolved",
    "Distances",
    "Estimate",
    "LocationResult",
    "Nominal",
    "Pull",
    "Verdict",
    "Verification",
    "calibrate",
    "frame_object",
    "location_object",
    "printed_sigmas",
    "result_object",
    "verify",
]
