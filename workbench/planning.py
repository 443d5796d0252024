"""Robot configurations that see a jig: sampled views, kept where all strings can be measured, spread apart."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from geometry import (
    NoAnswerError,
    Pose,
    RobotModel,
    SensorModel,
    cross_plane_x0,
    exp_so3,
    field_of_view,
    inside_polygon,
    stack_poses,
)
from geometry.inverse_kinematics import inverse_kinematics
from jig_cad import Jig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
SeesAll = Callable[[Pose], bool]

BATCH = 96
MAX_BATCHES = 40
GIVE_UP = 60  # measurable views out of reach, not one within: the place is out of reach
POSTURE_RAD = np.deg2rad(70.0)  # an arm that swings its elbow over between two views would need a path planned
OUT_OF_REACH = "out of the robot's reach or joint limits"
POOL_FACTOR = 4  # feasible views gathered for each one wanted, from which the best spread are taken


@dataclass(frozen=True)
class ViewLimits:
    """Which views are asked for.

    tilt_deg: largest turn about the pillar and up or down. roll_deg: largest turn about the sensor's own depth axis.
    height: where up the pillar the sheet may aim, as parts of its height. margin_px: strip along the image's border
    kept free. separation_mm: least distance between two
    strings' points as emitter and camera see them. clearance_mm: least distance of the sensor's
    emitter and camera from the jig's box. end_mm: least distance of a point from its string's ends. mounting_deg: how
    far the sensor may be turned from where it is believed to be; all of the above must hold all the same.
    """

    tilt_deg: float = 32.0
    roll_deg: float = 35.0
    height: tuple[float, float] = (0.3, 0.7)
    margin_px: float = 15.0
    separation_mm: float = 2.5
    clearance_mm: float = 60.0
    end_mm: float = 6.0
    mounting_deg: float = 3.0


@dataclass(frozen=True, eq=False)
class Views:
    """Configurations at one place of the jig: joint readings (N, n) [rad] and the jig's poses in {P} (N)."""

    joints_rad: Array
    T_sensor_jig: Pose


@dataclass
class Tally:
    """How many views were tried, and why views were refused."""

    tried: int = 0
    refused: dict[str, int] = field(default_factory=dict)

    def refuse(self, why: str, mask: Mask) -> None:
        """Count the views of ``mask`` as refused for ``why``."""
        self.refused[why] = self.refused.get(why, 0) + int(np.sum(mask))

    def text(self) -> str:
        """``of 960 views tried, 500 out of the field of view, …``."""
        parts = [f"{n} {why}" for why, n in sorted(self.refused.items(), key=lambda item: -item[1]) if n]
        return f"of {self.tried} views tried: " + ", ".join(parts)


@dataclass(frozen=True, eq=False)
class ViewProblem:
    """One place of the jig: what the user knows, and what a view must fulfil.

    sees_all: tells whether the strings are free of occlusion at a pose T_sensor_jig; None takes it for granted.
    """

    robot: RobotModel
    sensor: SensorModel
    jig: Jig
    T_base_jig: Pose
    T_hand_sensor: Pose
    limits: ViewLimits = field(default_factory=ViewLimits)
    sees_all: SeesAll | None = None


def plan_views(problem: ViewProblem, count: int, rng: np.random.Generator) -> Views:
    """``count`` configurations that see all strings, within the joints' limits, with well-spread tilts and rolls.

    The same rng state gives the same configurations. Raises NoAnswerError, saying what stood in the way, where not
    enough can be found.
    """
    tally = Tally()
    pool = feasible_views(problem, count * POOL_FACTOR, rng, tally)
    if len(pool.joints_rad) < count:
        raise NoAnswerError(
            f"only {len(pool.joints_rad)} of {count} configurations found that see all strings ({tally.text()}); "
            "move the jig, widen the limits of the view, or ask for fewer"
        )
    chosen = spread(pool.T_sensor_jig, problem.jig, count)
    return Views(pool.joints_rad[chosen], pool.T_sensor_jig[chosen])


def spread(Ts_sensor_jig: Pose, jig: Jig, count: int) -> NDArray[np.intp]:
    """Indices of ``count`` views that lie far from each other: each next one is the farthest from those taken.

    The distance is that of the rotations [rad] and of the jig's centre in {P} over its size.
    """
    centre = jig.anchors_mm.mean(axis=0)
    place = (Ts_sensor_jig @ centre) / (2 * max(jig.side_mm, jig.height_mm))
    features = np.concatenate([Ts_sensor_jig.R.reshape(-1, 9) / np.sqrt(2), place], axis=1)
    first = int(np.argmax(np.linalg.norm(features - features.mean(axis=0), axis=1)))
    chosen = [first]
    distance = np.linalg.norm(features - features[first], axis=1)
    while len(chosen) < count:
        chosen.append(int(np.argmax(distance)))
        distance = np.minimum(distance, np.linalg.norm(features - features[chosen[-1]], axis=1))
    return np.array(chosen, dtype=np.intp)


def feasible_views(problem: ViewProblem, wanted: int, rng: np.random.Generator, tally: Tally | None = None) -> Views:
    """Up to ``wanted`` views that fulfil everything, in the order in which they were drawn."""
    tally = Tally() if tally is None else tally
    polygon = field_of_view(problem.sensor, problem.limits.margin_px)
    depths = _depth_range(polygon, 1.15 * problem.jig.side_mm)
    turns = _turns(problem.limits.mounting_deg)
    joints: list[Array] = []
    poses: list[Pose] = []
    seed: Array | None = None
    for _ in range(MAX_BATCHES):
        T_sensor_jig = _sample_views(problem.jig, depths, problem.limits, rng).inverse()
        tally.tried += BATCH
        good = np.ones(BATCH, dtype=bool)
        for turn in turns:
            good &= _measurable(problem.sensor, problem.jig, problem.limits, turn @ T_sensor_jig, polygon, good, tally)
        T_sensor_jig = T_sensor_jig[good]
        if len(T_sensor_jig) == 0:
            continue
        goals = problem.T_base_jig @ T_sensor_jig.inverse() @ problem.T_hand_sensor.inverse()
        seed = _posture(problem.robot, goals, rng) if seed is None else seed
        if seed is None:
            tally.refuse(OUT_OF_REACH, np.ones(len(goals), dtype=bool))
            if tally.refused[OUT_OF_REACH] > GIVE_UP:
                break
            continue
        reached, q = _reach(problem.robot, goals, seed, rng, tally)
        for i in np.flatnonzero(reached):
            if problem.sees_all is not None and not all(problem.sees_all(turn @ T_sensor_jig[i]) for turn in turns):
                tally.refuse("hidden by strings, posts or plates", np.array([True]))
                continue
            joints.append(q[i])
            poses.append(T_sensor_jig[i])
            if len(joints) == wanted:
                return _views(joints, poses, problem.robot)
    return _views(joints, poses, problem.robot)


def free_views(sensor: SensorModel, jig: Jig, limits: ViewLimits, count: int, rng: np.random.Generator) -> Pose:
    """Poses T_sensor_jig (count) of views without a robot, in which every string crosses the field of view."""
    tally = Tally()
    polygon = field_of_view(sensor, limits.margin_px)
    depths = _depth_range(polygon, 1.15 * jig.side_mm)
    poses: list[Pose] = []
    for _ in range(10 * MAX_BATCHES):
        T_sensor_jig = _sample_views(jig, depths, limits, rng).inverse()
        tally.tried += BATCH
        good = _measurable(sensor, jig, limits, T_sensor_jig, polygon, np.ones(BATCH, dtype=bool), tally)
        poses += [T_sensor_jig[i] for i in np.flatnonzero(good)]
        if len(poses) >= count:
            return stack_poses(poses[:count])
    raise NoAnswerError(f"only {len(poses)} of {count} views found that show all strings ({tally.text()})")


def _posture(robot: RobotModel, goals: Pose, rng: np.random.Generator) -> Array | None:
    """The readings that reach one of the goals with the joints turned least; the other views keep near them."""
    reached = inverse_kinematics(robot, goals, rng)
    joints = reached.joints[reached.converged]
    return joints[np.argmin(np.sum(joints**2, axis=1))] if len(joints) else None


def _reach(robot: RobotModel, goals: Pose, seed: Array, rng: np.random.Generator, tally: Tally) -> tuple[Mask, Array]:
    """Which goals (N) are reached without swinging the arm over, and the readings (N, n)."""
    found = inverse_kinematics(robot, goals, rng, seeds=seed)
    same = np.all(np.abs(found.joints[:, :3] - seed[:3]) <= POSTURE_RAD, axis=1)
    tally.refuse(OUT_OF_REACH, ~found.converged)
    tally.refuse("reached in another posture of the arm only", found.converged & ~same)
    return np.asarray(found.converged & same), found.joints


def _views(joints: list[Array], poses: list[Pose], robot: RobotModel) -> Views:
    return Views(np.array(joints).reshape(-1, robot.n_joints), stack_poses(poses))


def _sample_views(jig: Jig, depths: tuple[float, float], limits: ViewLimits, rng: np.random.Generator) -> Pose:
    """T_jig_sensor (BATCH): turned about the pillar, up or down and about the depth axis, aiming inside the pillar."""
    tilt, roll = np.deg2rad(limits.tilt_deg), np.deg2rad(limits.roll_deg)
    about_x = rng.uniform(-tilt, tilt, BATCH)
    about_y = rng.uniform(-tilt, tilt, BATCH)
    about_z = rng.uniform(-roll, roll, BATCH)
    ex, ey, ez = np.eye(3)
    R = exp_so3(about_x[:, None] * ex) @ exp_so3(about_y[:, None] * ey) @ exp_so3(about_z[:, None] * ez)
    low, high = limits.height
    depth_of_centroid = jig.side_mm / np.sqrt(3)
    aim = np.column_stack(
        [rng.uniform(low, high, BATCH) * jig.height_mm, np.zeros(BATCH), np.full(BATCH, depth_of_centroid)]
    )
    seen_at = np.column_stack(
        [np.zeros(BATCH), rng.uniform(-0.1, 0.1, BATCH) * jig.side_mm, rng.uniform(*depths, BATCH)]
    )
    return Pose(R, aim - (R @ seen_at[..., None])[..., 0])


def _depth_range(polygon: Array, width: float) -> tuple[float, float]:
    """Depths [mm] at which the field of view is as wide as the jig needs, and not far beyond: near is precise."""
    z = np.linspace(polygon[:, 1].min(), polygon[:, 1].max(), 200)
    y = np.linspace(polygon[:, 0].min(), polygon[:, 0].max(), 401)
    inside = inside_polygon(np.stack(np.broadcast_arrays(y[None, :], z[:, None]), -1), polygon)
    wide = z[inside.sum(axis=1) * (y[1] - y[0]) >= width]
    if len(wide) == 0:
        raise NoAnswerError(f"the sensor's field of view is nowhere {width:.0f} mm wide, as this jig needs")
    return float(wide[0]), float(min(wide[-1], 1.5 * wide[0]))


def _turns(mounting_deg: float) -> list[Pose]:
    """No turn, and turns of the sensor by ``mounting_deg`` either way about each of its axes."""
    if mounting_deg == 0:
        return [Pose.identity()]
    axes = np.concatenate([np.eye(3), -np.eye(3)]) * np.deg2rad(mounting_deg)
    return [Pose.identity(), *(Pose(exp_so3(w), np.zeros(3)) for w in axes)]


def _measurable(
    sensor: SensorModel, jig: Jig, limits: ViewLimits, T_sensor_jig: Pose, polygon: Array, still: Mask, tally: Tally
) -> Mask:
    """Views (N) in which every string crosses the sheet well inside the field of view and apart from the others."""
    starts, directions = T_sensor_jig @ jig.starts[None], (T_sensor_jig.R[:, None] @ jig.directions[..., None])[..., 0]
    points, along = cross_plane_x0(starts, directions)
    crosses = np.all((along > limits.end_mm) & (along < jig.lengths - limits.end_mm), axis=1)
    seen = np.all(inside_polygon(np.nan_to_num(points[..., 1:], nan=1e9), polygon), axis=1)
    apart = _separation(sensor, points) > limits.separation_mm
    clear = _clearance(sensor, jig, T_sensor_jig) > limits.clearance_mm
    tests = {
        "with a string beyond its ends": crosses,
        "out of the field of view": seen,
        "with two strings too near each other": apart,
        "with the sensor too near the jig": clear,
    }
    for why, fulfilled in tests.items():  # a view is refused once, for the first test it fails
        tally.refuse(why, still & ~fulfilled)
        still = still & fulfilled
    return np.asarray(still)


def _separation(sensor: SensorModel, points: Array) -> Array:
    """Least distance (N) [mm] of any two points (N, S, 3) across the rays of the emitter and of the camera.

    Two strings of one face of the pillar stand behind each other wherever that face points at the emitter.
    """
    least = np.full(len(points), np.inf)
    for source in (sensor.laser_origin_mm, sensor.camera_centre_mm):
        ray = points - source
        distance = np.linalg.norm(ray, axis=-1, keepdims=True)
        unit = ray / distance
        across = np.linalg.norm(np.cross(unit[:, :, None], unit[:, None]), axis=-1) * distance
        least = np.minimum(least, np.min(across + np.eye(points.shape[1]) * 1e9, axis=(1, 2)))
    return least


def _clearance(sensor: SensorModel, jig: Jig, T_sensor_jig: Pose) -> Array:
    """Least distance (N) [mm] of emitter and camera from the box around the jig's anchors."""
    body = T_sensor_jig.inverse() @ np.stack([sensor.laser_origin_mm, sensor.camera_centre_mm])[None]
    low, high = jig.anchors_mm.min(axis=0), jig.anchors_mm.max(axis=0)
    outside = np.maximum(np.maximum(low - body, body - high), 0)
    return np.asarray(np.min(np.linalg.norm(outside, axis=-1), axis=1))
