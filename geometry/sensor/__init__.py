"""The sensor: laser sheet, camera or profile output, stated optics, uncertainty, and what of the sheet is measured."""

from geometry.sensor.camera import CHANNELS, Camera, project
from geometry.sensor.deviation import SensorDeviation, SheetSeen, calibration_covariance, stated_uncertainty
from geometry.sensor.direct import DirectMap
from geometry.sensor.field_of_view import field_of_view, inside_polygon
from geometry.sensor.housing import housing_box
from geometry.sensor.optics import Optics
from geometry.sensor.profile import AUTO, PROFILE_FORMATS, ProfileOutput
from geometry.sensor.sensor import Sensor
from geometry.sensor.sheet import Sheet
from geometry.sensor.uncertainty import AGAINST, CAMERA_PARAMETERS, SENSOR_PARAMETERS, SOURCES, SensorUncertainty

__all__ = [
    "AGAINST",
    "AUTO",
    "CAMERA_PARAMETERS",
    "CHANNELS",
    "PROFILE_FORMATS",
    "SENSOR_PARAMETERS",
    "SOURCES",
    "Camera",
    "DirectMap",
    "Optics",
    "ProfileOutput",
    "Sensor",
    "SensorDeviation",
    "SensorUncertainty",
    "Sheet",
    "SheetSeen",
    "calibration_covariance",
    "field_of_view",
    "housing_box",
    "inside_polygon",
    "project",
    "stated_uncertainty",
]
