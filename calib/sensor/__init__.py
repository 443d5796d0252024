"""A sensor's own calibration from views of a board with the laser's stripe on it: camera, laser plane, uncertainty."""

from calib.sensor.calibrate import SensorSettings, calibrate_sensor
from calib.sensor.choice import Tried
from calib.sensor.direct import DirectModel, fit_direct
from calib.sensor.result import SensorCalibration, SensorSolution, SensorVerdict, ViewResult
from calib.sensor.shape import FoundShape
from calib.sensor.tilts import PossibleTilts
from calib.sensor.views import BoardView, Corners, StripePoints

__all__ = [
    "BoardView",
    "Corners",
    "DirectModel",
    "FoundShape",
    "PossibleTilts",
    "SensorCalibration",
    "SensorSettings",
    "SensorSolution",
    "SensorVerdict",
    "StripePoints",
    "Tried",
    "ViewResult",
    "calibrate_sensor",
    "fit_direct",
]
