"""What stands around the strings of a jig: its plates and posts, and walls; and whether they hide a string."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Sensor, Target, cross_plane_x0
from jig_cad import Jig
from jig_cad.bodies import target_meshes
from jig_cad.jig import MIN_SLENDERNESS
from jig_cad.solids import jig_solids
from perceptron_emu import (
    ALUMINIUM,
    BLACK_PLATE,
    Solid,
    Surroundings,
    cylinders,
    hidden_by_solid,
    hidden_by_strings,
    panel,
)

Array = NDArray[np.float64]
Bodies = tuple[Solid, ...]
Mask = NDArray[np.bool_]
SeesAll = Callable[[Pose], Mask]  # which poses T_sensor_jig (N) show every string

REACH_MM = 0.6  # half the thickness of sheet that must reach every string: its Gaussian is spent well inside
SAMPLES = 7  # of that piece of every string: 0.2 mm apart
SHADOW_RADIUS_MM = 1.0  # strings stand wider in the way than they are: the sensor is not quite where it is believed
STEPS = np.linspace(-REACH_MM, REACH_MM, SAMPLES)


def jig_bodies(jig: Jig) -> tuple[Solid, ...]:
    """Plates or blocks (black) and posts (bare aluminium) of a jig, in its own axes.

    Jigs that share them get the same solids. The holes are twice as wide as the strings, up to the next tenth of a
    millimetre, as drills come.
    """
    exact = 2 * jig.string_diameter_mm
    drill = float(np.ceil(10 * exact - 1e-9) / 10)
    drill = drill if drill * MIN_SLENDERNESS < 2 * min(jig.side_mm, jig.height_mm) else exact
    return _bodies(_Shape(replace(jig, string_diameter_mm=drill / 2, tolerance_mm=0.0, name="")))


@dataclass(frozen=True, eq=False)
class _Shape:
    """A jig that is known by what its solids are made of."""

    jig: Jig

    def __hash__(self) -> int:
        return hash(self._key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Shape) and self._key == other._key

    @cached_property
    def _key(self) -> tuple[object, ...]:
        j = self.jig
        arrays = (j.anchors_mm, j.nominal_anchors_mm, j.start_index, j.end_index)
        return (j.anchors, j.strings, j.string_diameter_mm, *(a.tobytes() for a in arrays))


@lru_cache(maxsize=16)
def _bodies(shape: _Shape) -> Bodies:
    meshes = jig_solids(shape.jig, strings=False)
    return tuple(
        Solid(m, ALUMINIUM if name.startswith("post") else BLACK_PLATE, name=name) for name, m in meshes.items()
    )


def target_bodies(target: Target) -> tuple[Solid, ...]:
    """What is to be lit besides strings, in the target's axes: a jig's plates and posts, or the matte body itself."""
    if isinstance(target, Jig):
        return jig_bodies(target)
    return tuple(Solid(mesh, name=name) for name, mesh in target_meshes(target).items())


def wall_behind(jig: Jig, distance_mm: float, size_mm: float = 900.0, turn_deg: float = 0.0) -> Solid:
    """A matte wall beyond the pillar, ``distance_mm`` behind its back strings, turned about the vertical."""
    turn = np.deg2rad(turn_deg)
    c, s = np.cos(turn), np.sin(turn)
    R = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    centre = np.array([jig.height_mm / 2, 0.0, np.sqrt(3) / 2 * jig.side_mm + distance_mm])
    if jig.pillar is None:
        back = float(jig.nominal_anchors_mm[jig.used_anchors, 2].max())
        centre = jig.foot_mm * [1, 1, 0] + [jig.height_mm / 2, 0.0, back + distance_mm]
    return panel(size_mm, size_mm, Pose(R, centre), name="wall")


def around_jig(around: Surroundings, T_base_jig: Pose) -> tuple[Solid, ...]:
    """What stands around a jig at its place, in the jig's axes; without what the sensor carries along."""
    T_jig_base = T_base_jig.inverse()
    still = (replace(s, T_sensor_mesh=T_jig_base @ s.T_sensor_mesh) for s in around.standing_in("base"))
    return (*around.standing_in("jig"), *still)


def sees_all_strings(sensor: Sensor, jig: Jig, solids: tuple[Solid, ...], carried: tuple[Solid, ...] = ()) -> SeesAll:
    """A test that nothing stands between the strings' points and the emitter or the camera.

    Every string is tried on a piece REACH_MM to either side of the sheet, a little off its axis.

    Parameters
    ----------
    sensor, jig
        Which strings are seen by what.
    solids
        What stands around the strings, in {J}.
    carried
        What the sensor carries, in {P}.

    Returns
    -------
    SeesAll
        Of poses T_sensor_jig (N) tells which show every string (N,).

    """
    strings = replace(cylinders(jig, Pose.identity()), radius=SHADOW_RADIUS_MM)

    def sees_all(T_sensor_jig: Pose) -> Mask:
        points = _pieces(jig, T_sensor_jig)  # (N, S * SAMPLES, 3) in {P}
        own = np.tile(np.repeat(np.arange(len(jig.strings)), SAMPLES), len(points))
        back = T_sensor_jig.inverse()
        hidden = np.zeros(points.shape[:2], dtype=bool)
        for source in sensor.viewpoints_mm:
            towards = (source - points) / np.linalg.norm(source - points, axis=-1, keepdims=True)
            surface = points + jig.string_diameter_mm / 2 * towards
            here = (back @ surface).reshape(-1, 3)
            eye = np.repeat(back @ np.broadcast_to(source, (len(back), 3)), points.shape[1], axis=0)
            masks = [hidden_by_strings(strings, here, eye, own)]
            masks += [hidden_by_solid(s, here, eye) for s in solids]
            flat = surface.reshape(-1, 3)
            masks += [hidden_by_solid(s, flat, np.broadcast_to(source, flat.shape)) for s in carried]
            hidden |= np.any(masks, axis=0).reshape(hidden.shape)
        return np.asarray(~np.any(hidden, axis=1))

    return sees_all


def _pieces(jig: Jig, T_sensor_jig: Pose) -> Array:
    """Points (N, S * SAMPLES, 3) in {P} on every string's axis, up to REACH_MM to either side of the sheet."""
    starts = T_sensor_jig @ jig.starts[None]
    directions = (T_sensor_jig.R[:, None] @ jig.directions[..., None])[..., 0]
    crossing, _ = cross_plane_x0(starts, directions)
    along = directions / np.abs(directions[..., :1])  # a step of 1 mm across the sheet
    pieces = crossing[:, :, None] + STEPS[:, None] * along[:, :, None]
    return np.asarray(pieces.reshape(len(pieces), -1, 3))
