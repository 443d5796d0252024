"""A proposal of configurations for a cell: feasible views at its places, the most telling of them, their σ."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.information import FrameInformation, Model, observability, scaled
from calib.uncertainty import printed_sigmas
from geometry import InputError, NoAnswerError, stack_poses
from workbench.expected import view_information
from workbench.formats import Cell, FrameRow
from workbench.optimal import RANDOM_PLANS, Choice, choose
from workbench.planning import Tally, ViewLimits, ViewProblem, Views, feasible_views, spread
from workbench.surroundings import jig_bodies, sees_all_strings

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]

POOL = 160  # feasible views gathered at each place
LEVER_MM = 300.0  # at which a rotation's error is weighed against a translation's: a sensor's usual stand-off
WEAK_MM = 5.0  # predicted σ beyond which the plan does not identify what is asked
VERIFY = "verify"


@dataclass(frozen=True, eq=False)
class Proposal:
    """Configurations with what they predict. sigma_deg, sigma_mm: of the six printed numbers, hand axes.

    ratio_to_random: size of the predicted error by the criterion over the median of random plans; ratio_of_noise: the
    same without the robot's own errors.
    """

    rows: tuple[FrameRow, ...]
    joints_deg: Array
    tilt_deg: Array
    roll_deg: Array
    sigma_deg: tuple[float, ...]
    sigma_mm: tuple[float, ...]
    ratio_to_random: float
    ratio_of_noise: float
    indices: dict[str, float]
    warnings: tuple[str, ...]

    def as_object(self) -> dict[str, Any]:
        """The proposal for JSON."""
        frames = [
            {"frame": r.frame, "location": r.location, "role": r.role, "joints_deg": q, "tilt_deg": t, "roll_deg": w}
            for r, q, t, w in zip(self.rows, self.joints_deg, self.tilt_deg, self.roll_deg, strict=True)
        ]
        return {
            "frames": frames,
            "sigma_rotation_deg": self.sigma_deg,
            "sigma_translation_mm": self.sigma_mm,
            "ratio_to_random": self.ratio_to_random,
            "ratio_of_noise_to_random": self.ratio_of_noise,
            "random_plans": RANDOM_PLANS,
            "observability": self.indices,
            "warnings": self.warnings,
        }


def propose(
    cell: Cell, per_location: int, criterion: str, model: Model, limits: ViewLimits, seed: int, progress: Progress
) -> Proposal:
    """Propose ``per_location`` configurations at every place of the cell."""
    if not cell.T_base_jig:
        raise InputError(
            f"{cell.folder / 'cell.toml'}: [locations.NAME] T_base_jig is missing: where does the jig stand?"
        )
    rng = np.random.default_rng([seed, 2**30])
    names = list(cell.T_base_jig)
    views = [_views_at(cell, name, per_location, limits, rng) for name in names]
    roles = [cell.roles.get(name, "calibrate") for name in names]
    info, joints, location, taken = _information(cell, names, views, model)
    wanted = {i: per_location for i, role in enumerate(roles) if role != VERIFY}
    if not wanted:
        raise InputError(f"{cell.folder / 'cell.toml'}: every location has role verify; one must calibrate")
    choice = choose(info, taken, wanted, criterion, LEVER_MM, rng, progress)
    chosen = sorted(choice.chosen.tolist(), key=lambda i: (location[i], i))
    for i, role in enumerate(roles):
        if role == VERIFY:
            mine = np.flatnonzero(location == i)
            mine = mine[~np.isin(mine, taken)]
            chosen += mine[spread(views[i].T_sensor_jig, cell.jig, per_location)].tolist()
    return _proposal(cell, names, roles, views, joints, location, chosen, choice, len(taken))


def _views_at(cell: Cell, name: str, count: int, limits: ViewLimits, rng: np.random.Generator) -> Views:
    sees_all = sees_all_strings(cell.sensor.model, cell.jig, jig_bodies(cell.jig))
    place = cell.T_base_jig[name]
    problem = ViewProblem(cell.robot, cell.sensor.model, cell.jig, place, cell.T_hand_sensor_design, limits, sees_all)
    tally = Tally()
    views = feasible_views(problem, max(POOL, 3 * count), rng, tally)
    if len(views.joints_rad) < count:
        raise NoAnswerError(
            f"location {name}: only {len(views.joints_rad)} of {count} views show all strings ({tally.text()}); "
            "move the jig or widen the limits"
        )
    return views


def _information(
    cell: Cell, names: list[str], views: list[Views], model: Model
) -> tuple[FrameInformation, Array, NDArray[np.intp], NDArray[np.intp]]:
    """Information of the frames taken already (they come first) and of all views, with their joints and places."""
    old = [(row.joints_rad, names.index(row.location)) for row in cell.frames if _counts(row, names)]
    joints = [q for q, _ in old if q is not None] + [q for v in views for q in v.joints_rad]
    location = [i for _, i in old] + [i for i, v in enumerate(views) for _ in v.joints_rad]
    place = np.array(location, dtype=np.intp)
    poses = stack_poses(list(cell.T_base_jig.values()))
    info = view_information(
        cell.robot, cell.sensor.model, cell.jig, cell.T_hand_sensor_design, poses, np.array(joints), place, model
    )
    return info, np.array(joints), place, np.arange(len(old), dtype=np.intp)


def _counts(row: FrameRow, names: list[str]) -> bool:
    return row.role != VERIFY and row.joints_rad is not None and row.location in names


def _proposal(
    cell: Cell,
    names: list[str],
    roles: list[str],
    views: list[Views],
    joints: Array,
    location: NDArray[np.intp],
    chosen: list[int],
    choice: Choice,
    taken: int,
) -> Proposal:
    poses = stack_poses([v.T_sensor_jig[i] for v in views for i in range(len(v.T_sensor_jig))])
    rotations = poses.R[np.array(chosen) - taken]
    first = max((row.frame for row in cell.frames), default=-1) + 1
    rows = tuple(
        FrameRow(first + k, f"images/{first + k:03d}.png", names[location[i]], roles[location[i]], joints[i])
        for k, i in enumerate(chosen)
    )
    sigma_deg, sigma_mm = printed_sigmas(cell.T_hand_sensor_design, choice.covariance)
    return Proposal(
        rows,
        np.rad2deg(joints[chosen]),
        np.rad2deg(np.arccos(np.clip(rotations[:, 2, 2], -1, 1))),
        np.rad2deg(np.arctan2(-rotations[:, 0, 1], rotations[:, 0, 0])),
        tuple(float(v) for v in sigma_deg),
        tuple(float(v) for v in sigma_mm),
        choice.ratio,
        choice.ratio_of_noise,
        observability(scaled(choice.covariance, LEVER_MM), taken + len(choice.chosen)),
        _warnings(choice.covariance),
    )


def _warnings(covariance: Array) -> tuple[str, ...]:
    values, vectors = np.linalg.eigh(scaled(covariance, LEVER_MM))
    if values[-1] <= WEAK_MM**2:
        return ()
    names = ("translation x", "translation y", "translation z", "rotation x", "rotation y", "rotation z")
    worst = " and ".join(names[i] for i in np.argsort(-np.abs(vectors[:, -1]))[:2])
    return (
        f"this plan does not identify the SCP: {worst} (sensor axes) stay unknown by {np.sqrt(values[-1]):.1f} mm; "
        "more tilts, rolls or locations are needed",
    )
