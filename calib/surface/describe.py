"""What is said of a surface at its place: centre, normal, ridge, in the base; and each frame's own centre of a ball."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.surface.condense import condensed
from calib.surface.sections import circle_through
from geometry import Frame, Pose, Surface
from jig_cad import Sphere

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

NEARLY_WHOLE = 0.98  # of the radius: a section as large tells hardly how far off the middle it was cut
_LARGER = 0.04  # of the radius squared, by which sections may be larger than the ball: 2 % of their radius


def described(target: Surface, T_base_target: Pose, sensors_mm: Array) -> dict[str, object]:
    """A surface at its place, in the base; sensors_mm (F, 3): where the sensor looked from."""
    return {"kind": target.kind} | target.at_place(T_base_target, sensors_mm)


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
    return circle_through(f.axis.yz_mm) if len(f.axis) == 3 else None
