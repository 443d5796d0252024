"""The calibration of a recording."""

from __future__ import annotations

from calib.sensor import SensorCalibration, SensorSettings, calibrate_sensor
from workbench.sensor.recording import BoardFolder


def calibrate_recording(
    recording: BoardFolder, max_terms: int = 14, origin_yz_mm: tuple[float, float] = (0.0, 0.0)
) -> SensorCalibration:
    """Camera, lens and laser plane of what was recorded.

    Parameters
    ----------
    recording
        As `read_recording` gives it.
    max_terms
        Longest vector of OpenCV's distortion terms that may be used.
    origin_yz_mm
        Where {P}'s origin stands, from the foot of the camera's centre.

    Returns
    -------
    SensorCalibration
        With a verdict.
    """
    camera, board = recording.sensor.require_camera(), recording.board
    settings = SensorSettings(max_terms, origin_yz_mm, board.sigma_flat_mm, board.sigma_print_mm)
    return calibrate_sensor(recording.views, (camera.width_px, camera.height_px), settings)
