"""The most telling next configurations on balls, plates, edges and wedges, by the bundle's own information.

A view is what the sensor has of the target: turned about the direction that the frames so far looked in, the target
seen where they saw it, a ball cut up to 0.7 of its radius beside its middle. What it would measure are the nodes of the
section that it cuts; what that tells is the information of the bundle, as for strings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Bundle, FrameInformation, Hands, Model, covariances_with, frame_information, scp_covariance
from calib.mount import chain_of
from geometry import (
    AxisPoints,
    Frame,
    InputError,
    NoAnswerError,
    Pose,
    Surface,
    exp_so3,
    field_of_view,
    inside_polygon,
    inverse_kinematics,
    log_so3,
    stack_poses,
    target_at,
)
from geometry.ties import first_least
from jig_cad import Balls, Sphere
from workbench.files import Cell
from workbench.plan.choose import DISTINCT_MM, LEVER_MM, size_mm
from workbench.plan.clearance import (
    carrying,
    room_at_target_mm,
    room_before_fixed,
    room_in_workspace_mm,
    standing,
)
from workbench.plan.nodes import nodes_of

Array = NDArray[np.float64]
Index = NDArray[np.intp]

POOL = 200  # views drawn at each location
_STARTS = 4  # of the inverse kinematics, beside the last frame's posture
_SAME = 1e-6  # of a size's logarithm: of views as good the first is taken
BESIDE = 0.7  # of a ball's radius, that a view cuts it beside its middle at most
SPREAD_MM = 12.0  # beside where the frames so far saw the target
HAND_NOISE_MM, HAND_NOISE_DEG = 0.1, 0.02  # of hand poses of which nothing is known yet


@dataclass(frozen=True, eq=False)
class NextView:
    """A configuration, and the size [mm] of the SCP's σ that is left with it, rotations at 300 mm.

    tilt_deg, roll_deg: against the mean of the views so far. room_mm: beside target and workspace, NaN without an arm.
    """

    frame: Frame
    size_mm: float
    tilt_deg: float
    roll_deg: float
    room_mm: float


@dataclass(frozen=True, eq=False)
class SurfacePlan:
    """Views in the order of choice, and the covariance (6, 6) of the SCP that is predicted with and without them.

    noise: the same with them, without the robot's own errors. random, random_noise (N, 6, 6): of as many views drawn at
    random from the same pools. frames: how many count.
    """

    views: tuple[NextView, ...]
    before: Array
    after: Array
    noise: Array
    random: Array
    random_noise: Array
    frames: int


@dataclass(frozen=True, eq=False)
class _Place:
    """One location of the problem: the target where it stands, and how the sensor looks at it.

    R_base_sensor: of the mean view. seen_mm (3,): where in {P} the point ``aim_mm`` (3,) of the base is seen.
    """

    name: str
    target: Surface
    T_base_target: Pose
    R_base_sensor: Array
    aim_mm: Array
    seen_mm: Array

    def cut_by(self, T_base_sensor: Pose) -> AxisPoints:
        """The nodes of what a view cuts; none where it cuts nothing."""
        return nodes_of(self.target, T_base_sensor.inverse() @ self.T_base_target, self.seen_mm)


@dataclass(frozen=True, eq=False)
class _Views:
    """Views drawn at one place: T_base_sensor (N), with the tilts and rolls [deg] that made them."""

    place: int
    T_base_sensor: Pose
    tilt_deg: Array
    roll_deg: Array
    axes: tuple[AxisPoints, ...]
    joints_rad: Array | None
    room_mm: Array


def next_views(
    cell: Cell,
    T_hand_sensor: Pose,
    places: dict[str, Pose],
    frames: Sequence[Frame],
    count: int,
    *,
    criterion: str = "E",
    model: Model = "scp",
    tilt_deg: float = 40.0,
    roll_deg: float = 90.0,
    hand_noise: tuple[float, float] | None = None,
    seed: int = 0,
    each: bool = False,
    compared: int = 0,
) -> SurfacePlan:
    """The ``count`` configurations that tell most beside the frames that there are.

    Parameters
    ----------
    cell
        With one kind of surface; its arm and workspace say what can be reached.
    T_hand_sensor, places
        As far as they are known: solved, or by design.
    frames
        Those that count as taken, with ``hand`` or poses.
    count
        How many, of all locations together; with ``each`` at every location.
    criterion
        What is made small: "D" the error ellipsoid's volume, "E" its longest axis, "A" the rms error.
    model
        What calibration will estimate.
    tilt_deg, roll_deg
        Largest turns of a view against the mean of those so far.
    hand_noise
        σ [mm], [deg] of hand poses without an arm.
    seed
        The same seed gives the same views.
    compared
        How many random plans are predicted beside.

    Raises
    ------
    InputError, NoAnswerError
        Where targets are mixed, nothing is known of a place, or no view can be reached.
    """
    rng = np.random.default_rng([seed, 7])
    given = [_place(cell, T_hand_sensor, name, T, frames) for name, T in places.items()]
    if len({id(p.target) for p in given}) != 1:
        raise InputError("views are proposed for one kind of target: these locations have several")
    names = [p.name for p in given]
    if each and cell.roles:
        given = [p for p in given if cell.roles.get(p.name, "calibrate") == "calibrate"] or given
        names = [p.name for p in given]
    taken = [f for f in frames if f.location in names and f.role == "calibrate"]
    pool = [_drawn(p, k, rng, tilt_deg, roll_deg, cell) for k, p in enumerate(given)]
    hands = [_hand(cell, f) for f in taken]
    axes = [given[names.index(f.location)].cut_by(T @ T_hand_sensor) for f, T in zip(taken, hands, strict=True)]
    keep = [i for i, a in enumerate(axes) if len(a)]
    problem = _Problem(cell, T_hand_sensor, given, model, hand_noise)
    base = problem.tells(
        [hands[i] for i in keep],
        [taken[i].joints_rad for i in keep],
        [axes[i] for i in keep],
        [names.index(taken[i].location) for i in keep],
    )
    start = next((f.joints_rad for f in reversed(taken) if f.joints_rad is not None), None)
    pool = [_reached(cell, p, v, T_hand_sensor, start, rng) for p, v in zip(given, pool, strict=True)]
    if all(len(v.axes) == 0 for v in pool):
        raise NoAnswerError("no view of the target is within the robot's reach and the workspace: move the target")
    told = [problem.of_views(v) for v in pool]
    first = base
    before = scp_covariance(base, np.arange(len(base.location)))
    number = max((f.number for f in cell.frames), default=-1) + 1
    chosen: list[NextView] = []
    fresh = [np.ones(len(v.axes), dtype=bool) for v in pool]
    for i in keep:
        k = names.index(taken[i].location)
        fresh[k] &= _apart(pool[k].T_base_sensor, hands[i] @ T_hand_sensor)
    left = {k: count if each else count * len(given) for k in range(len(given))}
    for _ in range(count * (len(given) if each else 1)):
        trials = []
        for k, views in enumerate(pool):
            if left[k] and np.any(fresh[k]):
                together = base.followed_by(told[k])
                old, new = np.arange(len(base.location)), len(base.location) + np.arange(len(views.axes))
                sizes = size_mm(covariances_with(together, old, new), criterion)
                sizes = np.where(fresh[k], sizes, np.inf)
                best = first_least(np.log(sizes), _SAME)
                trials.append((k, best, float(sizes[best])))
        if not trials:
            break
        k, i, size = trials[first_least([np.log(t[2]) for t in trials], _SAME)]
        left[k] -= 1
        base = base.followed_by(told[k][np.array([i])])
        views = pool[k]
        fresh[k] &= _apart(views.T_base_sensor, views.T_base_sensor[i])
        joints = None if views.joints_rad is None else views.joints_rad[i]
        hand = views.T_base_sensor[i] @ T_hand_sensor.inverse()
        hand = hand.inverse() if cell.mount == "fixed" else hand
        row = Frame(number + len(chosen), given[k].name, "calibrate", joints, hand if joints is None else None)
        row = with_file(cell, row)
        chosen.append(NextView(row, size, float(views.tilt_deg[i]), float(views.roll_deg[i]), float(views.room_mm[i])))
    every = np.arange(len(base.location))
    counts = [sum(v.frame.location == p.name for v in chosen) for p in given]
    others = [_at_random(first, told, counts, rng) for _ in range(compared)]
    return SurfacePlan(
        tuple(chosen),
        before,
        scp_covariance(base, every),
        scp_covariance(base, every, noise_alone=True),
        np.array([o[0] for o in others]).reshape(-1, 6, 6),
        np.array([o[1] for o in others]).reshape(-1, 6, 6),
        len(every),
    )


def _apart(views: Pose, one: Pose) -> NDArray[np.bool_]:
    """Which views (N) differ from one: equal ones tell nothing new of what does not average out."""
    off = one.inverse() @ views
    turn = np.linalg.norm(log_so3(off.R), axis=-1)
    return np.asarray(np.hypot(LEVER_MM * turn, np.linalg.norm(off.t, axis=-1)) > DISTINCT_MM)


def _at_random(
    base: FrameInformation, told: Sequence[FrameInformation], counts: Sequence[int], rng: np.random.Generator
) -> tuple[Array, Array]:
    """Covariances (6, 6), with the robot's errors and by noise alone, of as many views drawn from the same pools."""
    for info, n in zip(told, counts, strict=True):
        size = len(info.location)
        base = base.followed_by(info[np.sort(rng.choice(size, min(n, size), replace=False))])
    every = np.arange(len(base.location))
    return scp_covariance(base, every), scp_covariance(base, every, noise_alone=True)


@dataclass(frozen=True, eq=False)
class _Problem:
    cell: Cell
    T_hand_sensor: Pose
    places: list[_Place]
    model: Model
    hand_noise: tuple[float, float] | None

    def tells(
        self, hands: Sequence[Pose], joints: Sequence[Array | None], axes: Sequence[AxisPoints], member: Sequence[int]
    ) -> FrameInformation:
        """What frames tell that see such nodes."""
        names = [p.name for p in self.places]
        robot = chain_of(self.cell.mount, self.cell.robot)
        if robot is not None and all(q is not None for q in joints):
            own = Hands(robot, np.array([q for q in joints if q is not None]).reshape(-1, robot.n_joints))
        else:
            mm, deg = self.hand_noise or (HAND_NOISE_MM, HAND_NOISE_DEG)
            noise = np.diag(np.square([mm] * 3 + [np.deg2rad(deg)] * 3))
            own = Hands.at_poses(stack_poses(list(hands)), noise)
        bundle = Bundle.of(list(axes), [names[k] for k in member], self.places[0].target, own, names)
        stands = stack_poses([p.T_base_target for p in self.places])
        return frame_information(bundle, self.T_hand_sensor, stands, self.model)

    def of_views(self, views: _Views) -> FrameInformation:
        """What each view of a pool tells."""
        count = len(views.axes)
        joints: Sequence[Array | None] = [None] * count if views.joints_rad is None else list(views.joints_rad)
        back = self.T_hand_sensor.inverse()
        hands = [views.T_base_sensor[i] @ back for i in range(count)]
        return self.tells(hands, joints, views.axes, [views.place] * count)


def _reached(
    cell: Cell, place: _Place, views: _Views, T_hand_sensor: Pose, start: Array | None, rng: np.random.Generator
) -> _Views:
    """The views that the arm reaches within its limits, off target, floor and boxes; all where there is no arm."""
    arm = cell.robot
    if arm is None or len(views.axes) == 0:
        return views
    hands, thick = views.T_base_sensor @ T_hand_sensor.inverse(), cell.workspace.link_radius_mm
    if cell.mount == "fixed":  # the places are in the hand, which brings the target before the sensor
        found = inverse_kinematics(arm, hands.inverse(), rng, seeds=start, max_starts=_STARTS)
        stands = carrying(arm, found.joints, place.T_base_target, place.target, thick)
        room = room_before_fixed(stands, T_hand_sensor, cell.sensor, cell.workspace).least
    else:
        found = inverse_kinematics(arm, hands, rng, seeds=start, max_starts=_STARTS)
        stands = standing(arm, found.joints, T_hand_sensor, cell.sensor, thick)
        beside = room_at_target_mm(stands, place.target, place.T_base_target)
        room = np.minimum(beside, room_in_workspace_mm(stands, cell.workspace)[0])
    good = np.flatnonzero(found.converged & arm.within_limits(found.joints) & (room >= 0))
    return _Views(
        views.place,
        views.T_base_sensor[good],
        views.tilt_deg[good],
        views.roll_deg[good],
        tuple(views.axes[i] for i in good),
        found.joints[good],
        room[good],
    )


def _place(cell: Cell, T_hand_sensor: Pose, name: str, T_base_target: Pose, frames: Sequence[Frame]) -> _Place:
    target = target_at(cell.target, name)
    if not isinstance(target, Surface):
        raise InputError(f"location {name}: strings are planned for by their own views")
    mine = [f for f in frames if f.location == name]
    if mine:
        sensors = stack_poses([_hand(cell, f) for f in mine]) @ T_hand_sensor
        z, x = sensors.R[:, :, 2].mean(axis=0), sensors.R[0, :, 0]
        with_points = [(s, f) for s, f in zip((sensors[i] for i in range(len(mine))), mine, strict=True) if len(f.axis)]
        aim = T_base_target.t
        if with_points and not isinstance(target, Sphere):
            aim = np.mean([np.mean(s @ f.axis.xyz_mm, axis=0) for s, f in with_points], axis=0)
        seen = np.mean(sensors.inverse() @ np.broadcast_to(aim, (len(mine), 3)), axis=0)
    else:
        z = -T_base_target.R[:, 2]
        if isinstance(target, Sphere) and cell.mount == "fixed":
            z = -T_base_target.t / max(float(np.linalg.norm(T_base_target.t)), 1e-9)  # from without, towards the hand
        elif isinstance(target, Sphere):
            away = np.array([*T_base_target.t[:2], 0.0])
            z = away / max(float(np.linalg.norm(away)), 1e-9) - np.array([0.0, 0.0, 1.0])
        x = T_base_target.R[:, 0]
        seen, aim = np.array([0.0, *_middle(cell)]), T_base_target.t
    z = z / np.linalg.norm(z)
    x = x - z * (z @ x)
    x = x / np.linalg.norm(x) if np.linalg.norm(x) > 1e-3 else np.cross(z, np.eye(3)[int(np.argmin(np.abs(z)))])
    x = x / np.linalg.norm(x)
    return _Place(name, target, T_base_target, np.column_stack([x, np.cross(z, x), z]), aim, np.array([0.0, *seen[1:]]))


def _middle(cell: Cell) -> Array:
    """The middle (2,) of the field of view."""
    field_mm = _field(cell)
    if field_mm is None:
        raise InputError(
            f"{cell.sensor_path or 'sensor.toml'}: field_of_view_mm is missing, and no frame shows where the target is "
            "seen: give it, or record three frames first"
        )
    return np.asarray(field_mm.mean(axis=0))


def _field(cell: Cell) -> Array | None:
    if cell.sensor.profile is not None:
        return cell.sensor.profile.field_of_view_mm
    return field_of_view(cell.sensor)


def _hand(cell: Cell, f: Frame) -> Pose:
    if f.hand is not None:
        return f.hand
    fixed = cell.mount == "fixed"
    if f.T_base_hand is not None:
        return f.T_base_hand.inverse() if fixed and not f.sensor_fixed else f.T_base_hand
    robot = chain_of(cell.mount, cell.robot)
    if robot is None or f.joints_rad is None:
        raise InputError(f"frame {f.number} has neither joint readings with a robot nor a hand pose")
    return robot.pose(f.joints_rad[None])[0]


def with_file(cell: Cell, row: Frame) -> Frame:
    """The row with the name of the file that its image or profile is to have."""
    if cell.takes_profiles or cell.sensor.profile is not None:
        return replace(row, profile=f"profiles/{row.number:03d}.csv")
    return replace(row, image=f"images/{row.number:03d}.png")


def _drawn(place: _Place, k: int, rng: np.random.Generator, tilt: float, roll: float, cell: Cell) -> _Views:
    """Views of a place that cut the target within the field of view."""
    about = rng.uniform(-1, 1, (POOL, 2)) * np.deg2rad(tilt)
    spin = rng.uniform(-1, 1, POOL) * np.deg2rad(roll)
    none = np.zeros(POOL)
    turn = exp_so3(np.column_stack([about, none])) @ exp_so3(np.column_stack([none, none, spin]))
    seen = place.seen_mm + np.column_stack([none, rng.uniform(-1, 1, (POOL, 2)) * SPREAD_MM])
    if isinstance(place.target, Sphere):
        seen[:, 0] = rng.uniform(-BESIDE, BESIDE, POOL) * place.target.diameter_mm / 2
    aim = np.broadcast_to(place.aim_mm, (POOL, 3)).copy()
    if isinstance(place.target, Balls):
        which = rng.integers(0, len(place.target.names), POOL)
        aim = (place.T_base_target @ place.target.centres_mm)[which]
        seen[:, 0] = rng.uniform(-BESIDE, BESIDE, POOL) * place.target.diameters_mm[which] / 2
    R = place.R_base_sensor @ turn
    T = Pose(R, aim - (R @ seen[..., None])[..., 0])
    axes = [place.cut_by(T[i]) for i in range(POOL)]
    polygon = _field(cell)
    good = [
        i for i, a in enumerate(axes)
        if len(a) and (polygon is None or bool(np.all(inside_polygon(a.yz_mm, polygon))))
    ]  # fmt: skip
    index = np.array(good, dtype=np.intp)
    tilts = np.rad2deg(np.linalg.norm(about, axis=1))[index]
    room = np.full(len(good), np.nan)
    return _Views(k, T[index], tilts, np.rad2deg(spin)[index], tuple(axes[i] for i in good), None, room)
