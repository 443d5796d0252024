"""The bundle of camera, board poses and laser plane, and its start."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calib import engine
from calib.engine import Result
from calib.sensor.lens import PINHOLE, TERMS, undistort
from calib.sensor.shape import BEND, BENDS, PRINT, BoardShape
from calib.sensor.start import board_poses, fitted_plane, focal_length, view_homographies
from calib.sensor.terms import BOARD, CAMERA, PLANE, CornerResiduals, StripeNoise, StripeOnBoard
from calib.sensor.views import BoardViews
from geometry import Block, Pose, State, Unknowns, exp_so3
from geometry.sensor import CAMERA_PARAMETERS

Array = NDArray[np.float64]

_FOCAL_GRID = (0.7, 1.2, 2.0, 3.5, 6.0)  # of the image's width: from a wide lens to a long one
_MAX_STEPS = 30
_SETTLED_SIGMA = 0.03  # a step shorter than this many σ; shorter ones of all unknowns never end where a tilt is free
TILT_NAMES = ("tau_x", "tau_y")
TILT_PLACES = [CAMERA_PARAMETERS.index(name) for name in TILT_NAMES]
# what no lens exceeds: keeps a term that the views hardly tell from running away; far beyond what is usual
PRIOR_SIGMA = dict(zip(TERMS, (1.0, 5.0, 0.05, 0.05, 20.0, 5.0, 20.0, 50.0, 0.1, 0.5, 0.1, 0.5, 0.5, 0.5), strict=True))


# beside a tilt, with which they trade places: what decentred elements of a lens leave
TANGENTIAL_BESIDE_TILT = 3e-3
CENTRE_BESIDE_TILT = 0.03  # of the image's width: how far off its middle chips are mounted, which the tilt goes about


@dataclass(frozen=True, eq=False)
class SensorBundle:
    """Views with the terms of lens and board that are free, and the noise that their residuals have.

    All pixels are counted from the image's centre, so that priors have their mean at zero; width_px is the image's.
    tilt_rad: at which the chip's tilt is held, where it is not among the terms; None for an upright chip.
    shape: what is known of the board's; needed where BENDS or PRINT are among the terms.
    """

    views: BoardViews
    terms: tuple[str, ...]
    width_px: float
    corner_scale: float = 1.0
    stripe_noise: StripeNoise = field(default_factory=StripeNoise)
    tilt_rad: tuple[float, float] | None = None
    shape: BoardShape | None = None

    @property
    def unknowns(self) -> Unknowns:
        """Camera, plane, boards and their shape."""
        tilted = {"p1", "p2"} if "tau_x" in self.terms or self.tilt_rad is not None else set()
        lens = [TANGENTIAL_BESIDE_TILT if name in tilted else PRIOR_SIGMA[name] for name in TERMS]
        middle = CENTRE_BESIDE_TILT * self.width_px if tilted else np.inf
        sigma = [np.inf, np.inf, middle, middle, *lens]
        free = [name in PINHOLE or name in self.terms for name in CAMERA_PARAMETERS]
        blocks = [
            Block.vector(CAMERA, np.where(free, sigma, 0.0), free, labels=CAMERA_PARAMETERS),
            Block.pose(BOARD, self.views.names),
        ]
        if self.has_plane:
            blocks.append(Block.vector(PLANE, [np.inf] * 3))
        if self.shape is not None and BENDS[0] in self.terms:
            blocks.append(Block.vector(BEND, self.shape.sigma_bend, labels=BENDS))
        if self.shape is not None and PRINT in self.terms:
            blocks.append(Block.vector(PRINT, np.tile(self.shape.sigma_print_mm, len(self.shape.corners_mm))))
        return Unknowns(tuple(blocks))

    @property
    def has_plane(self) -> bool:
        """Whether any stripe was seen."""
        return len(self.views.stripe) > 0

    @property
    def corner_term(self) -> CornerResiduals:
        """The corners' evidence."""
        return CornerResiduals(self.views, self.corner_scale, self.shape)

    @property
    def stripe_term(self) -> StripeOnBoard:
        """The stripes' evidence."""
        return StripeOnBoard(self.views, self.stripe_noise, self.shape)

    @property
    def evidence(self) -> tuple[CornerResiduals] | tuple[CornerResiduals, StripeOnBoard]:
        """The terms that are summed."""
        return (self.corner_term, self.stripe_term) if self.has_plane else (self.corner_term,)

    def solve(self, start: State, max_steps: int = _MAX_STEPS, settled_sigma: float = _SETTLED_SIGMA) -> Result:
        """The least-squares solution from a start, where every block has a value but those of the board's shape."""
        known = State({b.name: start.values.get(b.name, b.at_rest()) for b in self.unknowns.blocks})
        begin = self.held(known)
        with np.errstate(over="ignore", invalid="ignore"):  # a trial step too far is refused by its cost
            return engine.solve(self.evidence, self.unknowns, begin, None, max_steps, settled_sigma)

    def held(self, state: State) -> State:
        """The state with all terms that are not free at zero, and the tilt where it is held."""
        kept = np.array([name in PINHOLE or name in self.terms for name in CAMERA_PARAMETERS])
        camera = np.where(kept, state.vector(CAMERA), 0.0)
        if self.tilt_rad is not None:
            camera[TILT_PLACES] = self.tilt_rad
        return state.with_value(CAMERA, camera)

    def covariance(self, result: Result) -> Array:
        """Of camera and plane (21, 21), whatever the board's shape."""
        return sensor_part(self.covariance_of_all(result), result.unknowns)

    def covariance_of_all(self, result: Result) -> Array:
        """Of all common unknowns (C, C): tilt, tangential terms and principal point can hardly be told apart."""
        try:
            return engine.exact_covariance(result)
        except np.linalg.LinAlgError:  # boards that leave something open: a large σ says so
            return engine.covariance(result).total

    def without_stripes(self) -> SensorBundle:
        """The bundle of the boards alone."""
        empty = tuple(replace(v, stripe=v.stripe[np.zeros(0, dtype=np.intp)]) for v in self.views.views)
        return replace(self, views=BoardViews(empty))


def sensor_part(covariance: Array, unknowns: Unknowns) -> Array:
    """Camera's and plane's part (21, 21) of a covariance (C, C) of all common unknowns."""
    places = np.concatenate([unknowns.indices(name) for name in (CAMERA, PLANE) if name in unknowns])
    return np.asarray(covariance[np.ix_(places, places)])


def camera_start(views: BoardViews, width_px: float) -> State:
    """Camera and boards from corners alone: closed form, then the bundle with one term of the lens."""
    closed = focal_length(view_homographies(views.views))
    tries = [closed] if 0.2 * width_px < closed < 20 * width_px else [k * width_px for k in _FOCAL_GRID]
    bundle = SensorBundle(views, ("k1",), width_px).without_stripes()
    best: Result | None = None
    for focal in tries:
        result = bundle.solve(_pinhole(views, focal))
        if np.isfinite(result.cost) and (best is None or result.cost < 0.999 * best.cost):
            best = result
    assert best is not None  # noqa: S101 - the grid is never empty
    return best.state


def tilted_start(state: State) -> State:
    """The same pictures, to first order, of a camera whose principal point is the image's centre, its chip tilted."""
    camera = state.vector(CAMERA)
    off = camera[2:4] / camera[:2]
    tilted = tilted_more(state, np.array([-off[1], off[0]]))
    camera = tilted.vector(CAMERA).copy()
    camera[[CAMERA_PARAMETERS.index(name) for name in ("p1", "p2")]] = 0.0
    return tilted.with_value(CAMERA, camera)


def tilted_more(state: State, tau_rad: Array) -> State:
    """The same pictures, to first order, of a camera whose chip is tilted by (2,) more.

    Tilt τ, a turn of the camera by (τx, τy, 0) and a shift of the principal point by f (-τy, τx) cancel.
    """
    camera = state.vector(CAMERA).copy()
    camera[2:4] += camera[:2] * np.array([-tau_rad[1], tau_rad[0]])
    camera[TILT_PLACES] += tau_rad
    turn = Pose(exp_so3(np.array([tau_rad[0], tau_rad[1], 0.0])), np.zeros(3))
    moved = state.with_value(CAMERA, camera).with_value(BOARD, turn @ state.pose(BOARD))
    return moved.with_value(PLANE, turn.R @ state.vector(PLANE)) if PLANE in state.values else moved


def _pinhole(views: BoardViews, focal: float) -> State:
    camera = np.zeros(len(CAMERA_PARAMETERS))
    camera[:2] = focal
    return State({CAMERA: camera, BOARD: board_poses(views, focal)})


def plane_start(views: BoardViews, state: State) -> State:
    """The state with the plane through what the boards make of the stripes' points."""
    return state.with_value(PLANE, fitted_plane(stripe_points(views, state)))


def stripe_points(views: BoardViews, state: State) -> Array:
    """Points (M, 3) [mm] where the stripes' rays meet their boards, in the camera's frame."""
    board, member = state.pose(BOARD), views.view_of_stripe
    return on_board(state.vector(CAMERA), Pose(board.R[member], board.t[member]), views.stripe.uv_px)


def on_board(camera: Array, board: Pose, uv_px: Array) -> Array:
    """Where the rays of pixels (M, 2) meet the plane z = 0 of boards (M or one), in the camera's frame (M, 3) [mm]."""
    q = np.concatenate([undistort(camera, uv_px).value, np.ones((len(uv_px), 1))], 1)
    normal = board.R[..., :, 2]
    reach = np.sum(normal * board.t, -1) / np.sum(normal * q, -1)
    return np.asarray(reach[:, None] * q)
