"""Where measured points really lie if the sensor's parameters are others than its file says.

A camera's point keeps its pixel: the pixel's ray, by the camera as corrected, meets the laser plane as corrected. A
sensor that gives profiles has its scales alone. The corrected plane carries a frame of its own, {P} turned about y,
then about z, and shifted along x, in which points are (0, y, z) again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry.pose import Pose, exp_so3
from geometry.sensor.camera import Camera, distort, undistort_near
from geometry.sensor.sensor import Sensor
from geometry.sensor.uncertainty import CAMERA_PARAMETERS

Array = NDArray[np.float64]

_LENS = {name: i for i, name in enumerate(CAMERA_PARAMETERS[4:])}
# steps of the derivatives by central differences: far above rounding, far below what bends them
_STEP = {"fx_px": 1e-2, "fy_px": 1e-2, "cx_px": 1e-2, "cy_px": 1e-2} | dict.fromkeys(_LENS, 1e-5)
_BEND = 1e-6  # of a normalised coordinate, for what the lens does about a ray
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
        here = np.asarray(values, dtype=float)
        rays = _Rays.of(self.sensor, yz_mm, self._change(here)) if self.sensor.camera is not None else None
        twists, motions = [np.zeros((0, 6))], []
        for name, unit in zip(self.names, np.eye(len(self.names)), strict=True):
            step = unit * _STEP[name]
            above, below = (self._stepped(yz_mm, here, s, rays, name) for s in (step, -step))
            twists.append((below.T_sensor_sheet.inverse() @ above.T_sensor_sheet).log()[None] / (2 * _STEP[name]))
            motions.append((above.yz_mm - below.yz_mm) / (2 * _STEP[name]))
        stacked = np.stack(motions, -1) if motions else np.zeros((*yz_mm.shape, 0))
        return np.concatenate(twists).T, stacked

    def _change(self, values: Array) -> dict[str, float]:
        return dict(zip(self.names, values.tolist(), strict=True))

    def _stepped(self, yz_mm: Array, values: Array, step: Array, rays: _Rays | None, name: str) -> SheetSeen:
        """As seen, a small ``step`` (P,) of the parameter ``name`` away from ``values``, rays to first order."""
        change = self._change(values + step)
        T = sheet_pose(change)
        yz = yz_mm if rays is None else rays.met(T, name, float(np.sum(step))).reshape(yz_mm.shape)
        return SheetSeen(T, yz * [1 + change.get("scale_y", 0.0), 1 + change.get("scale_z", 0.0)])


def sheet_pose(change: dict[str, float]) -> Pose:
    """T_sensor_sheet of a plane that is turned about {P}'s y, then about z, and shifted along x."""
    y, z = change.get("plane_tilt_y_rad", 0.0), change.get("plane_tilt_z_rad", 0.0)
    R = exp_so3(np.array([0.0, y, 0.0])) @ exp_so3(np.array([0.0, 0.0, z]))
    return Pose(R, np.array([change.get("plane_shift_mm", 0.0), 0.0, 0.0]))


def _on_plane(sensor: Sensor, yz_mm: Array, change: dict[str, float], T_sensor_sheet: Pose) -> Array:
    """The rays of the pixels that measured yz_mm (..., 2), met with the corrected plane, in its frame (..., 2)."""
    return _Rays.of(sensor, yz_mm, change).met(T_sensor_sheet).reshape(yz_mm.shape)


@dataclass(frozen=True, eq=False)
class _Rays:
    """What the pixels that measured some points look along by the corrected camera.

    straight, seen (N, 2): the ray without the lens, and where the lens bends it, on the plane at unit distance. focal
    (2,): as corrected. lens (14,): as corrected.
    """

    camera: Camera
    straight: Array
    seen: Array
    focal: Array
    lens: Array

    @staticmethod
    def of(sensor: Sensor, yz_mm: Array, change: dict[str, float]) -> _Rays:
        """Of points (..., 2) measured by the file's camera, by one that is changed."""
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
        longer = focal + [change.get("fx_px", 0.0), change.get("fy_px", 0.0)]
        corrected = (bent * focal - moved) / longer
        straight = undistort_near(xy, corrected, lens)[0] if np.any(lens) else corrected
        return _Rays(camera, straight, corrected, longer, lens)

    def met(self, T_sensor_sheet: Pose, name: str = "", step: float = 0.0) -> Array:
        """Where they meet a plane, in its frame (N, 2); with a parameter of the camera a small ``step`` further."""
        straight = self.straight + step * self._by_parameter.get(name, 0.0)
        camera = self.camera
        rays = np.column_stack([straight, np.ones(len(straight))]) @ camera.T_sensor_camera.R.T
        normal = T_sensor_sheet.R[:, 0]
        along = ((T_sensor_sheet.t - camera.centre_mm) @ normal) / (rays @ normal)
        points = T_sensor_sheet.inverse() @ (camera.centre_mm + along[:, None] * rays)
        return np.asarray(points[:, 1:])

    @cached_property
    def _by_parameter(self) -> dict[str, Array]:
        """Change of the straight rays (N, 2) by the camera's parameters, from distort(straight, lens) = seen."""
        x, y = np.eye(2)
        by_seen = {
            "fx_px": -self.seen * x / self.focal,
            "fy_px": -self.seen * y / self.focal,
            "cx_px": np.broadcast_to(-x / self.focal, self.seen.shape),
            "cy_px": np.broadcast_to(-y / self.focal, self.seen.shape),
        }
        for name, i in _LENS.items():
            step = np.eye(len(self.lens))[i] * _STEP[name]
            above, below = distort(self.straight, self.lens + step), distort(self.straight, self.lens - step)
            by_seen[name] = (below - above) / (2 * _STEP[name])
        if not np.any(self.lens):
            return by_seen
        bend = [(distort(self.straight + h, self.lens) - distort(self.straight - h, self.lens)) for h in _BEND * np.eye(2)]
        jacobian = np.stack(bend, -1) / (2 * _BEND)
        return {k: np.linalg.solve(jacobian, v[..., None])[..., 0] for k, v in by_seen.items()}
