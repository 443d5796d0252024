"""What every kind of target says of itself: the protocol, what it predicts, and a base for surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, Protocol

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError
from geometry.points import SheetPoints
from geometry.pose import Pose, cross

Array = NDArray[np.float64]
Index = NDArray[np.intp]
SectionKind = Literal["line", "circle"]


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A motion that carries a target onto itself: points alone never tell T from T @ pose.

    Parameters
    ----------
    pose : the motion, in the target's axes.
    renaming : by the name of a feature the name of the one that the motion carries it onto.
    """

    pose: Pose
    renaming: Mapping[str, str]

    def relabelled(self, label: str) -> str:
        """The name under T @ pose of a point that is ``label`` under T."""
        return next(name for name, onto in self.renaming.items() if onto == label)


@dataclass(frozen=True, eq=False)
class Prediction:
    """What a target makes of measured points: k residuals [mm] a point, zero where a point is absent.

    residual (F, M, k). by_motion (F, M, k, 6): by a small motion ξ = (v, ω) of the target in sensor axes,
    Exp(ξ)·T_sensor_target. by_shape (F, M, k, S). by_point
    (F, M, k, 2): by the measured (y, z), through which the point's covariance acts; None where the residual is
    predicted less measured.
    """

    residual: Array
    by_motion: Array
    by_shape: Array
    by_point: Array | None = None


@dataclass(frozen=True, eq=False)
class Shape:
    """What of a target's own form is not known exactly: names and prior σ (S,) of its shape unknowns, 0 a priori."""

    labels: tuple[str, ...] = ()
    sigma: Array = field(default_factory=lambda: np.zeros(0))


class Target(Protocol):
    """What is measured. Everything that solves knows a target by this alone."""

    @property
    def features(self) -> tuple[str, ...]:
        """Names of what a point can lie on: strings, or one name for a surface."""

    @property
    def shape(self) -> Shape:
        """Its shape unknowns."""

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """Motions that carry it onto itself, the identity left out."""

    @property
    def freedom(self) -> tuple[bool, ...]:
        """Which of the six components of its pose, target axes, can be seen at all: a sphere does not show a turn."""

    @property
    def residuals_per_point(self) -> int:
        """The number k of residuals that a point gives."""

    def predict(self, T_sensor_target: Pose, shape: Array, points: SheetPoints) -> Prediction:
        """Residuals of F frames' points at the poses (F) and shape (S,), with their derivatives."""

    def offset(self, points_mm: Array, feature: Index) -> tuple[Array, Array]:
        """How far points (N, 3), target axes, are from its features (N,), and the derivative by the point.

        Perpendicular offsets (N, c) [mm], as vectors or as one signed number, and (N, c, 3).
        """


def target_at(target: Target | Mapping[str, Target], location: str) -> Target:
    """What stood at a location.

    Parameters
    ----------
    target : Target or mapping of str to Target
        One for all locations, or by location.
    location : str
        Its name.

    Returns
    -------
    Target
        The one that stood there.

    Raises
    ------
    InputError
        Where the mapping names none.
    """
    if not isinstance(target, Mapping):
        return target
    if location not in target:
        raise InputError(f"location {location} has no target: targets are given for {', '.join(target)}")
    return target[location]


class Surface:
    """Base of targets whose points lie on one surface: a subclass gives ``offset`` as one signed distance.

    The residual is the distance itself. What a subclass may say beside it: ``section``, the curve in which a plane cuts
    each of its features ("line" or "circle"), by which a frame's many points are condensed to few; ``shaped`` and
    ``by_shape`` where it has shape unknowns; ``place``, its pose from points in closed form; ``at_place``, what a
    report says of it.
    """

    kind: str = "surface"
    section: SectionKind | None = None
    features: tuple[str, ...] = ("surface",)
    shape: Shape = Shape()
    symmetries: tuple[Symmetry, ...] = ()
    freedom: tuple[bool, ...] = (True,) * 6
    residuals_per_point = 1

    def offset(self, points_mm: Array, feature: Index) -> tuple[Array, Array]:
        """Signed distance (N, 1) [mm] of points (N, 3) from the surface, and its gradient (N, 1, 3)."""
        raise NotImplementedError

    def shaped(self, shape: Array) -> Surface:
        """The surface with its shape unknowns at ``shape`` (S,)."""
        return self

    def by_shape(self, points_mm: Array, feature: Index) -> Array:
        """Derivative (N, k, S) of the offsets of points (N, 3) by the shape unknowns."""
        return np.zeros((len(points_mm), self.residuals_per_point, len(self.shape.sigma)))

    @property
    def runs_along_x(self) -> bool:
        """Whether it is a line's, an edge's or a ridge's: shifts along x alone do not show, and the sheet crosses x."""
        return self.freedom[:3] == (False, True, True)

    def at_place(self, T_base_target: Pose, sensors_mm: Array) -> dict[str, object]:
        """What a report says of the surface in the base; sensors_mm (F, 3): where the sensor looked from."""
        return {"T_base_target": T_base_target.matrix}

    def place(self, points_mm: Array, feature: Index) -> Pose | None:
        """The pose at which the surface passes through points (N, 3) about as well as it can; None where none is."""
        return None

    def predict(self, T_sensor_target: Pose, shape: Array, points: SheetPoints) -> Prediction:
        """Distances of the points from the surface.

        Where the target moves by v + ω × p at a point p, the point moves by as much less against it.
        """
        here = self.shaped(shape) if np.any(shape) else self
        q = T_sensor_target.inverse() @ points.xyz_mm  # (F, M, 3)
        flat, feature = q.reshape(-1, 3), points.feature.ravel()
        found = (*here.offset(flat, feature), here.by_shape(flat, feature))
        distance, gradient, by_shape = (x.reshape(*q.shape[:2], *x.shape[1:]) for x in found)
        seen = points.present[..., None]
        n = gradient * seen[..., None] @ np.swapaxes(T_sensor_target.R, -1, -2)[:, None]  # (F, M, k, 3) in {P}
        by_motion = np.concatenate([-n, -cross(points.xyz_mm[..., None, :], n)], -1)
        return Prediction(distance * seen, by_motion, by_shape * seen[..., None], n[..., 1:])
