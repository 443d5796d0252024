"""The assumed cameras of the data-sheet presets: what camera has this maker's field of view?

No maker publishes imager, lens and base of a line profiler. A camera is assumed here (imager and, for the profilers
that must have a tilted chip, the depth at which its centre lies) and solved so that the field of view has the data
sheet's near and far widths and its depth range. Run: python benchmarks/sensor_presets.py [FOLDER to write them to]
"""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from geometry import Camera, Pose, Sensor, Sheet

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DataSheet:
    """What the maker publishes [mm, nm], and the imager and exposure that are assumed for it.

    centre_mm: where the camera's centre is assumed to lie, in depth from the sensor's face; None: as the widths
    demand with an untilted chip.
    """

    name: str
    near_mm: float
    far_mm: float
    near_width_mm: float
    far_width_mm: float
    wavelength_nm: float
    width_px: int
    height_px: int
    pixel_um: float
    exposure_ms: float
    centre_mm: float | None


SHEETS = {
    "keyence_lj_x8080": DataSheet("Keyence LJ-X8080", 52.5, 93.5, 30, 39, 405, 3200, 1800, 3.45, 0.15, None),
    "keyence_lj_x8200": DataSheet("Keyence LJ-X8200", 211, 279, 64, 80, 405, 3200, 1240, 3.45, 0.4, None),
    "keyence_lj_x8300": DataSheet("Keyence LJ-X8300", 235, 341, 134, 160, 405, 3200, 1240, 3.45, 0.9, None),
    "lmi_gocator_2330": DataSheet("LMI Gocator 2330", 90, 170, 47, 85, 660, 1280, 720, 4.8, 0.1, -5.0),
    "lmi_gocator_2340": DataSheet("LMI Gocator 2340", 190, 400, 96, 194, 660, 1280, 720, 4.8, 0.25, -5.0),
    "lmi_gocator_2350": DataSheet("LMI Gocator 2350", 300, 700, 158, 365, 660, 1280, 720, 4.8, 2.0, -5.0),
}


def camera(angle: float, base_mm: float, centre_mm: float) -> Pose:
    """T_sensor_camera of a camera that looks inwards by ``angle``, near points low in the image."""
    c, s = np.cos(angle), np.sin(angle)
    return Pose(np.array([[0, -c, -s], [1, 0, 0], [0, -s, c]]), np.array([base_mm, 0, centre_mm]))


def solve(sheet: DataSheet) -> Sensor:
    """The camera whose image corners are the corners of the data sheet's field of view."""
    w, h = sheet.width_px, sheet.height_px
    far = [[sheet.far_width_mm / 2, sheet.far_mm], [-sheet.far_width_mm / 2, sheet.far_mm]]
    near = [[sheet.near_width_mm / 2, sheet.near_mm], [-sheet.near_width_mm / 2, sheet.near_mm]]
    goal = np.array([[w, -h], [-w, -h], [w, h], [-w, h]]) / 2
    middle = (sheet.near_mm + sheet.far_mm) / 2
    tilted = sheet.centre_mm is not None

    def unpack(x: Array) -> tuple[float, float, float, float, float]:
        focal, angle, base = np.exp(x[0]), x[1], x[2] * middle
        return (focal, angle, base, sheet.centre_mm, x[3]) if tilted else (focal, angle, base, x[3] * middle, 0.0)

    def misfit(x: Array) -> Array:
        focal, angle, base, centre, tilt = unpack(x)
        return (focal * chip(camera(angle, base, centre), tilt, np.array(far + near)) - goal).ravel()

    start = [np.log(w * middle / sheet.far_width_mm), 0.4, 0.4, 0.1 if tilted else -0.2]
    fit = least_squares(misfit, start, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    if np.max(np.abs(fit.fun)) > 0.5:
        raise SystemExit(f"{sheet.name}: no such camera, {np.max(np.abs(fit.fun)):.1f} px are left")
    focal, angle, base, centre, tilt = (
        round(float(v), digits) for v, digits in zip(unpack(fit.x), (1, 6, 2, 2, 5), strict=True)
    )
    return model(sheet, focal, camera(angle, base, centre), tilt)


def chip(T_sensor_camera: Pose, tilt: float, yz: Array) -> Array:
    """OpenCV's model with τx alone, by its definition: rotate the image plane, then move the centre back."""
    p = T_sensor_camera.inverse() @ np.column_stack([np.zeros(len(yz)), yz])
    c, s = np.cos(tilt), np.sin(tilt)
    rotation = np.array([[1, 0, 0], [0, c, s], [0, -s, c]])
    back = np.array([[c, 0, 0], [0, c, -s], [0, 0, 1]])
    q = (p / p[:, 2:]) @ (back @ rotation).T
    return np.asarray(q[:, :2] / q[:, 2:])


def model(sheet: DataSheet, focal: float, T_sensor_camera: Pose, tilt: float) -> Sensor:
    """The sensor, with a fan that opens inside the housing just wide enough to light the whole field."""
    origin = -0.1 * sheet.near_mm
    half = max(
        np.arctan2(width / 2, depth - origin)
        for width, depth in ((sheet.near_width_mm, sheet.near_mm), (sheet.far_width_mm, sheet.far_mm))
    )
    camera = Camera(
        width_px=sheet.width_px,
        height_px=sheet.height_px,
        fx_px=focal,
        fy_px=focal,
        cx_px=(sheet.width_px - 1) / 2,
        cy_px=(sheet.height_px - 1) / 2,
        T_sensor_camera=T_sensor_camera,
        distortion=(*[0.0] * 12, tilt, 0.0) if tilt else (),
        bit_depth=8,
    )
    fan_rad = float(np.deg2rad(np.ceil(np.rad2deg(2 * half * 1.06))))
    return Sensor(Sheet(np.array([0.0, 0.0, round(origin, 1)]), fan_rad), camera, name=sheet.name)


def text(sheet: DataSheet, s: Sensor) -> str:
    """The preset's sensor.toml."""
    c = s.require_camera()
    rows = ",\n  ".join(str([round(float(v), 12) for v in row]) for row in c.T_sensor_camera.R)
    base = c.T_sensor_camera.t[0]
    angle = np.rad2deg(np.arctan2(-c.T_sensor_camera.R[0, 2], c.T_sensor_camera.R[2, 2]))
    tilt = f", chip tilted {np.rad2deg(c.distortion[12]):.1f} deg towards the sheet" if c.distortion else ""
    return f"""# {sheet.name}: field of view, range and wavelength from the maker's data sheet, all else assumed
# data sheet: {sheet.near_mm:g} to {sheet.far_mm:g} mm from the face, {sheet.near_width_mm:g} mm wide near, \
{sheet.far_width_mm:g} mm far
# assumed: imager and pixel pitch, lens, base {base:g} mm, emitter in the housing,
# view {angle:.1f} deg from the sheet{tilt}
# {{P}}: laser plane x = 0, y lateral, z depth from the sensor's face
name = "{sheet.name} (camera assumed)"
[image] # assumed
width_px = {c.width_px}
height_px = {c.height_px}
bit_depth = {c.bit_depth}
[camera] # assumed: solved for the data sheet's field of view
fx_px = {c.fx_px}
fy_px = {c.fy_px}
cx_px = {c.cx_px}
cy_px = {c.cy_px}
distortion = {[float(v) for v in c.distortion]}
[camera.pose] # assumed; T_sensor_camera
rotation = [
  {rows},
]
translation_mm = {[float(v) for v in c.T_sensor_camera.t]}
[laser]
origin_mm = {[float(v) for v in s.sheet.origin_mm]} # assumed
fan_deg = {np.rad2deg(s.sheet.fan_rad):.1f} # assumed: lights the whole field
wavelength_nm = {sheet.wavelength_nm:.1f} # data sheet
[optics]
pixel_um = {sheet.pixel_um} # assumed
[exposure]
time_ms = {sheet.exposure_ms} # assumed: a matte thread peaks near three quarters of the grey levels
"""


def main() -> None:
    """Solve every data sheet; print the cameras, or write the presets into the folder of the first argument."""
    for key, sheet in SHEETS.items():
        sensor = solve(sheet)
        if len(sys.argv) > 1:
            Path(sys.argv[1], f"{key}.toml").write_text(text(sheet, sensor), encoding="utf-8")
        R, t = sensor.camera.T_sensor_camera.R, sensor.camera.T_sensor_camera.t
        tilt = np.rad2deg(sensor.camera.distortion[12]) if sensor.camera.distortion else 0.0
        angle = np.rad2deg(np.arctan2(-R[0, 2], R[2, 2]))
        print(
            f"{key:18} f {sensor.camera.fx_px:8.1f} px, base {t[0]:6.1f} mm, centre z {t[2]:6.1f} mm,"
            f" axis {angle:5.1f}°, tilt {tilt:5.1f}°, fan {np.rad2deg(sensor.sheet.fan_rad):4.0f}°"
        )


if __name__ == "__main__":
    main()
