"""A sensor's own calibration: from a folder of pictures to its sensor.toml, report and JSON."""

from workbench.sensor.answer import answer_object, calibrated_sensor, calibrated_text, exported
from workbench.sensor.page import write_sensor_report
from workbench.sensor.recording import BoardFolder, read_recording
from workbench.sensor.run import calibrate_recording

__all__ = [
    "BoardFolder",
    "answer_object",
    "calibrate_recording",
    "calibrated_sensor",
    "calibrated_text",
    "exported",
    "read_recording",
    "write_sensor_report",
]
