"""The figures of a location: the paper's Fig. 7, the 3-D spread, and the points' distances from their strings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle.problem import Points
from geometry import Pose, skew

Array = NDArray[np.float64]

_ITERATIONS = 30
_STEP_MM = 1e-9
_MEAN_ITERATIONS = 2


@dataclass(frozen=True, eq=False)
class Fit:
    """A location's jig pose fitted to all its frames; distance_mm (F, M) of points from strings, NaN where absent."""

    T_base_jig: Pose
    distance_mm: Array
    rms_mm: float


def fit_location(points: Points, Ts_base_sensor: Pose, anchors_mm: Array, start: Pose) -> Fit:
    """The pose T_base_jig with the least sum of squared perpendicular distances of the points from their strings.

    points: F frames of one location. Ts_base_sensor (F): by the chain. anchors_mm (A, 3): nominal or of the
    jig's file.
    """
    xyz = np.concatenate([np.zeros((*points.present.shape, 1)), points.yz_mm], -1)
    in_base = (Ts_base_sensor @ xyz)[points.present]
    starts = (points.start_weights @ anchors_mm)[points.present]
    along = (points.end_weights @ anchors_mm)[points.present] - starts
    unit = along / np.linalg.norm(along, axis=-1, keepdims=True)
    across = np.eye(3) - unit[:, :, None] * unit[:, None, :]  # (N, 3, 3)
    pose = start
    for _ in range(_ITERATIONS):
        p = pose.inverse() @ in_base
        r = (across @ (p - starts)[..., None]).reshape(-1)
        J = np.concatenate([-across, across @ skew(p)], -1).reshape(-1, 6)
        step = np.linalg.lstsq(J, -r, rcond=None)[0]
        pose = pose @ Pose.exp(step)
        if np.max(np.abs(step)) < _STEP_MM:
            break
    offset = (across @ ((pose.inverse() @ in_base) - starts)[..., None])[..., 0]
    distance = np.full(points.present.shape, np.nan)
    distance[points.present] = np.linalg.norm(offset, axis=-1)
    rms = float(np.sqrt(np.nanmean(distance**2))) if len(offset) else float("nan")
    return Fit(pose, distance, rms)


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
    limit = np.median(np.sort(nearest, axis=None)[: max(1, nearest.size // 2)]) * 10 + 1e-9
    best = int(np.argmin(np.sum(np.minimum(nearest, limit), axis=1)))
    choice = [int(np.argmin(distances[best, f : f + n])) for f, n in zip(first, counts, strict=True)]
    return mean_pose(every[(first + choice)[nearest[best] <= limit]]), choice


def pose_distance(a: Pose, b: Pose, reach_mm: float = 100.0) -> Array:
    """Distance [mm] of poses: of their origins, and of a point ``reach_mm`` away by the angle between them."""
    cosine = (np.einsum("...ij,...ij->...", a.R, b.R) - 1) / 2
    angle = np.arccos(np.clip(cosine, -1, 1))
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
