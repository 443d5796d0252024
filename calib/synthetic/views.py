"""Synthetic single frames with known truth: sensors, jigs, views and lit spots among clutter, without images."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.synthetic.cell import axis_points
from calib.synthetic.lit_string import lit_centroids
from geometry import (
    Camera,
    Pose,
    Sensor,
    Sheet,
    SurfacePoints,
    exp_so3,
    field_of_view,
    inside_polygon,
    nearest_rotation,
)
from jig_cad import DEFAULT_STRINGS, STRINGS, Jig, sample_tolerance

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class JigView:
    """A jig as drawn (or measured) and as made, a sensor, and the pose in which every string crosses the lit sheet."""

    jig: Jig
    made: Jig
    sensor: Sensor
    T_sensor_jig: Pose

    @property
    def yz_mm(self) -> Array:
        """True axis points (S, 2) in {P}."""
        return axis_points(self.T_sensor_jig, self.made)


@dataclass(frozen=True)
class SpotNoise:
    """What happens to a frame's spots.

    sigma_yz_mm: noise of a spot. clutter: spots that are no string's. hidden, cut: how many strings are not seen, and
    are cut short by an occluder, which moves them by 0.25 to 0.5 mm. thread: albedo, gloss, roughness; None: random.
    """

    sigma_yz_mm: tuple[float, float] = (0.015, 0.03)
    clutter: int = 0
    hidden: int = 0
    cut: int = 0
    thread: tuple[float, float, float] | None = None


@dataclass(frozen=True, eq=False)
class LabelledTruth:
    """Spots of a frame and the string of each, "" for clutter; ``cut``: strings that were moved."""

    points: SurfacePoints
    label: tuple[str, ...]
    cut: tuple[str, ...]


def random_sensor(rng: np.random.Generator) -> tuple[Sensor, float]:
    """A line sensor that sees 180 to 260 mm at 150 to 500 mm, its camera on either side, and that distance [mm]."""
    base, distance = rng.uniform(60, 220) * rng.choice([-1, 1]), rng.uniform(150, 500)
    forward = np.array([-base, 0, distance]) / np.hypot(base, distance)
    right = np.array([0, rng.choice([-1.0, 1.0]), 0])
    R = nearest_rotation(np.column_stack([right, np.cross(forward, right), forward]))
    focal = 1280 * np.hypot(base, distance) / rng.uniform(180, 260)
    pose = Pose(R, np.array([base, 0.0, 0.0]))
    camera = Camera(1280, 1024, focal, focal, 639.5, 511.5, pose)
    return Sensor(Sheet(fan_rad=float(np.deg2rad(60))), camera), distance


def random_jig(rng: np.random.Generator, six: bool | None = None) -> tuple[Jig, Jig]:
    """A jig of five or six strings as known, nominal or (one in three) with measured anchors, and as made."""
    side = rng.uniform(60, 120)
    strings = tuple(STRINGS) if (rng.random() < 0.3 if six is None else six) else DEFAULT_STRINGS
    jig = Jig.nominal(side, rng.uniform(0.7, 1.3) * side, float(rng.choice([0.2, 0.3, 0.5])), 0.1, strings)
    made = sample_tolerance(jig, rng)
    return (replace(made, measured=True) if rng.random() < 0.33 else jig), made


def random_lines(rng: np.random.Generator, count: int) -> tuple[Jig, Jig]:
    """Lines between two plates, as known and as made: no two parallel, no shared anchor, no symmetry."""
    low = rng.uniform([-5, -60, -10], [10, 60, 90], (count, 3))
    high = rng.uniform([90, -60, -10], [110, 60, 90], (count, 3))
    anchors = {f"{end} {i}": tuple(p) for end, points in (("low", low), ("high", high)) for i, p in enumerate(points)}
    jig = Jig.of_lines(anchors, {f"line {i}": (f"low {i}", f"high {i}") for i in range(count)})
    return jig, sample_tolerance(jig, rng)


def random_pose(
    rng: np.random.Generator, jig: Jig, distance_mm: float, tilt_deg: tuple[float, float] = (2.0, 35.0)
) -> Pose:
    """A pose T_sensor_jig whose sheet crosses every string between its anchors; any direction, roll and half turn."""
    while True:
        direction, tilt = rng.uniform(0, 2 * np.pi), np.deg2rad(rng.uniform(*tilt_deg))
        sheet = exp_so3(tilt * np.array([0.0, np.cos(direction), np.sin(direction)]))
        R = sheet @ exp_so3(np.array([np.deg2rad(rng.normal(0, 60)), 0.0, 0.0]))
        if rng.random() < 0.3:
            R = R @ np.diag([-1.0, -1.0, 1.0])
        aim = np.array([rng.uniform(0.2, 0.8) * jig.height_mm, *rng.uniform([-0.2, 0.2], [0.2, 0.7]) * jig.side_mm])
        if jig.pillar is None:
            aim += jig.foot_mm - np.array([0, 0, 0.45]) * jig.side_mm
        T = Pose(R, aim - R @ np.array([0, rng.uniform(-15, 15), distance_mm * rng.uniform(0.9, 1.1)])).inverse()
        low, high = (T.R[0] @ p.T + T.t[0] for p in (jig.starts, jig.ends))  # how far before the sheet the ends stand
        share = low / (low - high)
        if np.all((share > 0.02) & (share < 0.98)):
            return T


def random_view(
    rng: np.random.Generator, six: bool | None = None, tilt_deg: tuple[float, float] = (2.0, 35.0), lines: int = 0
) -> JigView:
    """A random sensor that sees all strings of a random pillar, or of so many random ``lines``."""
    while True:
        sensor, distance = random_sensor(rng)
        polygon = field_of_view(sensor)
        jig, made = random_lines(rng, lines) if lines else random_jig(rng, six)
        for _ in range(30):
            view = JigView(jig, made, sensor, random_pose(rng, made, distance, tilt_deg))
            if np.all(inside_polygon(view.yz_mm, polygon)):
                return view


def observe_spots(view: JigView, noise: SpotNoise, rng: np.random.Generator) -> LabelledTruth:
    """The frame's spots, best score first: lit surfaces with noise, and clutter, alone and in rows."""
    strings = view.jig.strings
    thread = noise.thread or (rng.uniform(0.05, 0.7), float(rng.choice([0.0, 0.05, 0.3])), rng.uniform(0.15, 0.5))
    directions = view.made.directions @ view.T_sensor_jig.R.T
    lit = lit_centroids(view.yz_mm, directions, view.jig.string_diameter_mm / 2, view.sensor, thread)
    yz = lit + rng.normal(size=(len(strings), 2)) * noise.sigma_yz_mm
    order = rng.permutation(len(strings))
    seen, cut = np.sort(order[noise.hidden :]), order[noise.hidden : noise.hidden + noise.cut]
    angle = rng.uniform(0, 2 * np.pi, len(cut))
    yz[cut] += rng.uniform(0.25, 0.5, (len(cut), 1)) * np.column_stack([np.cos(angle), np.sin(angle)])
    other = _clutter(view.yz_mm, noise.clutter, rng)
    label = [*(strings[i] for i in seen), *[""] * len(other)]
    faint = np.where(
        rng.random(len(other)) < 0.7, rng.uniform(0.05, 0.5, len(other)), rng.uniform(0.5, 0.9, len(other))
    )
    score = np.concatenate([rng.uniform(0.75, 0.98, len(seen)), faint])
    best = np.argsort(-score, kind="stable")
    points = _points(np.concatenate([yz[seen], other])[best], score[best], noise)
    return LabelledTruth(points, tuple(label[i] for i in best), tuple(strings[i] for i in cut))


def disturbed(T_sensor_jig: Pose, jig: Jig, sigma_mm: float, sigma_deg: float, rng: np.random.Generator) -> Pose:
    """A guess: the pose turned and moved about the jig's middle."""
    middle = Pose(np.eye(3), jig.anchors_mm.mean(0))
    xi = np.concatenate([rng.normal(0, sigma_mm, 3), rng.normal(0, np.deg2rad(sigma_deg), 3)])
    return T_sensor_jig @ middle @ Pose.exp(xi) @ middle.inverse()


def _clutter(yz_mm: Array, count: int, rng: np.random.Generator) -> Array:
    low, high = yz_mm.min(0) - 40, yz_mm.max(0) + 40
    out: list[Array] = []
    while len(out) < count:
        start = rng.uniform(low, high)
        row = rng.integers(2, 6) if rng.random() < 0.3 else 1  # pieces of a broken stripe
        step = rng.normal(size=2) * [8, 1]
        out += [start + i * step + rng.normal(0, 0.1, 2) for i in range(row)]
    return np.array(out[:count]).reshape(-1, 2)


def _points(yz: Array, score: Array, noise: SpotNoise) -> SurfacePoints:
    n = len(yz)
    cov = np.tile(np.diag(np.square(noise.sigma_yz_mm)), (n, 1, 1))
    pixels = np.tile(0.01 * np.eye(2), (n, 1, 1))
    return SurfacePoints(
        np.zeros((n, 2)), pixels, yz, cov, score, ("",) * n, np.zeros(n), np.ones((n, 2)), np.full(n, 50.0)
    )
