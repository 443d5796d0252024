"""The camera that sees the laser sheet: image, intrinsics, lens and pose in {P}."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.pose import Pose, check_rotation

Array = NDArray[np.float64]

DISTORTION_LENGTHS = (0, 4, 5, 8, 12, 14)
BIT_DEPTHS = (8, 10, 12, 14, 16)
CHANNELS = ("red", "green", "blue", "grey", "max")
MOST_TILT_RAD = 0.8  # of a Scheimpflug adapter: 45°, beyond which no light arrives
MOST_DISTORTION = 0.6  # half way to the corner, of the distance from the centre; a fisheye of 180° has some 0.4
FARTHEST_MM = 1e5  # of the camera from the sheet's origin
NEAREST_MM = 1.0  # of the camera's centre to the laser plane: no lens is so small, and metres for millimetres are
FARTHEST_CENTRE = 50.0  # image sides, of the principal point: cut-outs of a large chip may lie outside


@dataclass(frozen=True, eq=False)
class Camera:
    """Parameters of OpenCV's camera model, of its image, and its pose before the sheet x = 0.

    Parameters
    ----------
    width_px, height_px : int
        Size of the image; pixel (0, 0) is the centre of the top-left pixel.
    fx_px, fy_px, cx_px, cy_px : float
        Intrinsics.
    T_sensor_camera : Pose
        Pose of the camera (x right, y down, z forward) in {P} [mm].
    distortion : tuple of float
        0, 4, 5, 8, 12 or 14 terms in OpenCV's order, the tilt (the last two) in radians.
    bit_depth : int
        8, 10, 12, 14 or 16.
    black_level : float
        Grey level of no light [DN].
    stated_saturation_dn : int or None
        Grey level from which a pixel is full, where the sensor's file says so.
    channel : str or None
        The channel of colour images that holds the laser's light, one of CHANNELS; None where the file is silent.

    Raises
    ------
    InputError
        Where the numbers can not be a camera that sees the sheet.
    """

    width_px: int
    height_px: int
    fx_px: float
    fy_px: float
    cx_px: float
    cy_px: float
    T_sensor_camera: Pose
    distortion: tuple[float, ...] = ()
    bit_depth: int = 8
    black_level: float = 0.0
    stated_saturation_dn: int | None = None
    channel: str | None = None

    def __post_init__(self) -> None:
        _check_image(self)
        _check_optics(self)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns of the image."""
        return self.height_px, self.width_px

    @property
    def matrix(self) -> Array:
        """Intrinsic matrix K (3, 3) [px]."""
        return np.array([[self.fx_px, 0, self.cx_px], [0, self.fy_px, self.cy_px], [0, 0, 1.0]])

    @property
    def centre_mm(self) -> Array:
        """The projection centre in {P} (3,) [mm]."""
        return self.T_sensor_camera.t

    @property
    def distortion14(self) -> Array:
        """The distortion terms filled up with zeros to OpenCV's 14 (14,)."""
        return np.array([*self.distortion, *[0.0] * (14 - len(self.distortion))])

    @property
    def full_scale_dn(self) -> int:
        """The largest grey level that the image can hold."""
        return int(2**self.bit_depth - 1)

    @property
    def saturation_dn(self) -> int:
        """Grey level from which a pixel is full: as stated, else the full scale."""
        return self.full_scale_dn if self.stated_saturation_dn is None else self.stated_saturation_dn


def project(camera: Camera, xyz_mm: ArrayLike) -> Array:
    """Where a camera is expected to see points, for planning.

    The emulator draws by a projection of its own and extraction inverts by its own; neither may lean on this one.

    Parameters
    ----------
    camera : Camera
        Intrinsics, lens and pose.
    xyz_mm : ArrayLike
        Points (..., 3) in {P} [mm].

    Returns
    -------
    Array
        Pixels (..., 2), NaN for points that are not in front of the camera.

    References
    ----------
    OpenCV, calib3d, "Detailed Description": the pinhole model with rational, tangential, thin-prism and tilt terms.
    """
    xyz = (np.asarray(xyz_mm, dtype=float) - camera.centre_mm) @ camera.T_sensor_camera.R
    depth = np.where(xyz[..., 2:] > 0, xyz[..., 2:], np.nan)
    xy = (xyz[..., :2] / depth).reshape(-1, 2)
    seen = distort(xy, camera.distortion14) if any(camera.distortion) else xy
    uv = seen * [camera.fx_px, camera.fy_px] + [camera.cx_px, camera.cy_px]
    return np.asarray(uv.reshape(*xyz.shape[:-1], 2))


def distort(xy: Array, k: Array) -> Array:
    """OpenCV's rational, tangential, thin-prism and tilt model, terms (14,), on normalised coordinates (N, 2)."""
    x, y = xy[:, 0], xy[:, 1]
    r2 = x * x + y * y
    radial = (1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]))) / (1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7])))
    xd = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x) + r2 * (k[8] + r2 * k[9])
    yd = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y + r2 * (k[10] + r2 * k[11])
    (sx, sy), (cx, cy) = np.sin(k[12:14]), np.cos(k[12:14])
    rotation = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]]) @ np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    shear = np.array([[rotation[2, 2], 0, -rotation[0, 2]], [0, rotation[2, 2], -rotation[1, 2]], [0, 0, 1]])
    tilted = np.column_stack([xd, yd, np.ones(len(xd))]) @ (shear @ rotation).T
    return np.asarray(tilted[:, :2] / tilted[:, 2:])


def undistort_near(start: Array, goal: Array, k: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Solve distort(xy) = goal (N, 2) near ``start``; True where it was reached without crossing a fold."""
    xy, h = start.copy(), 1e-6
    for _ in range(8):
        f = distort(xy, k) - goal
        j = np.stack([(distort(xy + h * e, k) - distort(xy - h * e, k)) / (2 * h) for e in np.eye(2)], -1)
        det = np.linalg.det(j)
        unfolded = det > 1e-3
        j[~unfolded] = np.eye(2)
        xy = xy - np.where(unfolded[:, None], np.linalg.solve(j, f[..., None])[..., 0], 0.0)
        xy = np.clip(xy, -20.0, 20.0)  # no lens sees 87° off its axis; keeps a lost iterate finite
    left = np.max(np.abs(distort(xy, k) - goal), axis=-1)
    return xy, unfolded & (left < 1e-12)


def _check_image(c: Camera) -> None:
    if not (1 <= c.width_px <= 65535 and 1 <= c.height_px <= 65535):
        raise InputError(f"image size {c.width_px} × {c.height_px} px: width and height must lie in 1 … 65535")
    if c.bit_depth not in BIT_DEPTHS:
        raise InputError(f"bit_depth {c.bit_depth}: must be one of {', '.join(map(str, BIT_DEPTHS))}")
    if not 0 <= c.black_level < c.full_scale_dn:
        raise InputError(f"black_level {c.black_level:g}: must lie in 0 … {c.full_scale_dn - 1} at {c.bit_depth} bits")
    if not c.black_level < c.saturation_dn <= c.full_scale_dn:
        raise InputError(
            f"[image] saturation_dn = {c.saturation_dn}: must lie above black_level = {c.black_level:g} and at most at "
            f"{c.full_scale_dn}, the full scale of {c.bit_depth} bits"
        )
    if c.channel is not None and c.channel not in CHANNELS:
        raise InputError(f'[image] channel = "{c.channel}": must be one of {", ".join(CHANNELS)}')


def _check_optics(c: Camera) -> None:
    numbers = [c.fx_px, c.fy_px, c.cx_px, c.cy_px, *c.distortion, *c.T_sensor_camera.t]
    if not np.all(np.isfinite(numbers)):
        raise InputError("the camera holds a number that is not finite")
    if c.fx_px <= 0 or c.fy_px <= 0:
        raise InputError(f"focal lengths fx_px = {c.fx_px:g}, fy_px = {c.fy_px:g}: must be positive")
    if len(c.distortion) not in DISTORTION_LENGTHS:
        raise InputError(f"distortion has {len(c.distortion)} terms: OpenCV's model takes 0, 4, 5, 8, 12 or 14")
    _check_lens(c)
    check_rotation(c.T_sensor_camera.R)
    if not np.max(np.abs(c.T_sensor_camera.t)) < FARTHEST_MM:
        raise InputError(
            f"the camera stands {np.max(np.abs(c.T_sensor_camera.t)):g} mm from the origin: lengths are mm"
        )
    if abs(c.T_sensor_camera.t[0]) < 1e-6:
        raise InputError(
            "the camera's centre lies in the laser plane x = 0: it sees the sheet edge-on and measures no depth"
        )
    if abs(c.T_sensor_camera.t[0]) < NEAREST_MM:
        raise InputError(
            f"[camera.pose] translation_mm puts the camera's centre {abs(c.T_sensor_camera.t[0]):g} mm from the laser "
            f"plane x = 0, where no camera has room (at least {NEAREST_MM:g} mm): millimetres are right"
        )
    if _rays_hit_nowhere(c):
        raise InputError(
            "the camera looks along or away from the laser plane x = 0 and never sees it: turn [camera.pose] towards it"
        )


def _check_lens(c: Camera) -> None:
    """Focal lengths, tilt and distortion are such as lenses have."""
    long_side = max(c.width_px, c.height_px)
    for name, f in (("fx_px", c.fx_px), ("fy_px", c.fy_px)):
        if not 0.05 < f / long_side < 1000:
            raise InputError(f"{name} = {f:g} px with an image of {long_side} px: no lens sees so wide or so narrow")
    if not max(abs(c.cx_px), abs(c.cy_px)) < FARTHEST_CENTRE * long_side:
        raise InputError(f"cx_px, cy_px = {c.cx_px:g}, {c.cy_px:g}: the principal point lies far off the image")
    terms = c.distortion14
    for name, tilt in (("τx", terms[12]), ("τy", terms[13])):
        if abs(tilt) > MOST_TILT_RAD:
            raise InputError(
                f"distortion: the lens tilt {name} = {tilt:g} rad is {np.rad2deg(tilt):.3g}°, no lens tilts beyond "
                f"{np.rad2deg(MOST_TILT_RAD):.0f}°; tilts are in radians"
            )
    terms[12:] = 0.0
    corners = np.array([(u, v) for u in (0, c.width_px - 1) for v in (0, c.height_px - 1)], dtype=float)
    half = (corners - [c.cx_px, c.cy_px]) / [c.fx_px, c.fy_px] / 2
    with np.errstate(all="ignore"):
        off = np.linalg.norm(distort(half, terms) - half, axis=1) / np.maximum(np.linalg.norm(half, axis=1), 1e-9)
    if not np.all(off < MOST_DISTORTION):
        shown = ", ".join(f"{v:g}" for v in c.distortion)
        raise InputError(
            f"distortion = [{shown}] moves points half way to the image's corners by more than {MOST_DISTORTION:.0%} "
            "of their distance from the centre, which no lens does: check the order k1 k2 p1 p2 k3 … and the pixels"
        )


def _rays_hit_nowhere(c: Camera) -> bool:
    """Whether the rays of all four image corners run away from the sheet."""
    u = np.array([0, c.width_px - 1, c.width_px - 1, 0], dtype=float)
    v = np.array([0, 0, c.height_px - 1, c.height_px - 1], dtype=float)
    rays = np.stack([(u - c.cx_px) / c.fx_px, (v - c.cy_px) / c.fy_px, np.ones(4)], -1) @ c.T_sensor_camera.R.T
    return bool(np.all(rays[:, 0] * c.T_sensor_camera.t[0] >= 0))
