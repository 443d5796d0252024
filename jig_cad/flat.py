"""Targets of flat faces: a plane, a plate's straight edge, and a wedge of two faces that meet in a line."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Pose, SectionKind, Shape, Surface, Symmetry

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_USUAL_DEG = 90.0  # a wedge's angle to begin with where none is known
_LEAST_DEG, _MOST_DEG = 5.0, 175.0  # a wedge is neither a blade nor a plane


@dataclass(frozen=True, eq=False)
class Plane(Surface):
    """A flat face, z = 0 of its own frame; shifts along it and a turn about its normal do not show."""

    width_mm: float | None = None
    height_mm: float | None = None
    name: str = ""

    kind = "plane"
    section: SectionKind | None = "line"
    features: tuple[str, ...] = ("plane",)
    freedom: tuple[bool, ...] = (False, False, True, True, True, False)

    def offset(self, points_mm: Array, feature: Index) -> tuple[Array, Array]:
        """Height (N, 1) above the face, and its gradient (N, 1, 3)."""
        return points_mm[:, 2:], np.broadcast_to(np.array([0.0, 0.0, 1.0]), (len(points_mm), 1, 3))

    def at_place(self, T_base_target: Pose, sensors_mm: Array) -> dict[str, object]:
        """Its normal, towards the sensors, and its distance from the base's origin along it."""
        normal = T_base_target.R[:, 2]
        normal = normal * (-1.0 if normal @ (sensors_mm.mean(axis=0) - T_base_target.t) < 0 else 1.0)
        return {"normal": normal, "distance_mm": float(normal @ T_base_target.t)}

    def place(self, points_mm: Array, feature: Index) -> Pose | None:
        """The plane through the points, by least squares."""
        if len(points_mm) < 3:
            return None
        middle = points_mm.mean(axis=0)
        normal = np.linalg.svd(points_mm - middle, full_matrices=False)[2][2]
        return Pose(frame_with_z(normal), middle)


@dataclass(frozen=True, eq=False)
class Edge(Surface):
    """A straight border, the x axis of its own frame, that the profile meets in one point; two residuals a point."""

    name: str = ""

    kind = "edge"
    features: tuple[str, ...] = ("edge",)
    freedom: tuple[bool, ...] = (False, True, True, False, True, True)
    residuals_per_point = 2

    def offset(self, points_mm: Array, feature: Index) -> tuple[Array, Array]:
        """Components (N, 2) across the line, and their gradients (N, 2, 3)."""
        across = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
        return points_mm[:, 1:], np.broadcast_to(across, (len(points_mm), 2, 3))

    def at_place(self, T_base_target: Pose, sensors_mm: Array) -> dict[str, object]:
        """The line's point nearest the base's origin, and its direction."""
        return line_at_place(T_base_target)

    def place(self, points_mm: Array, feature: Index) -> Pose | None:
        """The line through the points, by least squares."""
        if len(points_mm) < 2:
            return None
        middle = points_mm.mean(axis=0)
        along = np.linalg.svd(points_mm - middle, full_matrices=False)[2][0]
        return Pose(frame_with_x(along), middle)


@dataclass(frozen=True, eq=False)
class Wedge(Surface):
    """Two faces that meet in the x axis; z out of the ridge (or valley) bisects them; a shift along x does not show.

    Parameters
    ----------
    angle_deg : float
        Between the faces, as stated, or to begin with where it is estimated.
    angle_known : bool
        Whether it was stated.
    """

    angle_deg: float = _USUAL_DEG
    angle_known: bool = True
    name: str = ""

    kind = "wedge"
    section: SectionKind | None = "line"
    features: tuple[str, ...] = ("face 1", "face 2")
    freedom: tuple[bool, ...] = (False, True, True, True, True, True)

    def __post_init__(self) -> None:
        """InputError where the angle can not be a wedge's."""
        if not _LEAST_DEG <= self.angle_deg <= _MOST_DEG:
            raise InputError(
                f"the wedge's angle_deg = {self.angle_deg:g}: must be between {_LEAST_DEG:g} and {_MOST_DEG:g}"
            )

    @property
    def shape(self) -> Shape:  # type: ignore[override] # an attribute of the base
        """The angle between the faces [rad]."""
        return Shape(("angle_rad",), np.array([0.0 if self.angle_known else np.inf]))

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:  # type: ignore[override] # an attribute of the base
        """The half turns about the three axes: that about x keeps each face, the others exchange them."""
        a, b = self.features
        same, other = {a: a, b: b}, {a: b, b: a}
        half = (np.diag([1.0, -1.0, -1.0]), np.diag([-1.0, 1.0, -1.0]), np.diag([-1.0, -1.0, 1.0]))
        renamed = (same, other, other)
        return tuple(Symmetry(Pose(R, np.zeros(3)), names) for R, names in zip(half, renamed, strict=True))

    def shaped(self, shape: Array) -> Wedge:
        """The wedge with another angle."""
        angle = self.angle_deg + float(np.rad2deg(shape[0]))
        return replace(self, angle_deg=float(np.clip(angle, _LEAST_DEG, _MOST_DEG)))

    @property
    def normals(self) -> Array:
        """Outward normals (2, 3) of both faces; the faces fall away from the ridge by half the angle each."""
        half = np.deg2rad(self.angle_deg) / 2
        return np.array([[0.0, np.cos(half), np.sin(half)], [0.0, -np.cos(half), np.sin(half)]])

    def offset(self, points_mm: Array, feature: Index) -> tuple[Array, Array]:
        """Height (N, 1) above each point's own face, and its gradient (N, 1, 3)."""
        n = self.normals[feature]
        return np.sum(n * points_mm, axis=1, keepdims=True), n[:, None, :]

    def by_shape(self, points_mm: Array, feature: Index) -> Array:
        """A wider wedge turns each face by half of what it opens."""
        half = np.deg2rad(self.angle_deg) / 2
        turned = np.array([[0.0, -np.sin(half), np.cos(half)], [0.0, np.sin(half), np.cos(half)]])[feature]
        return np.asarray(np.sum(turned * points_mm, axis=1)[:, None, None] / 2)

    def at_place(self, T_base_target: Pose, sensors_mm: Array) -> dict[str, object]:
        """The ridge as a line, both normals towards the sensors, and the angle."""
        normals = self.normals @ T_base_target.R.T
        towards = sensors_mm.mean(axis=0) - T_base_target.t
        normals = normals * np.where(normals @ towards < 0, -1.0, 1.0)[:, None]
        return line_at_place(T_base_target) | {"normals": normals, "angle_deg": self.angle_deg}

    def place(self, points_mm: Array, feature: Index) -> Pose | None:
        """The plane through each face's points, and where they meet."""
        faces = [points_mm[feature == k] for k in (0, 1)]
        if min(len(f) for f in faces) < 3:
            return None
        middles = [f.mean(axis=0) for f in faces]
        normals = [np.linalg.svd(f - m, full_matrices=False)[2][2] for f, m in zip(faces, middles, strict=True)]
        ridge = np.cross(normals[0], normals[1])
        if np.linalg.norm(ridge) < np.sin(np.deg2rad(_LEAST_DEG) / 2):
            return None
        rows = np.array([*normals, ridge / np.linalg.norm(ridge)])
        right = [normals[0] @ middles[0], normals[1] @ middles[1], rows[2] @ (middles[0] + middles[1]) / 2]
        foot = np.linalg.solve(rows, np.array(right))
        return wedge_frame(foot, rows[2], middles[0], middles[1])


def line_at_place(T_base_target: Pose) -> dict[str, object]:
    """The x axis in the base: its point nearest the origin, and its direction, the first number of weight positive."""
    along = T_base_target.R[:, 0]
    lead = along[int(np.argmax(np.abs(along) > 1e-9))]
    along = along * (-1.0 if lead < 0 else 1.0)
    return {"point_mm": T_base_target.t - along * (along @ T_base_target.t), "direction": along}


def wedge_frame(foot: Array, along: Array, on_first: Array, on_second: Array) -> Pose:
    """The pose whose x is the ridge through ``foot``, with one point of each face: face 1 lies at positive y.

    z points away from both faces.
    """
    arms = []
    for point in (on_first, on_second):
        arm = point - foot
        arm = arm - along * (arm @ along)
        arms.append(arm / np.linalg.norm(arm))
    y = arms[0] - arms[1]
    y = y / np.linalg.norm(y)
    x = along
    z = np.cross(x, y)
    if z @ (arms[0] + arms[1]) > 0:
        x, z = -x, -z
    return Pose(np.column_stack([x, y, z]), foot)


def frame_with_z(z: Array) -> Array:
    """A rotation whose third column is the unit vector z."""
    return np.roll(frame_with_x(z), -1, axis=1)


def frame_with_x(x: Array) -> Array:
    """A rotation by its first column; the second has no part along the base axis least like it.

    Parameters
    ----------
    x : (3,)
        A unit vector.

    Returns
    -------
    (3, 3) array
    """
    least = np.eye(3)[int(np.argmin(np.round(np.abs(x), 6)))]
    y = np.cross(least, x)
    y = y / np.linalg.norm(y)
    return np.column_stack([x, y, np.cross(x, y)])
