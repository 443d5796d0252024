"""The figures of a location: the paper's Fig. 7, the 3-D spread, and the points' distances from their target."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib import engine
from geometry import Block, Linearised, Pose, SheetPoints, State, Target, Unknowns, cross
from geometry.ties import first_least

Array = NDArray[np.float64]

_STEP_MM = 1e-9
_SAME_MM = 1e-6  # poses as near as this agree, be they ever so exact
_EQUAL_SHARE = 1e-3  # of the distance at which poses agree: what differs by less is equally near
_MEAN_ITERATIONS = 2
_FIT_TOLERANCE = 1e-8  # of a place, in units of its points' unit weight [mm]


@dataclass(frozen=True, eq=False)
class Fit:
    """A target's place fitted to frames of a location; distance_mm (F, M) of points from it, NaN where absent."""

    T_base_target: Pose
    distance_mm: Array
    rms_mm: float


@dataclass(frozen=True, eq=False)
class OffsetsFromTarget:
    """The evidence that points (N, 3), base axes, lie on a target's features, all weighted alike [mm].

    Unknown: "target", the one place T_base_target.
    """

    points_mm: Array
    feature: NDArray[np.intp]
    target: Target

    def residual(self, state: State) -> Array:
        """Perpendicular offsets (N, c)."""
        return self.target.offset(state.pose("target").inverse() @ self.points_mm, self.feature)[0]

    def linearise(self, state: State) -> Linearised:
        """With T·Exp((ρ, ω)) a point q, target axes, moves by -(ρ + ω × q)."""
        q = state.pose("target").inverse() @ self.points_mm
        offset, gradient = self.target.offset(q, self.feature)
        by_pose = np.concatenate([-gradient, -cross(q[:, None, :], gradient)], -1)
        weights = np.broadcast_to(np.eye(offset.shape[1]), (len(q), *offset.shape[1:], offset.shape[1]))
        return Linearised(offset, {"target": by_pose}, weights)


def fit_location(points: SheetPoints, Ts_base_sensor: Pose, target: Target, start: Pose) -> Fit:
    """The place T_base_target with the least sum of squared perpendicular distances of the points from the target.

    points: F frames of one location. Ts_base_sensor (F): by the chain.
    """
    seen = points.present
    term = OffsetsFromTarget((Ts_base_sensor @ points.xyz_mm)[seen], points.feature[seen], target)
    unknowns = Unknowns((Block.pose("target", free=target.freedom),))
    result = engine.solve([term], unknowns, State({"target": start}), tolerance=_FIT_TOLERANCE)
    place = result.state.pose("target")
    distance = distances(points, Ts_base_sensor, target, place)
    rms = float(np.sqrt(np.nanmean(distance**2))) if np.any(seen) else float("nan")
    return Fit(place, distance, rms)


def distances(points: SheetPoints, Ts_base_sensor: Pose, target: Target, place: Pose) -> Array:
    """Perpendicular distances (F, M) [mm] of points from the target at T_base_target, NaN where there is no point."""
    seen = points.present
    term = OffsetsFromTarget((Ts_base_sensor @ points.xyz_mm)[seen], points.feature[seen], target)
    distance = np.full(seen.shape, np.nan)
    distance[seen] = np.linalg.norm(term.residual(State({"target": place})), axis=-1)
    return distance


def max_deviation(distances_mm: Array) -> float | None:
    """Largest |distance - mean distance| [mm] (the paper's Fig. 7); None for fewer than two frames."""
    if len(distances_mm) < 2:
        return None
    return float(np.max(np.abs(distances_mm - np.mean(distances_mm))))


def spread_3d(origins_mm: Array) -> float | None:
    """Largest distance [mm] of the origins (N, 3) from their mean; None for fewer than two."""
    if len(origins_mm) < 2:
        return None
    return float(np.max(np.linalg.norm(origins_mm - origins_mm.mean(axis=0), axis=-1)))


def agreeing_pose(candidates: Sequence[Pose], reach_mm: float = 100.0) -> tuple[Pose, list[int]]:
    """The pose on which most frames agree, and which of each frame's candidates is nearest to it.

    candidates: one batch of poses T_base_jig a frame. reach_mm: what turns an angle into a length.
    """
    every = Pose(np.concatenate([c.R for c in candidates]), np.concatenate([c.t for c in candidates]))
    counts = np.array([len(c) for c in candidates])
    first = np.concatenate([[0], np.cumsum(counts)[:-1]])  # of each frame's candidates
    distances = pose_distance(every[:, None], every[None], reach_mm)  # (K, K)
    nearest = np.minimum.reduceat(distances, first, axis=1)  # (K, F)
    own = np.repeat(np.arange(len(counts)), counts)  # a candidate's distance from its own frame says nothing
    others = np.sort(nearest[own[:, None] != np.arange(len(counts))])
    limit = (np.median(others[: max(1, len(others) // 2)]) * 10 if len(others) else 0.0) + _SAME_MM
    # two frames agree with each other equally well: neither is chosen by rounding
    best = first_least(np.sum(np.minimum(nearest, limit), axis=1), _EQUAL_SHARE * limit)
    choice = [first_least(distances[best, f : f + n], _EQUAL_SHARE * limit) for f, n in zip(first, counts, strict=True)]
    return mean_pose(every[(first + choice)[nearest[best] <= limit]]), choice


def pose_distance(a: Pose, b: Pose, reach_mm: float = 100.0) -> Array:
    """Distance [mm] of poses: of their origins, and of a point ``reach_mm`` away by the angle between them."""
    chord = np.linalg.norm(a.R - b.R, axis=(-1, -2)) / (2 * np.sqrt(2))  # an arc cosine is rounding near equal poses
    angle = 2 * np.arcsin(np.minimum(chord, 1.0))
    return np.asarray(np.hypot(np.linalg.norm(a.t - b.t, axis=-1), reach_mm * angle))


def mean_pose(poses: Pose) -> Pose:
    """The mean of poses (N) that lie near one another (mean in the tangent space of the first, iterated)."""
    here = poses[0]
    for _ in range(_MEAN_ITERATIONS):
        step = np.mean((here.inverse() @ poses).log(), axis=0)
        here = here @ Pose.exp(step)
        if np.max(np.abs(step)) < _STEP_MM:
            break
    return here
