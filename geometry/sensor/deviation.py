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
from geometry.sensor.camera import Camera, distort, undistort_near
from geometry.sensor.sensor import Sensor
from geometry.sensor.uncertainty import CAMERA_PARAMETERS, SensorUncertainty

Array = NDArray[np.float64]

_LENS = {name: i for i, name in enumerate(CAMERA_PARAMETERS[4:])}
_EXACT = 1e-4  # of the σ of points, most of which is a shift of them all: to what drawn ones follow the tangent
_CURVE_STEPS = 4  # of Gauss and Newton to the curve, which bends little within a few σ
_STEP = 1e-5  # of a lens's term, for its derivative: far above rounding, far below what bends it


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

    def derivatives(self, yz_mm: Array, values: Sequence[float] | Array) -> tuple[Array, Array]:
        """By the parameters: twists (6, P) of the plane's frame, in its own axes, and motions (..., 2, P) in it.

        In closed form: a pixel's ray turns with the camera's numbers, and meets a plane that turns and shifts.
        """
        change = dict(zip(self.names, np.asarray(values, dtype=float).tolist(), strict=True))
        T = sheet_pose(change)
        twists = self._plane_twists(T, change.get("plane_tilt_z_rad", 0.0))
        lengths = np.array([1 + change.get("scale_y", 0.0), 1 + change.get("scale_z", 0.0)])
        flat = (self.seen(yz_mm, values).yz_mm / lengths).reshape(-1, 2)
        out: Array = np.zeros((len(flat), 2, len(self.names)))
        if self.sensor.camera is not None:
            seen_by = _Pinhole.of(self.sensor.camera, change, T)
            points = np.column_stack([np.zeros(len(flat)), flat])
            off = seen_by.motions(points, self.names)
            off -= twists[:3].T + np.cross(twists[3:].T[None], points[:, None])
            ray = points - seen_by.centre_mm
            slope = ray[:, 1:] / ray[:, :1]  # of the point, by how far along x its ray has still to go
            out = np.swapaxes(off[..., 1:] - off[..., :1] * slope[:, None], 1, 2)
        out *= lengths[:, None]
        for j, scale in enumerate(("scale_y", "scale_z")):
            if scale in self.names:
                out[:, j, self.names.index(scale)] = flat[:, j]
        return twists, out.reshape(*yz_mm.shape, len(self.names))

    def motions(self, yz_mm: Array) -> Array:
        """By the parameters at the file's own values: motions (N, 2, P) of points (N, 2), as of ``derivatives``."""
        return self.derivatives(yz_mm, np.zeros(len(self.names)))[1]

    def on_curve(self, yz_mm: Array, values: Sequence[float] | Array, known: SensorUncertainty) -> Array:
        """Values (P,) near those given, by which points (N, 2) move as the given ones do to first order.

        Where a file has a tangent, parameters that are possible lie on a curve: far along the tangent points would move
        by its sag, which no σ of theirs holds. The plane stays where it is, the camera's numbers are as near to those
        given as can be, in units of their σ by what is known.
        """
        given = np.asarray(values, dtype=float)
        tangent, sigma = self.motions(yz_mm).reshape(-1, len(self.names)), np.sqrt(np.diag(known.covariance))
        moved = tangent @ given
        unit = _EXACT * float(np.sqrt(np.mean(np.sum((tangent @ known.of_points) * tangent, axis=1))))
        camera = [i for i, name in enumerate(self.names) if name in CAMERA_PARAMETERS and sigma[i] > 0]
        now = given.copy()
        for _ in range(_CURVE_STEPS if unit > 0 and camera else 0):
            by = self.derivatives(yz_mm, now)[1].reshape(tangent.shape)[:, camera] * sigma[camera] / unit
            left = ((self.seen(yz_mm, now).yz_mm - yz_mm).reshape(-1) - moved) / unit
            away = (now - given)[camera] / sigma[camera]
            now[camera] -= sigma[camera] * np.linalg.solve(by.T @ by + np.eye(len(camera)), by.T @ left + away)
        return now

    def _plane_twists(self, T_sensor_sheet: Pose, tilt_z_rad: float) -> Array:
        """How the corrected plane's frame moves (6, P), in its own axes."""
        out = np.zeros((6, len(self.names)))
        about_z = exp_so3(np.array([0.0, 0.0, tilt_z_rad]))
        for name, rows, axis in (
            ("plane_tilt_y_rad", slice(3, 6), about_z[1]),
            ("plane_tilt_z_rad", slice(3, 6), np.eye(3)[2]),
            ("plane_shift_mm", slice(0, 3), T_sensor_sheet.R[0]),
        ):
            if name in self.names:
                out[rows, self.names.index(name)] = axis
        return out

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
            self.sensor,
            camera=replace(camera, **pinhole, distortion=terms, T_sensor_camera=pose),
            uncertainty=None,
            direct=None,
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
        None where the file takes itself for exact. What a direct map leaves of its camera is in it.
    """
    known = stated_uncertainty(sensor)
    if known is None:
        return None
    motions = SensorDeviation(sensor, known.parameters).motions(np.asarray(yz_mm, dtype=float).reshape(-1, 2))
    own = np.asarray(motions @ known.of_points @ np.swapaxes(motions, 1, 2))
    return own if sensor.direct is None else own + sensor.direct.rms_mm**2 / 2 * np.eye(2)


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
    now = _Pinhole.of(camera, change, T_sensor_sheet)
    focal = np.array([camera.fx_px, camera.fy_px])
    bent = distort(xy, file_lens) if np.any(file_lens) else xy
    moved = np.array([change.get("cx_px", 0.0), change.get("cy_px", 0.0)])
    corrected = (bent * focal - moved) / now.focal_px
    straight = undistort_near(xy, corrected, now.lens)[0] if np.any(now.lens) else corrected
    rays = np.column_stack([straight, np.ones(len(flat))]) @ now.R.T
    points = now.centre_mm - now.centre_mm[0] / rays[:, :1] * rays
    return np.asarray(points[:, 1:].reshape(yz_mm.shape))


@dataclass(frozen=True, eq=False)
class _Pinhole:
    """The corrected camera in the corrected plane's frame: turn R (3, 3), centre (3,), focals (2,), lens (14,)."""

    R: Array
    centre_mm: Array
    focal_px: Array
    lens: Array

    @staticmethod
    def of(camera: Camera, change: dict[str, float], T_sensor_sheet: Pose) -> _Pinhole:
        """Of a file's camera."""
        lens = camera.distortion14.copy()
        for name, i in _LENS.items():
            lens[i] += change.get(name, 0.0)
        focal = [camera.fx_px + change.get("fx_px", 0.0), camera.fy_px + change.get("fy_px", 0.0)]
        T = T_sensor_sheet.inverse() @ camera.T_sensor_camera
        return _Pinhole(T.R, T.t, np.array(focal), lens)

    def motions(self, points_mm: Array, names: tuple[str, ...]) -> Array:
        """How points (N, 3) move (N, P, 3) with the camera's numbers, pixel and depth before the camera held."""
        seen = (points_mm - self.centre_mm) @ self.R
        xy, depth = seen[:, :2] / seen[:, 2:], seen[:, 2]
        bent, h = (distort(xy, self.lens) if np.any(self.lens) else xy), 1e-6
        out: Array = np.zeros((len(xy), 2, len(names)))  # what the bent coordinates must make good
        for j, name in enumerate(names):
            if name in _LENS:
                step = np.zeros(len(self.lens))
                step[_LENS[name]] = _STEP
                out[:, :, j] = -(distort(xy, self.lens + step) - distort(xy, self.lens - step)) / (2 * _STEP)
            elif name in ("fx_px", "fy_px"):
                k = int(name == "fy_px")
                out[:, k, j] = -bent[:, k] / self.focal_px[k]
            elif name in ("cx_px", "cy_px"):
                k = int(name == "cy_px")
                out[:, k, j] = -1 / self.focal_px[k]
        if np.any(self.lens):
            by = [(distort(xy + h * e, self.lens) - distort(xy - h * e, self.lens)) / (2 * h) for e in np.eye(2)]
            out[:] = np.linalg.solve(np.stack(by, -1), out)
        return np.asarray(depth[:, None, None] * (np.swapaxes(out, 1, 2) @ self.R[:, :2].T))
