"""What a profile sensor delivers of a target: rays of the fan against exact geometry, on the maker's grid, with noise.

The geometry is met here by its own equations, which nothing that solves uses; of a kind that has none here, by the
sections of its mesh.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Pose, Sensor, Target, field_of_view, inside_polygon
from geometry.sensor import ProfileOutput
from jig_cad import Balls, Edge, Jig, Plane, Sphere, Wedge
from jig_cad.bodies import FACE_MM, FACE_WIDTH_MM, PLATE_MM, target_meshes
from workbench.profiles import ScanLine

Array = NDArray[np.float64]
Meet = Callable[
    [Array, Array], tuple[Array, NDArray[np.intp]]
]  # origin (3,), directions (N, 3) to lengths and features

RAYS_A_POINT = 6
LEAST_SINE = 0.2  # between a ray and the profile it falls on; flatter, hardly any light comes back
LOST_SHARE = 0.003  # of the points: dust, and speckle's darkest grains
NOISE_OF_PITCH = 0.25  # σ of a point over the lateral pitch: as real and path-traced profiles scatter
POINTS = 1280  # of a profile, where a camera's own width says no more


@dataclass(frozen=True, eq=False)
class Profiler:
    """A profile sensor to be emulated: its grid, field and noise, and where its fan opens."""

    output: ProfileOutput
    field_mm: Array
    origin_mm: Array
    y_mm: Array
    sigma_mm: float


def profile_sensor(sensor: Sensor, form: str) -> Sensor:
    """The sensor as one that gives profiles in a format: a camera's field of view and columns make its grid."""
    output = sensor.profile
    field = field_of_view(sensor)
    low, high = float(field[:, 0].min()), float(field[:, 0].max())
    camera = sensor.camera
    if output is None:
        points = POINTS if camera is None else max(camera.width_px, camera.height_px)
        output = ProfileOutput(pitch_mm=float(f"{(high - low) / points:.4g}"))
    pitch = output.pitch_mm or (high - low) / POINTS
    start = output.start_mm if output.start_mm is not None else float(f"{low:.6g}")
    step = max(1, len(field) // 24)
    given = ProfileOutput(
        format=form,
        sigma_y_mm=output.sigma_y_mm or float(f"{pitch / np.sqrt(12):.4g}"),
        sigma_z_mm=output.sigma_z_mm or float(f"{NOISE_OF_PITCH * pitch:.4g}"),
        field_of_view_mm=output.field_of_view_mm if output.field_of_view_mm is not None else np.round(field[::step], 3),
        pitch_mm=pitch,
        start_mm=start,
        unit=output.unit,
        z_towards_sensor=output.z_towards_sensor,
    )
    return Sensor(sensor.sheet, profile=given, uncertainty=None, name=sensor.name)


def profiler(sensor: Sensor) -> Profiler:
    """The grid and field of a profile sensor; InputError where they are not stated."""
    output = sensor.profile
    if output is None:
        raise InputError("the sensor gives no profiles: its sensor.toml has no [profile]")
    field = output.require_field_of_view()
    if output.pitch_mm is None:
        raise InputError("the profile sensor's points are not known: give [profile] pitch_mm in its sensor.toml")
    start = float(field[:, 0].min()) if output.start_mm is None else output.start_mm
    count = int(np.floor((float(field[:, 0].max()) - start) / output.pitch_mm)) + 1
    y = start + output.pitch_mm * np.arange(count)
    return Profiler(
        output,
        field,
        sensor.sheet.origin_mm,
        np.asarray(y, dtype=np.float64),
        output.sigma_z_mm or NOISE_OF_PITCH * output.pitch_mm,
    )


def sheet_profile(
    what: Profiler, target: Target, T_sensor_target: Pose, rng: np.random.Generator, number: int | None = None
) -> ScanLine:
    """The scan line of one view, with the sensor's noise and missing points."""
    points, feature = _hits(what, target, T_sensor_target)
    z = np.full(len(what.y_mm), np.nan)
    eye = what.origin_mm[1:]
    for first, last in _runs(feature):
        piece = points[first:last]
        ray = piece - eye
        ray = ray / np.linalg.norm(ray, axis=1)[:, None]
        along = np.gradient(piece, axis=0)
        along = along / np.maximum(np.linalg.norm(along, axis=1), 1e-12)[:, None]
        seen = np.abs(ray[:, 0] * along[:, 1] - ray[:, 1] * along[:, 0]) >= LEAST_SINE
        order = np.argsort(piece[:, 0], kind="stable")
        inside = (what.y_mm >= piece[order[0], 0]) & (what.y_mm <= piece[order[-1], 0])
        here = np.interp(what.y_mm, piece[order, 0], piece[order, 1])
        open_ = np.interp(what.y_mm, piece[order, 0], seen[order].astype(float)) > 0.5
        nearer = np.isnan(z) | (np.abs(here - eye[1]) < np.abs(z - eye[1]))
        z = np.where(inside & open_ & nearer, here, z)
    grid = np.column_stack([what.y_mm, np.nan_to_num(z, nan=np.inf)])
    z = np.where(inside_polygon(np.where(np.isfinite(grid), grid, 1e9), what.field_mm), z, np.nan)
    z = z + rng.normal(size=len(z)) * what.sigma_mm
    z[rng.random(len(z)) < LOST_SHARE] = np.nan
    return ScanLine(what.y_mm, z, number=number)


def _hits(what: Profiler, target: Target, T_sensor_target: Pose) -> tuple[Array, NDArray[np.intp]]:
    """Where the fan's rays first meet the target (N, 2), and on what; feature −1 where nowhere."""
    eye = what.origin_mm[1:]
    corner = what.field_mm - eye
    middle = corner.mean(axis=0)
    away = np.arctan2(middle[0], middle[1])
    turn = np.arctan2(corner[:, 0], corner[:, 1]) - away
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    angle = away + np.linspace(turn.min(), turn.max(), RAYS_A_POINT * len(what.y_mm))
    ray = np.column_stack([np.zeros_like(angle), np.sin(angle), np.cos(angle)])
    back = T_sensor_target.inverse()
    length, feature = _meet(target)(np.asarray(back @ what.origin_mm), ray @ back.R.T)
    met = np.isfinite(length)
    points = eye + np.where(met, length, 0.0)[:, None] * ray[:, 1:]
    return points, np.where(met, feature, -1)


def _runs(feature: NDArray[np.intp]) -> list[tuple[int, int]]:
    """Neighbouring rays on one feature, two at least."""
    edges = np.flatnonzero(np.diff(feature)) + 1
    bounds = zip(np.concatenate([[0], edges]), np.concatenate([edges, [len(feature)]]), strict=True)
    return [(int(a), int(b)) for a, b in bounds if feature[a] >= 0 and b - a >= 2]


def _meet(target: Target) -> Meet:
    if isinstance(target, Sphere):
        return _balls(np.zeros((1, 3)), np.array([target.diameter_mm]))
    if isinstance(target, Balls):
        return _balls(target.centres_mm, target.diameters_mm)
    if isinstance(target, Plane):
        size = (target.width_mm or PLATE_MM[0], target.height_mm or PLATE_MM[1])
        return _plate((-size[0] / 2, size[0] / 2), (-size[1] / 2, size[1] / 2))
    if isinstance(target, Edge):
        return _plate((-PLATE_MM[0] / 2, PLATE_MM[0] / 2), (-PLATE_MM[1], 0.0))
    if isinstance(target, Wedge):
        return _wedge(target)
    if isinstance(target, Jig):
        return _strings(target)
    return _bodies(target)


def _bodies(target: Target) -> Meet:
    """Of a target without equations here: the sections in which the sheet cuts its meshes, a feature each."""
    import trimesh  # slow, and none of the shipped kinds needs it

    meshes = tuple(target_meshes(target).values())

    def meet(origin: Array, direction: Array) -> tuple[Array, NDArray[np.intp]]:
        ahead = direction[len(direction) // 2]
        across = np.cross(direction[0], direction[-1])
        across = across / np.linalg.norm(across)
        axes = np.array([ahead, np.cross(across, ahead)])
        ray = direction @ axes.T
        pieces = [trimesh.intersections.mesh_plane(mesh, across, origin) for mesh in meshes]  # type: ignore[no-untyped-call] # trimesh has no types
        return _nearest([_first_cut((np.asarray(p).reshape(-1, 2, 3) - origin) @ axes.T, ray) for p in pieces])

    return meet


def _first_cut(pieces: Array, ray: Array) -> Array:
    """Lengths (N,) along rays (N, 2), in the order of their angle, from the origin to the first of straight pieces.

    pieces (P, 2, 2): their ends. A piece is held against the rays between its ends alone; infinite where none is met.
    """
    out = np.full(len(ray), np.inf)
    angle, ends = np.arctan2(ray[:, 1], ray[:, 0]), np.sort(np.arctan2(pieces[..., 1], pieces[..., 0]), axis=1)
    first = np.searchsorted(angle, ends[:, 0], "left")
    last = np.where(np.ptp(ends, axis=1) < np.pi, np.searchsorted(angle, ends[:, 1], "right"), 0)  # none behind the eye
    for k in np.flatnonzero(last > first):
        mine = slice(first[k], last[k])
        start, way = pieces[k, 0], pieces[k, 1] - pieces[k, 0]
        turn = ray[mine, 0] * way[1] - ray[mine, 1] * way[0]
        with np.errstate(divide="ignore", invalid="ignore"):
            length = (start[0] * way[1] - start[1] * way[0]) / turn
        out[mine] = np.fmin(out[mine], np.where(length > 0, length, np.inf))
    return out


def _nearest(lengths: list[Array]) -> tuple[Array, NDArray[np.intp]]:
    every = np.array(lengths)
    return every.min(axis=0), every.argmin(axis=0)


def _balls(centres: Array, diameters: Array) -> Meet:
    def meet(origin: Array, direction: Array) -> tuple[Array, NDArray[np.intp]]:
        out = []
        for centre, diameter in zip(centres, diameters, strict=True):
            o = origin - centre
            b = direction @ o
            root = b**2 - (o @ o - diameter**2 / 4)
            out.append(np.where(root > 0, -b - np.sqrt(np.maximum(root, 0.0)), np.inf))
        return _nearest(out)

    return meet


def _plate(x_mm: tuple[float, float], y_mm: tuple[float, float]) -> Meet:
    def meet(origin: Array, direction: Array) -> tuple[Array, NDArray[np.intp]]:
        with np.errstate(divide="ignore", invalid="ignore"):
            length = -origin[2] / direction[:, 2]
            p = origin + length[:, None] * direction
            on = (
                (length > 0) & (p[:, 0] >= x_mm[0]) & (p[:, 0] <= x_mm[1]) & (p[:, 1] >= y_mm[0]) & (p[:, 1] <= y_mm[1])
            )
        return np.where(on, length, np.inf), np.zeros(len(length), dtype=np.intp)

    return meet


def _wedge(target: Wedge) -> Meet:
    """Two flat faces that fall away from the x axis, half of the angle from −z each; face 1 at positive y."""
    half = np.deg2rad(target.angle_deg) / 2

    def meet(origin: Array, direction: Array) -> tuple[Array, NDArray[np.intp]]:
        out = []
        for side in (1.0, -1.0):
            down = np.array([0.0, side * np.sin(half), -np.cos(half)])
            up = np.array([0.0, side * np.cos(half), np.sin(half)])
            with np.errstate(divide="ignore", invalid="ignore"):
                length = -(origin @ up) / (direction @ up)
                p = origin + length[:, None] * direction
                reach = p @ down
                on = (length > 0) & (reach >= 0) & (reach <= FACE_MM) & (np.abs(p[:, 0]) <= FACE_WIDTH_MM / 2)
            out.append(np.where(on, length, np.inf))
        return _nearest(out)

    return meet


def _strings(jig: Jig) -> Meet:
    radius = jig.string_diameter_mm / 2

    def meet(origin: Array, direction: Array) -> tuple[Array, NDArray[np.intp]]:
        out = []
        for start, end in zip(jig.starts, jig.starts + jig.directions * _lengths(jig)[:, None], strict=True):
            axis = (end - start) / np.linalg.norm(end - start)
            o = origin - start
            across_o, across_d = o - (o @ axis) * axis, direction - np.outer(direction @ axis, axis)
            a, b = np.sum(across_d**2, axis=1), across_d @ across_o
            root = b**2 - a * (across_o @ across_o - radius**2)
            length = (-b - np.sqrt(np.maximum(root, 0.0))) / np.maximum(a, 1e-12)
            along = (o + length[:, None] * direction) @ axis
            on = (root > 0) & (length > 0) & (along >= 0) & (along <= np.linalg.norm(end - start))
            out.append(np.where(on, length, np.inf))
        return _nearest(out)

    return meet


def _lengths(jig: Jig) -> Array:
    ends = jig.anchors_mm[jig.end_index] - jig.anchors_mm[jig.start_index]
    return np.asarray(np.linalg.norm(ends, axis=1))
