"""What a view of a surface would measure: the nodes of the section that the sheet cuts, with their names."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import AxisPoints, InputError, Pose, Surface
from jig_cad import Balls, Edge, Plane, Sphere, Wedge

Array = NDArray[np.float64]

NODE_MM = 0.01  # σ of a node: many points of some 0.05 mm that share their noise; joints weigh more
LEAST_SECTION = 0.3  # of a ball's radius: a smaller section is a cap that is hardly lit
ARC_RAD = 0.9  # to either side of a section's middle, that is lit
FACE_MM = (4.0, 20.0)  # from a wedge's ridge, between which its faces are seen
GRAZING_RAD = np.deg2rad(25.0)  # between the laser's ray and a face: a flatter one sends hardly any light back
LINE_MM = 15.0  # to either side, that a plate's line is seen
DEEP_MM, _DEPTHS, _LINES = 60.0, 121, 5  # before and behind, where any other surface is looked for, along five lines


def nodes_of(target: Surface, T: Pose, seen_mm: Array) -> AxisPoints:
    """The nodes of what the sheet cuts of a target at T_sensor_target; none where it cuts nothing.

    seen_mm (3,): where in {P} it is expected, of targets that reach farther than a view.
    """
    if isinstance(target, Sphere):
        nodes, labels = _arc(T.t, target.diameter_mm / 2, target.features[0])
    elif isinstance(target, Balls):
        parts = [
            _arc(c, d / 2, n)
            for n, c, d in zip(target.names, T @ target.centres_mm, target.diameters_mm, strict=True)
        ]  # fmt: skip
        nodes, labels = [p for part in parts for p in part[0]], [n for part in parts for n in part[1]]
    elif isinstance(target, Plane):
        nodes, labels = _line(T, seen_mm), [target.features[0]] * 2
    elif isinstance(target, Edge | Wedge):
        nodes, labels = _ridge(T, target)
    else:
        nodes, labels = _met(T, target, seen_mm)
    yz = np.array(nodes).reshape(-1, 2)
    n = len(yz)
    labels = labels if n else []
    cov = np.broadcast_to(NODE_MM**2 * np.eye(2), (n, 2, 2))
    return AxisPoints(tuple(labels), np.full(n, -1, dtype=np.intp), yz, cov, ("",) * n)


def _arc(centre: Array, radius: float, name: str) -> tuple[list[Array], list[str]]:
    if abs(centre[0]) > radius * np.sqrt(1 - LEAST_SECTION**2):
        return [], []
    section = float(np.sqrt(radius**2 - centre[0] ** 2))
    middle = np.arctan2(-centre[1], -centre[2])  # towards {P}'s origin
    angles = middle + np.array([-ARC_RAD, 0.0, ARC_RAD])
    return [centre[1:] + section * np.array([np.sin(a), np.cos(a)]) for a in angles], [name] * 3


def _line(T: Pose, seen: Array) -> list[Array]:
    n = T.R[:, 2]
    if abs(n[2]) < np.sin(GRAZING_RAD):
        return []
    y = seen[1] + np.array([-LINE_MM, LINE_MM])
    return [np.array([v, (n @ T.t - n[1] * v) / n[2]]) for v in y]


def _met(T: Pose, target: Surface, seen: Array) -> tuple[list[Array], list[str]]:
    """Points of any other surface: where lines along z first come upon it, about where it is seen."""
    if target.residuals_per_point != 1:
        raise InputError(f"views of a {target.kind} can not be proposed")
    y = seen[1] + np.linspace(-LINE_MM, LINE_MM, _LINES)
    z = seen[2] + np.linspace(-DEEP_MM, DEEP_MM, _DEPTHS)
    grid = np.stack(np.broadcast_arrays(0.0, y[:, None], z), axis=-1)  # (lines, depths, 3) in {P}
    points = (T.inverse() @ grid).reshape(-1, 3)
    nodes, labels = [], []
    for k, name in enumerate(target.features):
        off, gradient = target.offset(points, np.full(len(points), k))
        height = off.reshape(len(y), len(z))
        slope = np.abs((gradient[:, 0] @ T.R.T)[:, 2]).reshape(height.shape)
        for line, h in enumerate(height):
            came = np.flatnonzero((h[:-1] > 0) & (h[1:] <= 0))
            if len(came) and slope[line, came[0]] > np.sin(GRAZING_RAD):
                i = int(came[0])
                depth = z[i] + (z[i + 1] - z[i]) * h[i] / (h[i] - h[i + 1])
                nodes.append(np.array([y[line], depth]))
                labels.append(name)
    return nodes, labels


def _ridge(T: Pose, target: Edge | Wedge) -> tuple[list[Array], list[str]]:
    along = T.R[:, 0]
    if abs(along[0]) < 0.1:
        return [], []
    ridge = (T.t - along * (T.t[0] / along[0]))[1:]
    if isinstance(target, Edge):
        return [ridge], ["edge"]
    nodes, labels = [], []
    down = -T.R[:, 2]
    ray = np.array([0.0, *ridge]) / max(float(np.linalg.norm(ridge)), 1e-9)
    lit = T.R @ target.normals.T
    facing = -ray @ lit
    if np.min(np.abs(facing)) < np.sin(GRAZING_RAD) or facing[0] * facing[1] < 0:  # from outside, or both from inside
        return [], []
    for name, own in zip(target.features, target.normals, strict=True):
        n = T.R @ own
        line = np.array([n[2], -n[1]])
        line = line / max(float(np.linalg.norm(line)), 1e-9)
        away = T.R @ np.cross(own, [1.0, 0.0, 0.0])
        away = away if away @ down > 0 else -away
        line = line * (1.0 if line @ away[1:] >= 0 else -1.0)
        nodes += [ridge + s * line for s in FACE_MM]
        labels += [name] * 2
    return nodes, labels
