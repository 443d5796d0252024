"""Which of a wedge's two faces each line lies on, by all frames of a location together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.surface.sections import sections_of
from geometry import Frame, Pose
from jig_cad import Wedge

Array = NDArray[np.float64]

_LEAST_TURN = 0.03  # sine of the angle between two lines of a face that still span its plane
_NEARLY = 4.0  # times the best naming's misfit: a drawing some degrees off makes a right one as large


def namings(group: Sequence[Frame], target: Wedge, T_hand_sensor: Pose) -> list[set[int]]:
    """Numbers of a location's frames whose faces must be exchanged for each face's lines to lie in one plane.

    Two frames span both planes; of all pairs, in either order, the one is taken that all frames fit best, and the
    planes' angle where it is known. Where the other order fits nearly as well it follows second: the sensor's place is
    a drawing's, and where all frames but one look alike, directions fit in either order.
    """
    ends: dict[int, dict[str, Array]] = {}
    for s in sections_of(group, target):
        ends.setdefault(s.frame, {})[s.group[1]] = np.array([s.place - s.direction, s.place + s.direction])
    whole = [k for k, lines in ends.items() if len(lines) == 2]
    single = [k for k, lines in ends.items() if len(lines) == 1]
    if len(whole) < 2:
        return [set()]
    a, b = target.features
    at = {k: group[k].at @ T_hand_sensor for k in ends}
    points = np.array([[at[k] @ ends[k][a], at[k] @ ends[k][b]] for k in whole])  # (F, 2, 2, 3): frame, face, end
    lines = points[:, :, 1] - points[:, :, 0]
    half = float(np.median(np.linalg.norm(lines, axis=-1))) / 2
    lines = lines / np.maximum(np.linalg.norm(lines, axis=-1, keepdims=True), 1e-9)
    first, second = np.triu_indices(len(whole), 1)
    found: list[tuple[float, set[int]]] = []
    orders = ([0, 1], [1, 0])
    across = [np.cross(lines[first], lines[second][:, order]) for order in orders]  # (P, 2, 3)
    # frames of one direction span the sheet in the other order, and no face in their own
    spans = np.min([np.linalg.norm(n, axis=-1).min(axis=1) for n in across], axis=0) > _LEAST_TURN
    for order, upright in zip(orders, across, strict=True):
        normals = upright / np.maximum(np.linalg.norm(upright, axis=-1, keepdims=True), 1e-9)
        middle = (points[first].mean(axis=2) + points[second][:, order].mean(axis=2)) / 2
        height = np.einsum("pki,flei->pfkle", normals, points) - np.sum(normals * middle, -1)[:, None, :, None, None]
        off = np.abs(height).mean(axis=-1)  # of each line from each plane
        straight, crossed = off[..., 0, 0] + off[..., 1, 1], off[..., 0, 1] + off[..., 1, 0]
        total = np.sum(np.minimum(straight, crossed), axis=1)
        if target.angle_known:
            cosine = np.abs(np.sum(normals[:, 0] * normals[:, 1], axis=-1))
            total = total + half * len(whole) * np.abs(cosine - abs(np.cos(np.deg2rad(target.angle_deg))))
        total = np.where(spans, total, np.inf)
        best = int(np.argmin(np.round(total, 9)))
        if np.isfinite(total[best]):
            choice = crossed[best] < straight[best]
            turned = {group[k].number for k, other in zip(whole, choice, strict=True) if other != choice[0]}
            for k in single:  # by the planes found
                ((feature, line),) = ends[k].items()
                in_base = at[k] @ line
                off_each = [np.mean(np.abs((in_base - middle[best, f]) @ normals[best, f])) for f in (0, 1)]
                other = bool(off_each[1] < off_each[0]) == (feature == a)
                if other != choice[0]:
                    turned.add(group[k].number)
            found.append((float(total[best]), turned))
    found = sorted(found, key=lambda f: round(f[0], 9))
    best_cost = found[0][0] if found else 0.0
    near = [turned for cost, turned in found if cost <= _NEARLY * best_cost + 1e-9]
    return [t for k, t in enumerate(near) if t not in near[:k]] or [set()]


def exchanged(f: Frame) -> Frame:
    """The frame with the names of a wedge's two faces exchanged."""
    other = {"face 1": "face 2", "face 2": "face 1"}
    return replace(f, axis=replace(f.axis, label=tuple(other.get(name, name) for name in f.axis.label)))
