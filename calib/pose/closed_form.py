"""The paper's closed form of the jig pose, Eqs. (5)-(10), with its misprints mended (every sign candidate kept)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, nearest_rotation
from jig_cad import Jig

Array = NDArray[np.float64]

LABELS = ("A", "B", "C", "B'", "C'")  # the paper's names
_SIGNS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])  # of θ₁, θ₂


@dataclass(frozen=True, eq=False)
class ClosedForms:
    """The four sign candidates of a batch (...): poses (..., 4), disagreement of h₁ (..., 4) [mm].

    cosines: a / l₁ and a / l₂ (..., 2); where one exceeds 1 the frame has no θ and its candidates are NaN.
    """

    T_sensor_jig: Pose
    h1_disagreement_mm: Array
    cosines: Array

    @property
    def defined(self) -> NDArray[np.bool_]:
        """Whether θ₁ and θ₂ exist (...)."""
        return np.asarray(np.all(self.cosines <= 1.0, axis=-1))


def closed_form_strings(jig: Jig) -> tuple[str, ...]:
    """The names of the strings in the order of LABELS; InputError where the jig is no pillar."""
    pillar = jig.require_pillar("the paper's closed form")
    return tuple(pillar.strings.get(role, role) for role in LABELS)


def closed_forms(yz_mm: Array, side_mm: float | Array, height_mm: float | Array) -> ClosedForms:
    """All sign candidates for points (..., 5, 2) [mm] in the order of LABELS; sides and heights (...).

    Source: Eqs. (5)-(10); B is shifted by A in Eq. (5), h₂' = h₂ - h₁ = l₁ sin θ₁ in Eq. (6) and likewise h₃',
    column 1 of R is the cross product of columns 2 and 3, and the point of Eq. (10) is (0, y_a, z_a).
    """
    a, h = np.asarray(side_mm, dtype=float)[..., None], np.asarray(height_mm, dtype=float)[..., None]
    p_a = yz_mm[..., 0, :]
    p_b, p_c, p_b1, p_c1 = np.moveaxis(yz_mm[..., 1:, :] - p_a[..., None, :], -2, 0)  # Eq. (5)
    l1, l2, d1, d2 = (np.linalg.norm(p, axis=-1)[..., None] for p in (p_b, p_c, p_b1, p_c1))
    cosines = np.concatenate(np.broadcast_arrays(a / l1, a / l2), -1)
    with np.errstate(invalid="ignore"):
        theta1, theta2 = np.arccos(a / l1) * _SIGNS[:, 0], np.arccos(a / l2) * _SIGNS[:, 1]
    from_b = h - d1 * np.cos(theta1) * h / a - d1 * np.sin(theta1)  # Eq. (7)
    from_c = d2 * np.cos(theta2) * h / a - d2 * np.sin(theta2)
    h1, h2, h3 = (from_b + from_c) / 2, l1 * np.sin(theta1), l2 * np.sin(theta2)
    R_jig_sensor = _rotation(p_b, p_c, h2, h3, a)
    R = np.swapaxes(R_jig_sensor, -1, -2)
    point = np.concatenate([np.zeros_like(p_a[..., :1]), p_a], -1)[..., None, :]
    t = point - R[..., :, 0] * h1[..., None]  # Eq. (10)
    return ClosedForms(Pose(R, t), np.abs(from_b - from_c), cosines)


def _rotation(p_b: Array, p_c: Array, h2: Array, h3: Array, a: Array) -> Array:
    """R_jig_sensor (..., 4, 3, 3) of Eqs. (8)-(9): columns 2 and 3 from the points B and C, NaN where θ is."""
    depth = np.broadcast_to(np.sqrt(3) / 2 * a, h2.shape)
    in_jig = np.stack(
        [
            np.stack([h2, np.broadcast_to(-a / 2, h2.shape), depth], -1),
            np.stack([h3, np.broadcast_to(a / 2, h3.shape), depth], -1),
        ],
        -1,
    )  # (..., 4, 3, 2)
    in_sensor = np.stack([p_b, p_c], -1)[..., None, :, :]  # (..., 1, 2, 2)
    columns = in_jig @ np.linalg.inv(in_sensor)
    defined = np.all(np.isfinite(columns), axis=(-1, -2), keepdims=True)
    columns = np.where(defined, columns, np.eye(3)[:, 1:])
    y, z = columns[..., 0], columns[..., 1]
    return np.where(defined, nearest_rotation(np.stack([np.cross(y, z), y, z], -1)), np.nan)
