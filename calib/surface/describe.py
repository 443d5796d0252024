"""What is said of a surface at its place: centre, normal, ridge, in the base; and each frame's own centre of a ball."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.surface.condense import condensed
from geometry import Frame, Pose, Surface
from jig_cad import Balls, Edge, Plane, Sphere, Wedge

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NEARLY_WHOLE = 0.98  # of the radius: a section as large tells hardly how far off the middle it was cut
_LARGER = 0.04  # of the radius squared, by which sections may be larger than the ball: 2 % of their radius


def described(target: Surface, T_base_target: Pose, sensors_mm: Array) -> dict[str, object]:
    """A surface at its place, in the base; sensors_mm (F, 3): where the sensor looked from."""
    out: dict[str, object] = {"kind": target.kind}
    if isinstance(target, Sphere):
        return out | {"centre_mm": T_base_target.t, "diameter_mm": target.diameter_mm}
    if isinstance(target, Balls):
        centres = T_base_target @ target.centres_mm
        balls = zip(target.names, centres, target.diameters_mm.tolist(), strict=True)
        return out | {"balls": [{"name": n, "centre_mm": c, "diameter_mm": d} for n, c, d in balls]}
    if isinstance(target, Plane):
        normal = T_base_target.R[:, 2]
        normal = normal * (-1.0 if normal @ (sensors_mm.mean(axis=0) - T_base_target.t) < 0 else 1.0)
        return out | {"normal": normal, "distance_mm": float(normal @ T_base_target.t)}
    if isinstance(target, Edge | Wedge):
        along = T_base_target.R[:, 0]
        lead = along[int(np.argmax(np.abs(along) > 1e-9))]
        along = along * (-1.0 if lead < 0 else 1.0)
        out |= {"point_mm": T_base_target.t - along * (along @ T_base_target.t), "direction": along}
    if isinstance(target, Wedge):
        normals = target.normals @ T_base_target.R.T
        towards = sensors_mm.mean(axis=0) - T_base_target.t
        normals = normals * np.where(normals @ towards < 0, -1.0, 1.0)[:, None]
        out |= {"normals": normals, "angle_deg": target.angle_deg}
    if out.keys() == {"kind"}:
        out["T_base_target"] = T_base_target.matrix
    return out


def own_centres(
    target: Sphere, frames: Sequence[Frame], Ts_base_sensor: Pose, T_base_target: Pose
) -> tuple[Array, Mask]:
    """Centres (F, 3) in the base by each frame alone, and which frames tell one (F,).

    In the sheet by the circle, out of it √(R² - r²) on the side where the chain has it.
    """
    small = condensed(frames, target).frames
    centres, tells = np.zeros((len(frames), 3)), np.zeros(len(frames), dtype=bool)
    radius = target.diameter_mm / 2
    for i, f in enumerate(small):
        circle = _circle(f)
        if circle is None or circle[1] > NEARLY_WHOLE * radius:
            continue
        side = float((Ts_base_sensor[i].inverse() @ T_base_target).t[0])
        depth = np.sqrt(radius**2 - circle[1] ** 2) * (1.0 if side >= 0 else -1.0)
        centres[i] = Ts_base_sensor[i] @ np.array([depth, *circle[0]])
        tells[i] = True
    return centres, tells


def section_depths(frames: Sequence[Frame], Ts_base_sensor: Pose, T_base_target: Pose) -> Array:
    """How far (F,) [mm] beside its centre each frame cuts a ball."""
    return np.array([(Ts_base_sensor[i].inverse() @ T_base_target).t[0] for i in range(len(frames))])


def section_share(frames: Sequence[Frame], radius: float) -> float | None:
    """How far beside its centre frames cut a ball of this radius, root mean square over it, by the sections' radii.

    It needs no sensor centre position, and the radii's noise cancels out. None where no frame has the nodes of one, and
    where the sections are larger than any of this ball.
    """
    radii = [c[1] for f in frames if (c := _circle(f)) is not None]
    share = float(np.mean(1 - np.square(np.array(radii) / radius))) if radii else -np.inf
    return None if share < -_LARGER else float(np.sqrt(max(0.0, share)))


def _circle(f: Frame) -> tuple[Array, float] | None:
    """Centre (2,) and radius through a frame's three nodes."""
    if len(f.axis) != 3:
        return None
    a, b, c = f.axis.yz_mm
    u, v = b - a, c - a
    area = 2 * (u[0] * v[1] - u[1] * v[0])
    if abs(area) < 1e-9:
        return None
    away = np.array([v[1] * (u @ u) - u[1] * (v @ v), u[0] * (v @ v) - v[0] * (u @ u)]) / area
    return a + away, float(np.hypot(*away))
