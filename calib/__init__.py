"""From string points and robot readings to the sensor centre position, with its uncertainty. Knows no image."""

from calib.calibrate import calibrate
from calib.config import CalibConfig
from calib.observation import FrameObservation, Observations
from calib.result import (
    CalibrationResult,
    DesignSolved,
    Distances,
    FramePoints,
    FrameResult,
    LocationResult,
    Verdict,
)

__all__ = [
    "CalibConfig",
    "CalibrationResult",
    "DesignSolved",
    "Distances",
    "FrameObservation",
    "FramePoints",
    "FrameResult",
    "LocationResult",
    "Observations",
    "Verdict",
    "calibrate",
]
