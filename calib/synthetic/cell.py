"""Synthetic cells with known truth: robot, jig, poses and exact or noisy axis points, without images."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calib.calibrate import calibrate
from calib.config import CalibConfig
from calib.result import CalibrationResult
from geometry import (
    AxisPoints,
    Camera,
    DhRobot,
    Frame,
    NoAnswerError,
    Pose,
    Robot,
    Role,
    Sensor,
    Sheet,
    Target,
    cross_plane_x0,
    draw_errors,
    exp_so3,
    inside_polygon,
    stack_poses,
)
from geometry.robot import Compliance, deflection
from jig_cad import Jig, sample_tolerance

Array = NDArray[np.float64]

DESIGN = Pose.from_fixed_xyz_deg([0.0, 0.0, 20.0], [-17.0, -76.0, 117.0])  # the paper's Table 1
TRUTH = Pose.from_fixed_xyz_deg([-1.5241, 1.5871, 22.5287], [-16.8786, -75.5423, 116.5369])
_MOST_ROUNDS = 100  # of drawing views; one in ten or so crosses every string
_MOST_VIEWS = 2000  # of which not one fits the field: none will
_MOST_SWINGS = 60  # first readings around which the last joints were swung in vain
_TRIED = 4000  # readings of the last joints, of which one in some hundred sees every string
DEFAULT_PLACES: tuple[tuple[str, Role, int], ...] = (
    ("A", "calibrate", 7),
    ("B", "calibrate", 7),
    ("C", "calibrate", 7),
    ("D", "verify", 7),
)


@dataclass(frozen=True, eq=False)
class Layout:
    """Where the jig stands and how the sensor looks at it; ranges are uniform [low, high].

    moving: how many of the last joints move between the frames of a place, None for all. swing_joint_deg: how far, at
    most, each of these. field_mm (N, 2): polygon (y, z) of the sheet in which the strings must be crossed then.
    """

    places: tuple[tuple[str, Role, int], ...] = DEFAULT_PLACES
    standoff_mm: tuple[float, float] = (270.0, 310.0)
    tilt_deg: tuple[float, float] = (8.0, 26.0)  # of the sheet against the pillar's cross-section
    swing_deg: float = 25.0  # about the pillar, to either side
    half_turns: bool = True  # also views with the sensor rolled by 180 degrees
    radius_mm: tuple[float, float] = (1300.0, 1800.0)
    height_mm: tuple[float, float] = (500.0, 1200.0)
    moving: int | None = None
    swing_joint_deg: float = 40.0
    field_mm: Array | None = None


@dataclass(frozen=True)
class Noise:
    """Standard deviations of the measurements, and whether robot and jig are as drawn."""

    point_mm: float = 0.03
    joint_rad: float = float(np.deg2rad(0.003))
    robot: bool = True  # DH errors drawn from the robot's own uncertainty
    anchors: bool = True  # anchors drawn within the jig's tolerance
    compliance: Compliance | None = None  # joints that gravity bends; the bundle knows nothing of it


@dataclass(frozen=True, eq=False)
class SyntheticCell:
    """A cell and its truth; ``joints_rad`` (F, n) are the configurations as commanded."""

    robot: DhRobot
    jig: Jig
    T_hand_sensor: Pose
    T_base_jig: dict[str, Pose]
    location: tuple[str, ...]
    role: tuple[Role, ...]
    joints_rad: Array
    design: Pose = field(default=DESIGN)


@dataclass(frozen=True, eq=False)
class CellFrames:
    """The frames of a synthetic cell with labelled points, the sensor, the SCP by design, and places that are given."""

    frames: tuple[Frame, ...]
    sensor: Sensor
    design: Pose
    places: dict[str, Pose] = field(default_factory=dict)


def calibrated(
    observed: CellFrames, target: Target, robot: Robot | None, config: CalibConfig | None = None
) -> CalibrationResult:
    """``calibrate`` on what was observed of a cell."""
    return calibrate(observed.frames, target, robot, observed.sensor, observed.design, observed.places, config)


def industrial_arm() -> DhRobot:
    """A six-axis arm of 2.5 m reach (ABB's data sheet of the IRB 6640-180/2.55), standard DH, mm and radians."""
    theta = np.deg2rad([0.0, -90.0, 0.0, 0.0, 0.0, 180.0])
    alpha = np.deg2rad([-90.0, 0.0, -90.0, 90.0, -90.0, 0.0])
    return DhRobot.from_dh(theta, [780.0, 0, 0, 1142, 0, 200], [320.0, 1075, 200, 0, 0, 0], alpha, name="six-axis arm")


def default_sensor() -> Sensor:
    """A sensor at 290 mm stand-off; calibration of given axis points needs no more of it."""
    rotation = np.array([[0, -0.924016832, -0.382351793], [1, 0, 0], [0, -0.382351793, 0.924016832]])
    pose = Pose.from_matrix(np.vstack([np.column_stack([rotation, [120, 0, 0]]), [0, 0, 0, 1]]))
    return Sensor(Sheet(fan_rad=float(np.deg2rad(44.0))), Camera(1280, 1024, 2300.0, 2300.0, 639.5, 511.5, pose))


def random_cell(
    rng: np.random.Generator,
    layout: Layout | None = None,
    jig: Jig | None = None,
    robot: DhRobot | None = None,
    T_hand_sensor: Pose = TRUTH,
) -> SyntheticCell:
    """A cell with jig places and configurations drawn at random such that every view shows every string."""
    layout, jig, robot = layout or Layout(), jig or Jig.nominal(), robot or industrial_arm()
    T_base_jig: dict[str, Pose] = {}
    location: list[str] = []
    role: list[Role] = []
    joints: list[Array] = []
    for name, what, count in layout.places:
        place, readings = _place(rng, layout, jig, robot, T_hand_sensor, count)
        T_base_jig[name] = place
        location += [name] * count
        role += [what] * count
        joints += readings
    return SyntheticCell(robot, jig, T_hand_sensor, T_base_jig, tuple(location), tuple(role), np.array(joints))


def made_cell(cell: SyntheticCell, rng: np.random.Generator, noise: Noise) -> SyntheticCell:
    """The cell as built: DH errors and anchors drawn; the jig's places stay."""
    robot, jig = cell.robot, cell.jig
    if noise.robot:
        robot = robot.corrected(draw_errors(robot, rng))
    if noise.anchors:
        jig = sample_tolerance(jig, rng)
    return replace(cell, robot=robot, jig=jig)


def axis_points(T_sensor_jig: Pose, jig: Jig) -> Array:
    """Where the strings' axes cross the laser plane, (..., S, 2) as (y, z) in {P} [mm].

    By Plücker's coordinates in the jig's own axes: what solves carries the lines to the sensor, and shares no line
    with this. A line of direction d and moment m meets the plane n·p + c = 0 in (n × m - c d) / (n·d).
    """
    direction, moment = jig.ends - jig.starts, np.cross(jig.starts, jig.ends)
    normal, c = T_sensor_jig.R[..., None, 0, :], T_sensor_jig.t[..., None, 0, None]
    met = (np.cross(normal, moment) - c * direction) / np.sum(normal * direction, axis=-1, keepdims=True)
    return np.asarray(np.einsum("...ij,...sj->...si", T_sensor_jig.R[..., 1:, :], met) + T_sensor_jig.t[..., None, 1:])


def observe(
    cell: SyntheticCell, made: SyntheticCell, rng: np.random.Generator, noise: Noise, least_mm: float = 1e-6
) -> CellFrames:
    """Frames of the cell as made: true poses move with joint noise, points with point noise; labels are given.

    The σ of points is stated as drawn, ``least_mm`` at least.
    """
    true_joints = cell.joints_rad + rng.normal(size=cell.joints_rad.shape) * noise.joint_rad
    if noise.compliance is not None:
        true_joints = true_joints + deflection(made.robot, true_joints, noise.compliance)
    hand = made.robot.pose(true_joints)
    jigs = Pose(
        np.stack([made.T_base_jig[n].R for n in cell.location]), np.stack([made.T_base_jig[n].t for n in cell.location])
    )
    yz = axis_points((hand @ made.T_hand_sensor).inverse() @ jigs, made.jig)
    yz = yz + rng.normal(size=yz.shape) * noise.point_mm
    covariance = np.broadcast_to(np.eye(2) * max(noise.point_mm, least_mm) ** 2, (*yz.shape, 2))
    labels, spot = made.jig.strings, np.full(yz.shape[1], -1)
    frames = tuple(
        Frame(
            i,
            cell.location[i],
            cell.role[i],
            joints_rad=cell.joints_rad[i],
            axis=AxisPoints(labels, spot, yz[i], covariance[i], ("",) * len(labels)),
            labels_given=True,
        )
        for i in range(len(yz))
    )
    return CellFrames(frames, default_sensor(), cell.design)


def pose_cell(
    rng: np.random.Generator, layout: Layout | None = None, jig: Jig | None = None
) -> tuple[Pose, Pose, Pose]:
    """A cell without a robot: T_hand_sensor, and Ts_base_hand and Ts_base_jig of every frame, all drawn at random."""
    layout, jig = layout or Layout(), jig or Jig.nominal()
    near = DESIGN @ Pose.exp(rng.normal(size=6) * np.array([2.0] * 3 + [0.03] * 3))
    jigs = [Pose(exp_so3(rng.uniform(-2, 2, 3)), rng.uniform(-1500, 1500, 3)) for _ in layout.places]
    repeat = [p for p, (_, _, count) in zip(jigs, layout.places, strict=True) for _ in range(count)]
    Ts_base_jig = stack_poses(repeat)
    return near, Ts_base_jig @ views(rng, layout, jig, len(repeat)) @ near.inverse(), Ts_base_jig


def views(rng: np.random.Generator, layout: Layout, jig: Jig, count: int) -> Pose:
    """Poses T_jig_sensor (count) from which the sheet crosses every string well between its anchors."""
    found = _views(rng, layout, jig, 4 * count)
    for _ in range(_MOST_ROUNDS):
        if len(found) >= count:
            break
        more = _views(rng, layout, jig, 4 * count)
        found = Pose(np.concatenate([found.R, more.R]), np.concatenate([found.t, more.t]))
    if len(found) < count:
        raise NoAnswerError(
            "no view of this layout's crosses every string of the jig within the sensor's field of view"
        )
    return found[:count]


def _views(rng: np.random.Generator, layout: Layout, jig: Jig, n: int) -> Pose:
    direction, tilt = rng.uniform(0, 2 * np.pi, n), np.deg2rad(rng.uniform(*layout.tilt_deg, n))
    sheet = exp_so3(np.stack([np.zeros(n), tilt * np.cos(direction), tilt * np.sin(direction)], -1))
    swing = exp_so3(np.deg2rad(rng.uniform(-1, 1, n) * layout.swing_deg)[:, None] * np.array([1.0, 0.0, 0.0]))
    turned = (rng.random(n) < 0.5) & layout.half_turns
    roll = np.where(turned[:, None, None], np.diag([-1.0, -1.0, 1.0]), np.eye(3))
    x, y, z = jig.foot_mm
    z = z if jig.pillar is None else 0.58 * jig.side_mm
    aim = np.stack([x + jig.height_mm * rng.uniform(0.35, 0.65, n), y + rng.uniform(-10, 10, n), np.full(n, z)], -1)
    R = swing @ sheet @ roll
    T_jig_sensor = Pose(R, aim - R[..., 2] * rng.uniform(*layout.standoff_mm, n)[:, None])
    to_sensor = T_jig_sensor.inverse()
    starts, ends = (to_sensor @ np.broadcast_to(p, (n, *p.shape)) for p in (jig.starts, jig.ends))
    fraction = cross_plane_x0(starts, ends - starts)[1]
    return T_jig_sensor[np.flatnonzero(np.all((fraction > 0.05) & (fraction < 0.95), axis=1))]


def _place(
    rng: np.random.Generator, layout: Layout, jig: Jig, robot: DhRobot, T_hand_sensor: Pose, count: int
) -> tuple[Pose, list[Array]]:
    """One place of the jig, upright on a random heading, and ``count`` configurations that see it."""
    tried = swings = 0
    for _ in range(100):
        heading, radius = rng.uniform(-1.0, 1.0), rng.uniform(*layout.radius_mm)
        t = np.array([radius * np.cos(heading), radius * np.sin(heading), rng.uniform(*layout.height_mm)])
        outward = heading + rng.uniform(-0.5, 0.5)
        # x_jig up, z_jig away from the robot, so that the sensor looks outward
        z = np.array([np.cos(outward), np.sin(outward), 0.0])
        x = np.array([0.0, 0.0, 1.0])
        place = Pose(np.column_stack([x, np.cross(z, x), z]) @ exp_so3(rng.uniform(-0.3, 0.3, 3)), t)
        seen = _in_field(views(rng, layout, jig, 10 * count), layout, jig)
        tried += 10 * count
        if not len(seen) and tried > _MOST_VIEWS:
            raise NoAnswerError(
                "the jig does not fit into the sensor's field of view: choose a larger one, or another jig"
            )
        targets = place @ seen @ T_hand_sensor.inverse()
        readings: list[Array] = []
        for i in range(len(targets)):
            q = _reach(robot, targets[i], rng)
            if q is not None and layout.moving is not None:
                readings = _last_joints(rng, layout, jig, robot, (place, T_hand_sensor), q, count)
                swings += 1
                if not readings and swings > _MOST_SWINGS:
                    raise NoAnswerError(
                        f"moving the last {layout.moving} joints alone leaves too few views of the whole jig: let more "
                        "joints move, or choose a sensor that sees more"
                    )
            elif q is not None:
                readings.append(q)
            if len(readings) == count:
                return place, readings
    raise NoAnswerError("no place of the jig can be reached with this layout")


def _in_field(T_jig_sensor: Pose, layout: Layout, jig: Jig) -> Pose:
    """The views whose strings the sheet crosses within the sensor's field, where that counts."""
    if layout.field_mm is None or layout.moving is None:
        return T_jig_sensor
    points = axis_points(T_jig_sensor.inverse(), jig)
    return T_jig_sensor[np.flatnonzero(np.all(inside_polygon(points, layout.field_mm), axis=1))]


def _last_joints(
    rng: np.random.Generator,
    layout: Layout,
    jig: Jig,
    robot: DhRobot,
    chain: tuple[Pose, Pose],
    first: Array,
    count: int,
) -> list[Array]:
    """``first`` and further readings that differ from it in the last joints alone and see every string; [] if too few.

    chain: T_base_jig, T_hand_sensor.
    """
    place, T_hand_sensor = chain
    swing = np.zeros((_TRIED, robot.n_joints))
    swing[1:, -(layout.moving or 0) :] = rng.uniform(-1, 1, (_TRIED - 1, layout.moving or 0))
    q = first + np.deg2rad(layout.swing_joint_deg) * swing
    to_sensor = (robot.pose(q) @ T_hand_sensor).inverse() @ place
    starts, ends = (to_sensor @ np.broadcast_to(p, (_TRIED, *p.shape)) for p in (jig.starts, jig.ends))
    points, fraction = cross_plane_x0(starts, ends - starts)
    seen = np.all((fraction > 0.05) & (fraction < 0.95), axis=1) & robot.within_limits(q)
    if layout.field_mm is not None:
        seen &= np.all(inside_polygon(points[..., 1:], layout.field_mm), axis=1)
    found = np.flatnonzero(seen)
    return [q[i] for i in found[:count]] if seen[0] and len(found) >= count else []


def _reach(robot: DhRobot, target: Pose, rng: np.random.Generator) -> Array | None:
    """Joint readings (n,) [rad] that bring the hand to ``target``, or None (Newton from a random start, damped)."""
    n = robot.n_joints
    q = rng.uniform(-1, 1, n) * np.array([1.2, 0.6, 0.6, 3.0, 1.6, 3.0, *[1.0] * max(0, n - 6)])[:n]
    for i in range(60):
        error = (robot.pose(q).inverse() @ target).log()
        if np.linalg.norm(error) < 1e-9:
            q = np.mod(q + np.pi, 2 * np.pi) - np.pi
            return np.asarray(q) if abs(q[min(4, n - 1)]) > 0.2 and bool(robot.within_limits(q)) else None
        scale = np.array([500.0] * 3 + [1.0] * 3)
        J = robot.joint_jacobian(q) / scale[:, None]
        damping = 1e-3 if i < 10 else 1e-9
        step = J.T @ np.linalg.solve(J @ J.T + damping * np.eye(6), error / scale)
        q = q + step * min(1.0, 0.5 / max(float(np.max(np.abs(step))), 1e-12))
    return None
