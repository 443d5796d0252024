"""Where measured points really lie if the sensor's parameters are others than its file says.

A camera's point keeps its pixel: the pixel's ray, by the camera as corrected, meets the laser plane as corrected. A
sensor that gives profiles has its scales alone. The corrected plane carries a frame of its own, {P} turned about y,
then about z, and shifted along x, in which points are (0, y, z) again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry.pose import Pose, exp_so3
from geometry.sensor.camera import distort, undistort_near
from geometry.sensor.sensor import Sensor
from geometry.sensor.uncertainty import CAMERA_PARAMETERS, SensorUncertainty

Array = NDArray[np.float64]

_LENS = {name: i for i, name in enumerate(CAMERA_PARAMETERS[4:])}
# steps of the derivatives by central differences: far above rounding, far below what bends them
_STEP = {"fx_px": 1e-2, "fy_px": 1e-2, "cx_px": 1e-2, "cy_px": 1e-2} | dict.fromkeys(_LENS, 1e-5)
_STEP |= {"plane_tilt_y_rad": 1e-5, "plane_tilt_z_rad": 1e-5, "plane_shift_mm": 1e-3, "scale_y": 1e-5, "scale_z": 1e-5}


@dataclass(frozen=True, eq=False)
class SheetSeen:
    """Points of the corrected plane: its frame T_sensor_sheet in {P}, and yz_mm (..., 2) of them in that frame."""

    T_sensor_sheet: Pose
    yz_mm: Array


@dataclass(frozen=True, eq=False)
class SensorDeviation:
    """A sensor whose parameters ``names`` (P,) may differ from its file's."""

    sensor: Sensor
    names: tuple[str, ...]

    def seen(self, yz_mm: Array, values: Sequence[float] | Array) -> SheetSeen:
        """Points (..., 2), measured by the file, where the parameters are off by ``values`` (P,)."""
        change = dict(zip(self.names, np.asarray(values, dtype=float).tolist(), strict=True))
        T = sheet_pose(change)
        if not any(change.values()):
            return SheetSeen(T, yz_mm)
        yz = yz_mm if self.sensor.camera is None else _on_plane(self.sensor, yz_mm, change, T)
        return SheetSeen(T, yz * [1 + change.get("scale_y", 0.0), 1 + change.get("scale_z", 0.0)])

    def derivatives(self, yz_mm: Array, values: Array) -> tuple[Array, Array]:
        """By the parameters: twists (6, P) of the plane's frame, in its own axes, and motions (..., 2, P) in it."""
        twists, motions = [np.zeros((0, 6))], []
        for name, unit in zip(self.names, np.eye(len(self.names)), strict=True):
            step = unit * _STEP[name]
            above, below = self.seen(yz_mm, values + step), self.seen(yz_mm, values - step)
            twists.append((below.T_sensor_sheet.inverse() @ above.T_sensor_sheet).log()[None] / (2 * _STEP[name]))
            motions.append((above.yz_mm - below.yz_mm) / (2 * _STEP[name]))
        stacked = np.stack(motions, -1) if motions else np.zeros((*yz_mm.shape, 0))
        return np.concatenate(twists).T, stacked

    def motions(self, yz_mm: Array) -> Array:
        """By the parameters at the file's own values: motions (N, 2, P) of points (N, 2), as of ``derivatives``.

        In closed form: a pixel's ray turns with the camera's numbers, and meets a plane that turns and shifts.
        """
        out = np.zeros((*yz_mm.shape, len(self.names)))
        for j, scale in enumerate(("scale_y", "scale_z")):
            if scale in self.names:
                out[:, j, self.names.index(scale)] = yz_mm[:, j]
        if self.sensor.camera is None:
            return out
        rays = _rays_by_camera(self.sensor, yz_mm, self.names)
        camera = self.sensor.camera
        ray = np.column_stack([np.zeros(len(yz_mm)), yz_mm]) - camera.centre_mm
        slope = ray[:, 1:] / ray[:, :1]  # of the point, by how far along x its ray has still to go
        turned = rays @ camera.T_sensor_camera.R[:, :2].T  # (N, P, 3), at unit depth before the camera
        depth = ray @ camera.T_sensor_camera.R[:, 2]
        off = depth[:, None, None] * turned
        for name, reach in (
            ("plane_tilt_y_rad", yz_mm[:, 1]),
            ("plane_tilt_z_rad", -yz_mm[:, 0]),
            ("plane_shift_mm", 1.0),
        ):
            if name in self.names:
                off[:, self.names.index(name), 0] = np.negative(reach)
        return np.asarray(out + np.swapaxes(off[..., 1:] - off[..., :1] * slope[:, None], 1, 2))

    def really(self, values: Sequence[float] | Array) -> Sensor:
        """The sensor that it is where the parameters are off by ``values`` (P,); its {P} is that of its own plane.

        Its points are those of ``seen``, but for scales: no camera and no plane has them.
        """
        change = dict(zip(self.names, np.asarray(values, dtype=float).tolist(), strict=True))
        camera = self.sensor.require_camera()
        lens = camera.distortion14
        for name, i in _LENS.items():
            lens[i] += change.get(name, 0.0)
        pinhole = {name: getattr(camera, name) + change.get(name, 0.0) for name in ("fx_px", "fy_px", "cx_px", "cy_px")}
        pose = sheet_pose(change).inverse() @ camera.T_sensor_camera
        terms = tuple(lens.tolist()) if np.any(lens) else ()
        return replace(
            self.sensor, camera=replace(camera, **pinhole, distortion=terms, T_sensor_camera=pose), uncertainty=None
        )


def calibration_covariance(sensor: Sensor, yz_mm: Array) -> Array | None:
    """What the uncertainty of a sensor's own calibration makes of its points.

    Parameters
    ----------
    sensor : Sensor
        With what its file says of its uncertainty.
    yz_mm : ndarray (N, 2)
        Points of the laser plane as measured with it, in {P} [mm].

    Returns
    -------
    ndarray (N, 2, 2) or None
        Covariance of each point [mm²], beside its random part. All points share its causes: it does not average out.
        None where the file takes itself for exact.
    """
    known = stated_uncertainty(sensor)
    if known is None:
        return None
    motions = SensorDeviation(sensor, known.parameters).motions(np.asarray(yz_mm, dtype=float).reshape(-1, 2))
    return np.asarray(motions @ known.covariance @ np.swapaxes(motions, 1, 2))


def stated_uncertainty(sensor: Sensor) -> SensorUncertainty | None:
    """What the file states, with the usual numbers of its source; None where it takes itself for exact."""
    if sensor.uncertainty is None:
        return None
    camera = sensor.camera
    known = sensor.uncertainty.completed(None if camera is None else (camera.fx_px, camera.fy_px))
    return known if np.any(known.covariance) else None


def sheet_pose(change: dict[str, float]) -> Pose:
    """T_sensor_sheet of a plane that is turned about {P}'s y, then about z, and shifted along x."""
    y, z = change.get("plane_tilt_y_rad", 0.0), change.get("plane_tilt_z_rad", 0.0)
    R = exp_so3(np.array([0.0, y, 0.0])) @ exp_so3(np.array([0.0, 0.0, z]))
    return Pose(R, np.array([change.get("plane_shift_mm", 0.0), 0.0, 0.0]))


def _on_plane(sensor: Sensor, yz_mm: Array, change: dict[str, float], T_sensor_sheet: Pose) -> Array:
    """The rays of the pixels that measured yz_mm (..., 2), met with the corrected plane, in its frame (..., 2)."""
    camera = sensor.require_camera()
    flat = yz_mm.reshape(-1, 2)
    seen = (np.column_stack([np.zeros(len(flat)), flat]) - camera.centre_mm) @ camera.T_sensor_camera.R
    xy = seen[:, :2] / seen[:, 2:]
    file_lens = camera.distortion14
    lens = file_lens.copy()
    for name, i in _LENS.items():
        lens[i] += change.get(name, 0.0)
    focal = np.array([camera.fx_px, camera.fy_px])
    bent = distort(xy, file_lens) if np.any(file_lens) else xy
    moved = np.array([change.get("cx_px", 0.0), change.get("cy_px", 0.0)])
    longer = np.array([change.get("fx_px", 0.0), change.get("fy_px", 0.0)])
    corrected = (bent * focal - moved) / (focal + longer)
    straight = undistort_near(xy, corrected, lens)[0] if np.any(lens) else corrected
    rays = np.column_stack([straight, np.ones(len(flat))]) @ camera.T_sensor_camera.R.T
    normal = T_sensor_sheet.R[:, 0]
    along = ((T_sensor_sheet.t - camera.centre_mm) @ normal) / (rays @ normal)
    points = T_sensor_sheet.inverse() @ (camera.centre_mm + along[:, None] * rays)
    return np.asarray(points[:, 1:].reshape(yz_mm.shape))


def _rays_by_camera(sensor: Sensor, yz_mm: Array, names: tuple[str, ...]) -> Array:
    """How the ray (x, y, 1) of a point's pixel turns (N, P, 2) with the camera's numbers, the pixel held."""
    camera = sensor.require_camera()
    lens, focal = camera.distortion14, np.array([camera.fx_px, camera.fy_px])
    seen = (np.column_stack([np.zeros(len(yz_mm)), yz_mm]) - camera.centre_mm) @ camera.T_sensor_camera.R
    xy = seen[:, :2] / seen[:, 2:]
    bent, h = distort(xy, lens), 1e-6
    by_xy = np.stack([(distort(xy + h * e, lens) - distort(xy - h * e, lens)) / (2 * h) for e in np.eye(2)], -1)
    out = np.zeros((len(yz_mm), 2, len(names)))  # what the bent coordinates must make good
    for j, name in enumerate(names):
        if name in _LENS:
            step = np.zeros(len(lens))
            step[_LENS[name]] = _STEP[name]
            out[:, :, j] = -(distort(xy, lens + step) - distort(xy, lens - step)) / (2 * _STEP[name])
        elif name in ("fx_px", "fy_px"):
            k = int(name == "fy_px")
            out[:, k, j] = -bent[:, k] / focal[k]
        elif name in ("cx_px", "cy_px"):
            k = int(name == "cy_px")
            out[:, k, j] = -1 / focal[k]
    return np.swapaxes(np.linalg.solve(by_xy, out), 1, 2)
