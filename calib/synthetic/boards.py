"""Emulated sensors and their views of a board with the stripe on it, as numbers: truth for a sensor's calibration.

Points are where plain geometry and geometry's lens put them; nothing of the solver makes them.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calib.sensor import BoardView, Corners, SensorSolution, StripePoints
from geometry import Camera, Pose, exp_so3
from geometry.sensor import CAMERA_PARAMETERS, project

Array = NDArray[np.float64]

SIZE_PX = (1280, 1024)
INNER_CORNERS = (9, 6)  # inner corners
SQUARE_MM = 10.0
MIDDLE_MM = 290.0  # from the camera to where the sheet crosses its axis
_NORMAL = np.array([0.05, 0.92, 0.38])  # of the sheet: it cuts the field of view in depth
_LEAST = 1e-3  # px, of a σ that is stated
_STEPS_MM = 0.2  # between a stripe's points
_BENT = 40  # rounds to where the plane meets a bent board: each a hundredth of what the one before left


@dataclass(frozen=True, eq=False)
class SyntheticSensor:
    """A true sensor: its camera (18,), CAMERA_PARAMETERS, and its laser plane n · X = d in the camera's frame."""

    camera: Array
    normal: Array
    distance_mm: float

    @property
    def terms(self) -> tuple[str, ...]:
        """The smallest set of the lens's terms that the calibration may choose and that holds this lens."""
        tilt = ("tau_x", "tau_y") if np.any(self.camera[-2:]) else ()
        return ("k1", "k2", "p1", "p2", *tilt)


def synthetic_sensor(rng: np.random.Generator, tilt_deg: float = 0.0) -> SyntheticSensor:
    """A sensor as makers build them: lens and mounting drawn, the chip tilted by ``tilt_deg`` some way."""
    camera = np.zeros(len(CAMERA_PARAMETERS))
    f = rng.uniform(2200, 2400)
    middle = (np.array(SIZE_PX) - 1) / 2
    camera[:4] = f, f * rng.normal(1, 1e-3), *(middle + rng.normal(0, 12, 2))
    camera[4], camera[5] = rng.uniform(-0.25, -0.08), rng.uniform(0.0, 0.3)
    camera[6:8] = rng.normal(0, 1e-3, 2)
    way = rng.uniform(0, 2 * np.pi)
    camera[-2:] = np.deg2rad(tilt_deg) * np.array([np.cos(way), np.sin(way)])
    normal = _NORMAL / np.linalg.norm(_NORMAL)
    return SyntheticSensor(camera, normal, float(normal @ [0, 0, MIDDLE_MM]))


@dataclass(frozen=True)
class BoardNoise:
    """Standard deviations [px] of corners and of a stripe's points across it."""

    corner_px: float = 0.03
    stripe_px: float = 0.03


@dataclass(frozen=True, eq=False)
class PlateShape:
    """A true board: z = (a x² + 2 b x y + c y²) / 2 about its middle, curvatures bend [1/mm], and corners' offsets.

    offset_mm (54, 3): of the corners alone, from where they are stated to be; the plate has none of them.
    """

    bend: tuple[float, float, float] = (0.0, 0.0, 0.0)
    offset_mm: Array = field(default_factory=lambda: np.zeros((INNER_CORNERS[0] * INNER_CORNERS[1], 3)))

    def height(self, xy: Array) -> Array:
        """Of the plate (N,) at points (N, 2)."""
        x, y = (xy - SQUARE_MM * (np.array(INNER_CORNERS) - 1) / 2).T
        a, b, c = self.bend
        return np.asarray((a * x**2 + 2 * b * x * y + c * y**2) / 2)


def observe_boards(
    sensor: SyntheticSensor,
    rng: np.random.Generator,
    count: int = 14,
    noise: BoardNoise | None = None,
    tilt_rad: float = 0.6,
    step: int = 6,
    plate: PlateShape | None = None,
) -> list[BoardView]:
    """Views of a board, tilted by up to ``tilt_rad`` about both axes, with every ``step``-th point of its stripe."""
    noise, plate = noise or BoardNoise(), plate or PlateShape()
    row, column = np.divmod(np.arange(INNER_CORNERS[0] * INNER_CORNERS[1]), INNER_CORNERS[0])
    corners: Array = np.stack([column, row], -1) * np.float64(SQUARE_MM)
    printed = np.column_stack([corners, plate.height(corners)]) + plate.offset_mm
    views = []
    for k in range(count):
        a, b = rng.uniform(-tilt_rad, tilt_rad, 2) if tilt_rad > 0 else (0.1, 0.2)
        R = exp_so3(np.array([a, b, 0.0])) @ exp_so3(np.array([0, 0, rng.uniform(-3, 3)]))
        centre = np.array([rng.uniform(-35, 35), rng.uniform(-20, 20), rng.uniform(260, 320)])
        board = Pose(R, centre - R @ [*(corners.mean(axis=0)), 0.0])
        uv = _seen(sensor, board, printed)
        uv = uv + noise.corner_px * rng.standard_normal(uv.shape)
        covariance = np.broadcast_to(np.eye(2) * max(noise.corner_px, _LEAST) ** 2, (len(uv), 2, 2)).copy()
        stripe = _stripe(sensor, board, rng, noise.stripe_px, step, plate)
        views.append(BoardView(f"{k:03d}", Corners(corners, uv, covariance), stripe, axes=True, named=True))
    return views


def _seen(sensor: SyntheticSensor, board: Pose, xyz: Array) -> Array:
    """Pixels (N, 2) of points (N, 3) of a board T_camera_board."""
    fx, fy, cx, cy, *lens = sensor.camera.tolist()
    facing = Pose(np.eye(3), np.array([1.0, 0.0, 0.0]))  # any: points are given in the camera's frame
    camera = Camera(*SIZE_PX, fx, fy, cx, cy, facing, tuple(lens))
    return project(camera, facing @ (board @ xyz))


def _stripe(
    sensor: SyntheticSensor, board: Pose, rng: np.random.Generator, sigma_px: float, step: int, plate: PlateShape
) -> StripePoints:
    """Points where board and laser plane meet, on the board, moved across the stripe by its noise."""
    across = (board.R.T @ sensor.normal)[:2]
    reach = sensor.distance_mm - sensor.normal @ board.t
    along = np.array([-across[1], across[0]]) / np.hypot(*across)
    half = SQUARE_MM * max(INNER_CORNERS)
    way = np.arange(-half, half + _STEPS_MM / 2, _STEPS_MM)
    upward = float(board.R[:, 2] @ sensor.normal)
    straight = across * reach / (across @ across) + way[:, None] * along
    xy = straight
    for _ in range(_BENT):  # the plane meets a board of height z that much farther across
        xy = straight - across * (upward * plate.height(xy) / (across @ across))[:, None]
    high = SQUARE_MM * (np.array(INNER_CORNERS) - 1) + 0.8 * SQUARE_MM
    xy = xy[np.all((xy > -0.8 * SQUARE_MM) & (xy < high), axis=1)][::step]
    if len(xy) < 20:
        return StripePoints.nothing()
    uv = _seen(sensor, board, np.column_stack([xy, plate.height(xy)]))
    tangent = np.gradient(uv, axis=0)
    normal = np.column_stack([-tangent[:, 1], tangent[:, 0]]) / np.linalg.norm(tangent, axis=1)[:, None]
    moved = uv + normal * (sigma_px * rng.standard_normal(len(uv)))[:, None]
    return StripePoints(moved, normal, np.full(len(uv), max(sigma_px, _LEAST)))


def parameter_errors(solution: SensorSolution, truth: SyntheticSensor) -> Array:
    """Errors (P,), true less found, of the parameters that a solution's uncertainty names."""
    names = solution.uncertainty.parameters
    places = {name: i for i, name in enumerate(CAMERA_PARAMETERS)}
    camera = truth.camera - solution.camera
    T = solution.frame.T_sensor_camera
    x, y, z = -(T.R @ truth.normal)  # of the true plane's own x, in {P}
    origin, axis = T.inverse().t, T.R[0]  # of {P} and its x, in the camera's frame
    plane = {
        "plane_tilt_y_rad": float(np.arctan2(-z, x)),
        "plane_tilt_z_rad": float(np.arcsin(y)),
        "plane_shift_mm": float((truth.distance_mm - truth.normal @ origin) / (truth.normal @ axis)),
    }
    return np.array([plane[n] if n in plane else camera[places[n]] for n in names])
