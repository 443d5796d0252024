"""What a frame's condensed points say of each feature: a line, a circle or a point of the sheet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Frame, Surface, Target

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class FrameSection:
    """What one frame tells of one feature, in {P}: a line (a place and a direction), a circle or a point.

    frame: its place among the frames. group: location and feature. place (3,); direction (3,) of a line, times half of
    its length; radius of a circle.
    """

    frame: int
    group: tuple[str, str]
    kind: str
    place: Array
    direction: Array
    radius: float


def sections_of(frames: Sequence[Frame], target: Target) -> list[FrameSection]:
    """What each frame tells of each feature: of a plane's section a line, of a ball's a circle, else every point."""
    out = []
    for k, f in enumerate(frames):
        labels = np.array(f.axis.label)
        for feature in dict.fromkeys(f.axis.label):
            p = f.axis.xyz_mm[labels == feature]
            section = target.section if isinstance(target, Surface) else None
            group = (f.location, feature)
            nothing = np.zeros(3)
            if section == "line" and len(p) >= 2:
                middle = p.mean(axis=0)
                spread = np.linalg.svd(p - middle, full_matrices=False)
                half = float(spread[1][0]) / np.sqrt(len(p))
                out.append(FrameSection(k, group, "line", middle, half * spread[2][0], 0.0))
            elif section == "circle" and len(p) >= 3:
                circle = circle_through(p[:, 1:]) if len(p) == 3 else circle_through(p[[0, len(p) // 2, -1]][:, 1:])
                if circle is not None:
                    out.append(FrameSection(k, group, "circle", np.array([0.0, *circle[0]]), nothing, circle[1]))
            elif section is None:
                out += [FrameSection(k, group, "point", q, nothing, 0.0) for q in p]
    return out


def circle_through(yz: Array) -> tuple[Array, float] | None:
    """Centre and radius of the circle through three points (3, 2)."""
    a, b = yz[1] - yz[0], yz[2] - yz[0]
    area = 2 * (a[0] * b[1] - a[1] * b[0])
    if abs(area) < 1e-9:
        return None
    away = np.array([b[1] * (a @ a) - a[1] * (b @ b), a[0] * (b @ b) - b[0] * (a @ a)]) / area
    return yz[0] + away, float(np.hypot(*away))


def face_angles(frames: Sequence[Frame], target: Target) -> Array:
    """Angles [deg] between the two lines of every frame, where they open."""
    by_frame: dict[int, list[FrameSection]] = {}
    for s in sections_of(frames, target):
        by_frame.setdefault(s.frame, []).append(s)
    out = []
    for pair in by_frame.values():
        if len(pair) == 2:
            u, v = (s.direction / max(float(np.linalg.norm(s.direction)), 1e-9) for s in pair)
            apart = pair[1].place - pair[0].place
            u, v = u * np.sign(u @ apart or 1.0), -v * np.sign(v @ apart or 1.0)
            out.append(180.0 - float(np.rad2deg(np.arccos(np.clip(-u @ v, -1, 1)))))
    return np.array(out)
