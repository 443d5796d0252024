"""A proposal of configurations for a cell: feasible views at its places, the most telling of them, their σ."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.bundle import FrameInformation, Model, observability, scaled, scp_covariance
from calib.mount import chain_of
from calib.printed import printed_sigmas
from geometry import Frame, InputError, NoAnswerError, Role, stack_poses
from geometry.ties import ascending
from workbench.cell import jig_bodies, sees_all_strings
from workbench.files import Cell
from workbench.plan.choose import LEVER_MM, RANDOM_PLANS, choose, random_plans, size_mm
from workbench.plan.clearance import target_in_workspace
from workbench.plan.expected import view_information
from workbench.plan.moves import Move, straight_moves
from workbench.plan.next_view import with_file
from workbench.plan.refine import ROUNDS, Planned, Refinement, refine
from workbench.plan.view_space import Tally, ViewLimits, ViewSpace
from workbench.plan.views import ViewProblem, Views, feasible_views, spread
from workbench.plan.whole import seen_whole

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Progress = Callable[[int, int], None]

POOL = 160  # feasible views gathered at each place: refining finds the rest (benchmarks/plan_against_random.py)
BATCH = 1000  # views drawn at a time
SAME_PART = 1e-6  # of a direction's unit vector: equal parts by number
WEAK_MM = 5.0  # predicted σ beyond which the plan does not identify what is asked
VERIFY = "verify"


@dataclass(frozen=True, eq=False)
class ViewPools:
    """Where a plan may be taken from: the cell's places, feasible views at each, the frames that there are already.

    taken: what the frames already there tell. inform: what readings (F, n) at places (F,) tell.
    """

    names: list[str]
    roles: list[Role]
    problems: dict[int, ViewProblem]
    space: ViewSpace
    views: list[Views]
    taken: FrameInformation
    inform: Callable[[Array, Index], FrameInformation]

    @property
    def calibrating(self) -> list[int]:
        """The places that are solved with."""
        return [i for i, role in enumerate(self.roles) if role != VERIFY]


@dataclass(frozen=True, eq=False)
class Proposal:
    """Configurations with what they predict. sigma_deg, sigma_mm: of the six printed numbers, hand axes.

    ratio_to_random: size of the predicted error by the criterion over the median of random plans; ratio_of_noise: the
    same without the robot's own errors. room_mm: what each configuration leaves beside everything, over the safety
    distance. moves: from one frame of a location to the next.
    """

    rows: tuple[Frame, ...]
    joints_deg: Array
    tilt_deg: Array
    roll_deg: Array
    sigma_deg: tuple[float, ...]
    sigma_mm: tuple[float, ...]
    ratio_to_random: float
    ratio_of_noise: float
    indices: dict[str, float]
    warnings: tuple[str, ...]
    room_mm: Array
    moves: tuple[Move, ...]

    def as_object(self) -> dict[str, Any]:
        """The proposal for JSON."""
        frames = [
            {"frame": r.number, "location": r.location, "role": r.role, "joints_deg": q, "tilt_deg": t, "roll_deg": w}
            | {"room_mm": room}
            for r, q, t, w, room in zip(
                self.rows, self.joints_deg, self.tilt_deg, self.roll_deg, self.room_mm, strict=True
            )
        ]
        return {
            "frames": frames,
            "sigma_rotation_deg": self.sigma_deg,
            "sigma_translation_mm": self.sigma_mm,
            "ratio_to_random": self.ratio_to_random,
            "ratio_of_noise_to_random": self.ratio_of_noise,
            "random_plans": RANDOM_PLANS,
            "observability": self.indices,
            "moves": [
                {"location": m.location, "from": m.start, "to": m.end, "room_mm": m.room_mm, "near": m.near}
                for m in self.moves
            ],
            "warnings": self.warnings,
        }


def plan_limits(tilt_deg: float = 45.0, roll_deg: float = 180.0, mounting_deg: float = 3.0) -> ViewLimits:
    """Bounds of a plan: all of the pillar and of the field of view in which every string can be measured."""
    return ViewLimits(
        tilt_deg,
        roll_deg,
        height=(0.1, 0.9),
        sideways=0.4,
        nearest_wide=1.0,
        deepest=np.inf,
        mounting_deg=mounting_deg,
    )


def propose(
    cell: Cell, per_location: int, criterion: str, model: Model, limits: ViewLimits, seed: int, progress: Progress
) -> Proposal:
    """Propose ``per_location`` configurations at every place of the cell, and predict what they tell.

    Parameters
    ----------
    cell
        With T_base_jig of its places; its frames count as taken.
    per_location
        How many are wanted at each place; places that verify get spread views.
    criterion
        What the plan makes small: "D" the error ellipsoid's volume, "E" its longest axis, "A" the rms error.
    model
        What calibration will estimate.
    limits
        Which views are allowed.
    seed
        The same seed gives the same plan.
    progress
        Told the steps done and the steps in all.

    Returns
    -------
    Proposal
        Rows of a frames.csv with the predicted σ of the SCP.

    Raises
    ------
    InputError, NoAnswerError
        Where no place is known, or a place gives too few views.

    """
    rng = np.random.default_rng([seed, 2**30])
    total = len(cell.T_base_jig) + 1 + ROUNDS
    found = candidates(cell, per_location, model, limits, rng, lambda done, _: progress(done, total))
    plan = best_plan(found, per_location, criterion, rng, lambda done, _: progress(total - ROUNDS + done, total))
    verify = [i for i, role in enumerate(found.roles) if role == VERIFY]
    views, location = plan.views, plan.location
    for i in verify:
        mine = found.views[i]
        views = views.followed_by(mine[spread(mine.T_sensor_jig, cell.jig, per_location)])
        location = np.concatenate([location, np.full(per_location, i)])
    order = np.argsort(location, kind="stable")
    random = _random(found, per_location, rng)
    return _proposal(cell, found, Planned(views[order], location[order], plan.info), criterion, random)


def candidates(
    cell: Cell,
    per_location: int,
    model: Model,
    limits: ViewLimits,
    rng: np.random.Generator,
    progress: Progress,
    pool: int | None = None,
) -> ViewPools:
    """Feasible views at every place of the cell, uniform within the limits, ``pool`` (POOL) at each."""
    file = cell.folder / "cell.toml"
    if not cell.T_base_jig:
        raise InputError(f"{file}: [locations.NAME] T_base_jig is missing: where does the jig stand?")
    names = list(cell.T_base_jig)
    roles = [_role(cell, name) for name in names]
    if all(role == VERIFY for role in roles):
        raise InputError(f"{file}: every location has role verify; one must calibrate")
    sensor, design = cell.sensor, cell.design
    _check_places(cell)
    whole = seen_whole(sensor, cell.jig, limits)
    if not whole.fits:
        raise NoAnswerError(f"{file}: {whole.sentence(sensor, cell.jig)}")
    space = ViewSpace.of(sensor, cell.jig, limits)
    sees_all = sees_all_strings(sensor, cell.jig, jig_bodies(cell.jig))
    problems = {
        i: ViewProblem(
            cell.arm, sensor, cell.jig, cell.T_base_jig[name], design, limits, sees_all, cell.workspace, cell.mount
        )
        for i, name in enumerate(names)
    }
    views = []
    for i, name in enumerate(names):
        views.append(_views_at(problems[i], space, name, per_location, max(pool or POOL, 3 * per_location), rng))
        progress(i + 1, len(names))
    places = stack_poses(list(cell.T_base_jig.values()))

    def inform(joints_rad: Array, location: Index) -> FrameInformation:
        return view_information(
            chain_of(cell.mount, cell.arm), sensor, cell.jig, design, places, joints_rad, location, model
        )

    old = [(q, names.index(r.location)) for r in cell.frames if (q := _counting(r, names)) is not None]
    joints = np.array([q for q, _ in old]).reshape(-1, cell.arm.n_joints)
    taken = inform(joints, np.array([i for _, i in old], dtype=np.intp))
    return ViewPools(names, roles, problems, space, views, taken, inform)


def _check_places(cell: Cell) -> None:
    """InputError where a jig stands in the floor or in a box: then no arm is to be asked."""
    for name, place in cell.T_base_jig.items() if cell.mount == "hand" else ():
        into = target_in_workspace(cell.jig, place, cell.workspace)
        if into:
            raise InputError(f"{cell.folder / 'cell.toml'}: [locations.{name}] T_base_jig puts the jig {into}")


def best_plan(
    found: ViewPools, per_location: int, criterion: str, rng: np.random.Generator, progress: Progress | None = None
) -> Planned:
    """The most telling views: chosen from the pools, then moved within the bounds while that makes the plan better."""
    views, location, info = pooled(found)
    everything = found.taken.followed_by(info)
    n = len(found.taken.location)
    wanted = dict.fromkeys(found.calibrating, per_location)
    chosen = choose(everything, np.arange(n), wanted, criterion) - n
    plan = Planned(views[chosen], location[chosen], info[chosen])
    problems = {i: found.problems[i] for i in found.calibrating}
    return refine(plan, Refinement(problems, found.space, found.taken, found.inform, criterion), rng, progress)


def pooled(found: ViewPools) -> tuple[Views, Index, FrameInformation]:
    """All calibrating places' views together, the place of each, and what each tells."""
    views = [found.views[i] for i in found.calibrating]
    joined = views[0]
    for more in views[1:]:
        joined = joined.followed_by(more)
    location = np.repeat(found.calibrating, [len(v.joints_rad) for v in views]).astype(np.intp)
    return joined, location, found.inform(joined.joints_rad, location)


def _random(found: ViewPools, per_location: int, rng: np.random.Generator) -> tuple[Array, Array]:
    """Covariances (RANDOM_PLANS, 6, 6) that random plans from the pools predict, with and without robot errors."""
    everything = found.taken.followed_by(pooled(found)[2])
    wanted = dict.fromkeys(found.calibrating, per_location)
    plans = random_plans(everything, np.arange(len(found.taken.location)), wanted, rng, RANDOM_PLANS)
    with_robot, noise = ([scp_covariance(everything, p, noise_alone=n) for p in plans] for n in (False, True))
    return np.array(with_robot), np.array(noise)


def _role(cell: Cell, name: str) -> Role:
    told = [row.role for row in cell.frames if row.location == name]
    return cell.roles.get(name, told[0] if told else "calibrate")


def _views_at(
    problem: ViewProblem, space: ViewSpace, name: str, count: int, pool: int, rng: np.random.Generator
) -> Views:
    tally = Tally()
    views = feasible_views(problem, pool, rng, tally, BATCH, space)
    if len(views.joints_rad) < count:
        raise NoAnswerError(
            f"location {name}: only {len(views.joints_rad)} of {count} views show all strings ({tally.text()}); "
            "move the jig or widen the limits"
        )
    return views


def _counting(row: Frame, names: list[str]) -> Array | None:
    """The readings of a frame that is solved with, or None."""
    return row.joints_rad if row.role != VERIFY and row.location in names else None


def _proposal(cell: Cell, found: ViewPools, plan: Planned, criterion: str, random: tuple[Array, Array]) -> Proposal:
    everything = found.taken.followed_by(plan.info)
    frames = np.arange(len(everything.location))
    covariance, noise = (scp_covariance(everything, frames, noise_alone=n) for n in (False, True))
    ratio, of_noise = (
        float(size_mm(own, criterion) / np.median(size_mm(others, criterion)))
        for own, others in ((covariance, random[0]), (noise, random[1]))
    )
    first = max((row.number for row in cell.frames), default=-1) + 1
    rows = tuple(
        with_file(cell, Frame(n, found.names[i], found.roles[i], plan.views.joints_rad[k]))
        for k, (n, i) in enumerate(zip(count(first), plan.location, strict=False))
    )
    moves = _moves(found, plan, rows)
    rotations = plan.views.T_sensor_jig.R
    sigma_deg, sigma_mm = printed_sigmas(cell.design, covariance)
    return Proposal(
        rows,
        np.rad2deg(plan.views.joints_rad),
        np.rad2deg(np.arccos(np.clip(rotations[:, 2, 2], -1, 1))),
        np.rad2deg(np.arctan2(-rotations[:, 0, 1], rotations[:, 0, 0])),
        tuple(float(v) for v in sigma_deg),
        tuple(float(v) for v in sigma_mm),
        ratio,
        of_noise,
        observability(scaled(noise, LEVER_MM), len(frames)),
        (*plan_warnings(covariance), *(m.sentence() for m in moves if m.room_mm < 0)),
        _rooms(found, plan),
        moves,
    )


def _rooms(found: ViewPools, plan: Planned) -> Array:
    rooms = np.zeros(len(plan.location))
    for i, problem in found.problems.items():
        mine = np.flatnonzero(plan.location == i)
        rooms[mine] = problem.room_mm(plan.views.joints_rad[mine]).least
    return rooms


def _moves(found: ViewPools, plan: Planned, rows: tuple[Frame, ...]) -> tuple[Move, ...]:
    moves: list[Move] = []
    for i, problem in found.problems.items():
        mine = np.flatnonzero(plan.location == i)
        numbers = [rows[k].number for k in mine]
        moves += straight_moves(problem, found.names[i], numbers, plan.views.joints_rad[mine])
    return tuple(moves)


def plan_warnings(covariance: Array) -> tuple[str, ...]:
    """A sentence where a plan of this covariance (6, 6) leaves something of the SCP open."""
    values, vectors = np.linalg.eigh(scaled(covariance, LEVER_MM))
    if values[-1] <= WEAK_MM**2:
        return ()
    names = ("translation x", "translation y", "translation z", "rotation x", "rotation y", "rotation z")
    worst = " and ".join(names[i] for i in ascending(-np.abs(vectors[:, -1]), SAME_PART)[:2])
    return (
        f"this plan does not identify the SCP: {worst} (sensor axes) stay unknown by {np.sqrt(values[-1]):.1f} mm; "
        "more tilts, rolls or locations are needed",
    )
