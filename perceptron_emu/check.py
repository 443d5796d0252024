"""Whether a scene and an optics can give an image at all: never an empty image that looks like a result."""

from __future__ import annotations

import numpy as np

from geometry import InputError, Sensor, field_of_view, inside_polygon
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.lens import (
    defocus_radius_px,
    filter_transmission,
    focus_distance_mm,
    principal_distance_mm,
    to_camera,
)
from perceptron_emu.light import axis_meets_sheet_mm, cylinders, faces_in_sheet
from perceptron_emu.scene import Scene

MIN_TRANSMISSION = 1e-3  # of the filter: a frame of 200 grey levels would show none of them
PARALLEL = 1e-6  # of a string's direction across the sheet: it would be met kilometres away
LARGEST_BLUR = 0.1  # of the image's width, a radius: no spot could be told from its neighbour


def check_scene(scene: Scene) -> None:
    """Refuse a scene of which the sensor can see nothing.

    Parameters
    ----------
    scene : Scene
        As it would be rendered.

    Raises
    ------
    InputError
        Where neither a string nor a solid reaches the sheet in the field of view; says what to move.
    """
    polygon = field_of_view(scene.sensor)
    in_view = False
    if scene.jig is not None:
        strings = cylinders(scene.jig, scene.T_sensor_jig)
        if np.all(np.abs(strings.directions[:, 0]) < PARALLEL):
            raise InputError("the laser sheet is parallel to all strings of the jig: turn the jig")
        crossed = ~np.isnan(strings.crossing[:, 0])
        if not np.any(crossed):
            raise InputError("the laser sheet x = 0 passes the jig by: no string crosses it, move the jig")
        seen = inside_polygon(strings.crossing[crossed][:, 1:], polygon)
        if not np.any(seen):
            (y, z), (low, high) = strings.crossing[crossed][:, 1:].mean(0), (polygon.min(0), polygon.max(0))
            raise InputError(
                f"the jig is out of view: its strings cross the sheet about y = {y:.0f}, z = {z:.0f} mm, the field "
                f"of view spans y {low[0]:.0f} … {high[0]:.0f}, z {low[1]:.0f} … {high[1]:.0f} mm"
            )
        in_view = True
    if not in_view and len(faces_in_sheet(scene, EmulatorConfig()).triangles) == 0:
        raise InputError("nothing in the scene reaches the laser sheet x = 0: the image would show no stripe")


def check_optics(sensor: Sensor, config: EmulatorConfig) -> None:
    """Refuse optics that can not be, or can not give an image of the sheet.

    Parameters
    ----------
    sensor : Sensor
        With a camera.
    config : EmulatorConfig
        Its lens, filter and laser.

    Raises
    ------
    InputError
        Names key, value and limit.
    """
    optics, laser = config.optics, config.laser
    chip, focus = principal_distance_mm(optics, sensor), focus_distance_mm(optics, sensor)
    if focus <= chip:
        raise InputError(
            f"[optics] focus_distance_mm = {focus:g} is not beyond the chip's {chip:.1f} mm behind the lens "
            f"(fx_px × pixel_um): no lens of a profile sensor magnifies so, check pixel_um"
        )
    if optics.blur_corner_px is not None and optics.blur_corner_px < optics.blur_px:
        raise InputError(
            f"[optics] blur_corner_px = {optics.blur_corner_px:g} is below blur_px = {optics.blur_px:g}: a lens is "
            f"sharpest in the middle; exchange them, or leave it out"
        )
    passed = float(filter_transmission(optics, laser.wavelength_nm, np.array(1.0), laser.wavelength_nm))
    if passed < MIN_TRANSMISSION:
        raise InputError(
            f"[optics] filter_centre_nm = {optics.filter_centre_nm:g} with filter_fwhm_nm = {optics.filter_fwhm_nm:g} "
            f"blocks the laser's {laser.wavelength_nm:g} nm"
        )
    ray = sensor.sheet.origin_mm + np.array([0.0, 0.0, axis_meets_sheet_mm(sensor)])
    blur = float(defocus_radius_px(optics, sensor, to_camera(sensor, ray)))
    if blur > LARGEST_BLUR * sensor.require_camera().width_px:
        raise InputError(
            f"[optics] focus_distance_mm = {focus:g} at F/{optics.f_number:g} blurs the middle of the sheet to "
            f"{2 * blur:.0f} px: focus nearer to where the camera looks"
        )
