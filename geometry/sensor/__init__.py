"""The sensor: laser sheet, camera or none, and the part of the sheet that is measured."""

from geometry.sensor.camera import Camera
from geometry.sensor.field_of_view import field_of_view, inside_polygon
from geometry.sensor.sensor import Sensor
from geometry.sensor.sheet import Sheet

__all__ = ["Camera", "Sensor", "Sheet", "field_of_view", "inside_polygon"]
