"""Synthetic cells of surface targets: the sheet's rays meet exact geometry; it knows no residuals and no sections."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from calib.synthetic.cell import DESIGN, TRUTH, CellFrames, default_sensor, industrial_arm
from geometry import (
    AxisPoints,
    DhRobot,
    Frame,
    NoAnswerError,
    Pose,
    Role,
    Surface,
    draw_errors,
    exp_so3,
    inverse_kinematics,
)
from jig_cad import Balls, Edge, Plane, Sphere, Wedge

Array = NDArray[np.float64]

STANDOFF_MM = (275.0, 305.0)
FAN_DEG = 44.0
_LONGEST = 1e9  # a ray that meets nothing
_TRIES = 12  # batches of views; an arm reaches some half of each
PLACES: tuple[tuple[str, Role, int], ...] = (
    ("A", "calibrate", 9),
    ("B", "calibrate", 9),
    ("C", "calibrate", 9),
    ("D", "verify", 8),
)


@dataclass(frozen=True)
class ProfileNoise:
    """Standard deviations: of a point across the stripe and how many neighbours it is shared by, of the joints.

    robot: whether the arm is drawn from its own uncertainty. wobble_mm: of the sensor's pose that is not repeated.
    """

    point_mm: float = 0.03
    correlation: float = 0.0  # of neighbours, as in a first-order process
    joint_rad: float = float(np.deg2rad(0.003))
    robot: bool = True


@dataclass(frozen=True, eq=False)
class SurfaceCell:
    """A cell and its truth: T_base_target by location, readings (F, n) as commanded."""

    target: Surface
    robot: DhRobot
    built: DhRobot
    T_hand_sensor: Pose
    T_base_target: Mapping[str, Pose]
    location: tuple[str, ...]
    role: tuple[Role, ...]
    joints_rad: Array
    design: Pose = field(default=DESIGN)


def surface_cell(
    target: Surface,
    rng: np.random.Generator,
    places: tuple[tuple[str, Role, int], ...] = PLACES,
    noise: ProfileNoise | None = None,
    robot: DhRobot | None = None,
    tilt_deg: float = 30.0,
    roll_deg: float = 80.0,
) -> SurfaceCell:
    """A cell of random places and views within tilts and rolls, every one of which the arm reaches."""
    noise, robot = noise or ProfileNoise(), robot or industrial_arm()
    truth = TRUTH
    stands: dict[str, Pose] = {}
    location: list[str] = []
    role: list[Role] = []
    joints: list[Array] = []
    for k, (name, what, count) in enumerate(places):
        stands[name], found = _place(target, rng, k, robot, truth, count, tilt_deg, roll_deg)
        location += [name] * count
        role += [what] * count
        joints += list(found)
    built = robot.corrected(draw_errors(robot, rng)) if noise.robot else robot
    return SurfaceCell(target, robot, built, truth, stands, tuple(location), tuple(role), np.array(joints))


def _place(
    target: Surface,
    rng: np.random.Generator,
    k: int,
    robot: DhRobot,
    truth: Pose,
    count: int,
    tilt_deg: float,
    roll_deg: float,
) -> tuple[Pose, Array]:
    for _ in range(_TRIES):
        heading, radius = rng.uniform(-0.9, 0.9), rng.uniform(1300.0, 1750.0)
        t = np.array([radius * np.cos(heading), radius * np.sin(heading), rng.uniform(500.0, 1100.0)])
        outward = heading + rng.uniform(-0.4, 0.4)
        z = -np.array([np.cos(outward), np.sin(outward), 0.0])  # towards the robot, where the sensor looks from
        y = np.array([0.0, 0.0, 1.0])
        R = np.column_stack([np.cross(y, z), y, z]) @ exp_so3(rng.uniform(-0.35, 0.35, 3))
        if isinstance(target, Plane):  # planes of one orientation would leave a shift open
            R = R @ exp_so3(0.6 * np.array([np.cos(2.1 * k), np.sin(2.1 * k), 0.0]))
        place = Pose(R, t)
        views = place @ views_of(target, rng, 4 * count, tilt_deg, roll_deg)
        found = inverse_kinematics(robot, views @ truth.inverse(), rng, max_starts=6)
        good = found.joints[found.converged]
        if len(good) >= count:
            return place, good[:count]
    raise NoAnswerError("no place of the target can be reached")


def views_of(target: Surface, rng: np.random.Generator, count: int, tilt_deg: float, roll_deg: float) -> Pose:
    """T_target_sensor of views from about +z, tilted and rolled; a ball is cut up to 0.7 R beside its middle."""
    tilt = np.deg2rad(rng.uniform(-tilt_deg, tilt_deg, (count, 2)))
    turn = exp_so3(np.column_stack([tilt, np.zeros(count)]))
    roll = exp_so3(np.column_stack([np.zeros((count, 2)), np.deg2rad(rng.uniform(-roll_deg, roll_deg, count))]))
    looking = np.diag([1.0, -1.0, -1.0])  # the sensor's z against the target's
    if target.runs_along_x:  # the sheet crosses the ridge
        looking = np.array([[1.0, 0, 0], [0, -1, 0], [0, 0, -1]])
    R = turn @ looking @ roll
    if isinstance(target, Balls):
        return _views_of_balls(target, rng, R)
    off = np.zeros((count, 3))
    size = _size(target)
    off[:, 0] = rng.uniform(-0.7, 0.7, count) * size
    off[:, 1] = rng.uniform(-15, 15, count)
    off[:, 2] = -rng.uniform(*STANDOFF_MM, count)
    return Pose(R, (R @ off[..., None])[..., 0])


def _views_of_balls(target: Balls, rng: np.random.Generator, R: Array) -> Pose:
    """Views from these sides, every other one of two balls at once, else of one, up to 0.6 R beside the middle."""
    t = np.zeros((len(R), 3))
    for i in range(len(R)):
        a, b = rng.permutation(len(target.names))[:2]
        middle = target.centres_mm[a]
        if i % 2:
            along = target.centres_mm[b] - middle
            middle = (target.centres_mm[a] + target.centres_mm[b]) / 2
            y = along / np.linalg.norm(along) * rng.choice([-1.0, 1.0])
            z = R[i, :, 2] - y * (y @ R[i, :, 2])
            z = z / np.linalg.norm(z)
            R[i] = np.column_stack([np.cross(y, z), y, z])
        off = np.array([rng.uniform(-0.3, 0.3) * target.diameters_mm[[a, b]].min(), rng.uniform(-8, 8), 0.0])
        t[i] = middle + R[i] @ (off - np.array([0.0, 0.0, rng.uniform(*STANDOFF_MM)]))
    return Pose(R, t)


def _size(target: Surface) -> float:
    if isinstance(target, Sphere):
        return target.diameter_mm / 2
    return 15.0


def observe_surface(
    cell: SurfaceCell, rng: np.random.Generator, noise: ProfileNoise, points: int = 300, labelled: bool = True
) -> CellFrames:
    """Profiles of the cell as built: joints move with noise, points scatter along the rays.

    An edge is one point a profile, which no other one backs: it falls anywhere between two rays, so it is off across
    them, too, by up to half of their distance there.
    """
    true_joints = cell.joints_rad + rng.normal(size=cell.joints_rad.shape) * noise.joint_rad
    sensors = cell.built.pose(true_joints) @ cell.T_hand_sensor
    frames = []
    for i, name in enumerate(cell.location):
        T_sensor_target = sensors[i].inverse() @ cell.T_base_target[name]
        yz, label = section_points(cell.target, T_sensor_target, points)
        n = len(yz)
        if n == 0:
            continue
        scatter = _correlated(rng, n, noise.correlation) * noise.point_mm
        yz = yz * (1 + scatter / np.linalg.norm(yz, axis=1))[:, None]
        direction = yz / np.linalg.norm(yz, axis=1)[:, None]
        cov = noise.point_mm**2 * (direction[:, :, None] * direction[:, None, :] + 1e-4 * np.eye(2))
        if isinstance(cell.target, Edge):
            across = direction[:, ::-1] * [1.0, -1.0]
            pitch = 2 * np.tan(np.deg2rad(FAN_DEG) / 2) * float(yz[0, 1]) / points
            yz = yz + across * (pitch * rng.uniform(-0.5, 0.5))
            cov = cov + pitch**2 / 12 * across[:, :, None] * across[:, None, :]
        axis = AxisPoints(label, np.full(n, -1, dtype=np.intp), yz, cov, ("",) * n)
        frames.append(
            Frame(i, name, cell.role[i], joints_rad=cell.joints_rad[i], axis=axis, labels_given=labelled, n_points=n)
        )
    return CellFrames(tuple(frames), default_sensor(), cell.design)


def _correlated(rng: np.random.Generator, n: int, share: float) -> Array:
    """A first-order process (n,) of unit variance."""
    out = rng.normal(size=n)
    for k in range(1, n):
        out[k] = share * out[k - 1] + np.sqrt(1 - share**2) * out[k]
    return out


def section_points(target: Surface, T_sensor_target: Pose, count: int) -> tuple[Array, tuple[str, ...]]:
    """Points (N, 2) of the sheet on the target, at most ``count`` of them, and what each lies on."""
    if isinstance(target, Edge):
        return _edge_point(T_sensor_target)
    fan = np.deg2rad(FAN_DEG) / 2
    angle = np.linspace(-fan, fan, 8 * count)
    ray = np.column_stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)])
    T_target_sensor = T_sensor_target.inverse()
    origin, direction = T_target_sensor.t, ray @ T_target_sensor.R.T
    solid = next(meet for kind, meet in _SOLIDS.items() if isinstance(target, kind))
    length, label = solid(target, origin, direction)
    hit = np.flatnonzero(length < _LONGEST)
    hit = hit[np.unique(np.linspace(0, len(hit) - 1, min(count, len(hit))).astype(int))] if len(hit) else hit
    yz = (length[hit, None] * ray[hit])[:, 1:]
    return yz, tuple(label[k] for k in hit)


def _edge_point(T_sensor_target: Pose) -> tuple[Array, tuple[str, ...]]:
    """Where the border, the target's x axis, pierces the sheet x = 0."""
    x = T_sensor_target.R[:, 0]
    p = T_sensor_target.t - x * (T_sensor_target.t[0] / x[0])
    return p[None, 1:], ("edge",)


def _ball(centre: Array, radius: float, origin: Array, direction: Array) -> Array:
    """Lengths (N,) along rays to the near side of a ball."""
    o = origin - centre
    b = direction @ o
    root = b**2 - (o @ o - radius**2)
    return np.where(root > 0, -b - np.sqrt(np.maximum(root, 0.0)), np.inf)


def _meet_sphere(target: Sphere, origin: Array, direction: Array) -> tuple[Array, list[str]]:
    length = _ball(np.zeros(3), target.diameter_mm / 2, origin, direction)
    return length, ["sphere"] * len(length)


def _meet_balls(target: Balls, origin: Array, direction: Array) -> tuple[Array, list[str]]:
    balls = zip(target.centres_mm, target.diameters_mm, strict=True)
    every = np.array([_ball(c, d / 2, origin, direction) for c, d in balls])
    return every.min(axis=0), [target.names[k] for k in every.argmin(axis=0)]


def _meet_plane(target: Plane, origin: Array, direction: Array) -> tuple[Array, list[str]]:
    length = -origin[2] / direction[:, 2]
    p = origin + length[:, None] * direction
    on = (length > 0) & (np.abs(p[:, 0]) < 90.0) & (np.abs(p[:, 1]) < 70.0)
    return np.where(on, length, np.inf), ["plane"] * len(length)


def _meet_wedge(target: Wedge, origin: Array, direction: Array) -> tuple[Array, list[str]]:
    """Two half planes that fall away from the x axis, half of the angle from -z each."""
    half = np.deg2rad(target.angle_deg) / 2
    lengths = []
    for side in (1.0, -1.0):
        down = np.array([0.0, side * np.sin(half), -np.cos(half)])  # along the face, away from the ridge
        up = np.array([0.0, side * np.cos(half), np.sin(half)])  # out of it
        length = -(origin @ up) / (direction @ up)
        reach = (origin + length[:, None] * direction) @ down
        lengths.append(np.where((length > 0) & (reach > 0.5) & (reach < 40.0), length, np.inf))
    every = np.array(lengths)
    return every.min(axis=0), [target.features[k] for k in every.argmin(axis=0)]


_SOLIDS: dict[type[Surface], Callable[..., tuple[Array, list[str]]]] = {
    Sphere: _meet_sphere,
    Balls: _meet_balls,
    Plane: _meet_plane,
    Wedge: _meet_wedge,
}
