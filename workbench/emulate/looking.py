"""Views of a ball, plate, edge or wedge that an arm reaches: from its z side, tilted, rolled and shifted at random."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Pose, Role, Surface, exp_so3, field_of_view, inverse_kinematics, target_at
from jig_cad import Sphere
from workbench.files import Cell
from workbench.plan import carrying, room_at_target_mm, room_before_fixed, room_in_workspace_mm, standing

Array = NDArray[np.float64]

TILT_DEG = 30.0
ROLL_DEG = 80.0
ROLL_ACROSS_DEG = 55.0  # where the sheet must cross a ridge or border
BESIDE_RADIUS = 0.7  # a ball is cut up to so far beside its middle, in radii
SHARE_OF_FIELD = 0.25  # by which the target's middle moves about the field's
TRIES = 12  # candidates a view


def surface_views(cell: Cell, per_location: int, rng: np.random.Generator) -> list[tuple[str, Role, Array]]:
    """Views (location, role, joints) at every location, by the SCP of the design and the nominal arm.

    InputError where a place can not be reached often enough.
    """
    views: list[tuple[str, Role, Array]] = []
    for name, place in cell.T_base_jig.items():
        target = target_at(cell.target, name)
        if not isinstance(target, Surface):
            raise InputError(f"[locations.{name}]: strings and surfaces can not be rendered in one recording")
        looks = _looks(cell, target, TRIES * per_location, rng)
        goals = place @ looks @ cell.design.inverse()
        if cell.mount == "fixed":
            goals = goals.inverse()  # T_base_hand = T_base_sensor · T_sensor_target · T_hand_target⁻¹
        found = inverse_kinematics(cell.arm, goals, rng, max_starts=6)
        room = room_mm(cell, found.joints, target, place)
        good = found.converged & cell.arm.within_limits(found.joints) & (room > 0)
        reached = list(found.joints[good])
        if len(reached) < per_location:
            raise InputError(
                f"[locations.{name}]: the arm reaches {len(reached)} of {len(looks)} views of the target there without "
                f"touching it, the floor or a box, {per_location} are asked for: put it nearer, or ask for fewer with "
                "--per-location"
            )
        views += [(name, cell.roles.get(name, "calibrate"), q) for q in reached[:per_location]]
    return views


def room_mm(cell: Cell, joints_rad: Array, target: Surface, place: Pose) -> Array:
    """What room (N) [mm] is left beside target, floor and boxes at the readings (N, n)."""
    radius = cell.workspace.link_radius_mm
    if cell.mount == "fixed":
        arm = carrying(cell.arm, joints_rad, place, target, radius)
        return room_before_fixed(arm, cell.design, cell.sensor, cell.workspace).least
    arm = standing(cell.arm, joints_rad, cell.design, cell.sensor, radius)
    return np.minimum(room_at_target_mm(arm, target, place), room_in_workspace_mm(arm, cell.workspace)[0])


def _looks(cell: Cell, target: Surface, count: int, rng: np.random.Generator) -> Pose:
    """T_target_sensor (count)."""
    roll = np.deg2rad(ROLL_ACROSS_DEG if target.runs_along_x else ROLL_DEG)
    tilt = np.deg2rad(rng.uniform(-TILT_DEG, TILT_DEG, (count, 2)))
    profile = cell.sensor.profile
    against = profile is None or not profile.z_towards_sensor
    facing = np.diag([1.0, -1.0, -1.0]) if against else np.eye(3)
    turn = exp_so3(np.column_stack([tilt, np.zeros(count)]))
    spun = exp_so3(np.column_stack([np.zeros((count, 2)), rng.uniform(-roll, roll, count)]))
    field = field_of_view(cell.sensor)
    low, high = field.min(axis=0), field.max(axis=0)
    middle = (low + high) / 2 + SHARE_OF_FIELD * (high - low) * rng.uniform(-0.5, 0.5, (count, 2))
    half = target.diameter_mm / 2 if isinstance(target, Sphere) else 15.0
    beside = rng.uniform(-BESIDE_RADIUS, BESIDE_RADIUS, count) * half
    there = np.column_stack([beside, middle])  # the target's origin in {P}
    R = turn @ facing @ spun
    return Pose(R, -(R @ there[..., None])[..., 0])
