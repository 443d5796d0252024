"""Chosen views made better one by one: each is moved a little within its bounds as long as the plan tells more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle import FrameInformation, covariances_with, scp_covariance
from geometry import Pose, log_so3
from geometry.ties import ascending
from workbench.plan.choose import DISTINCT_MM, LEVER_MM, size_mm
from workbench.plan.view_space import ViewSpace
from workbench.plan.views import ViewProblem, Views, near_views, unhidden

Array = NDArray[np.float64]
Index = NDArray[np.intp]

ROUNDS = 12  # the last moves are a thirtieth of the first: see benchmarks/plan_against_random.py
TRIES = 40  # moves tried for each view in a round
FIRST_STEP, SHRINK = 0.25, 0.75  # of the bounds' widths, as a σ; smaller in every round
MOVED_SHARE = 0.6  # of a view's six parameters that a move changes
LOOKS = 5  # how many of the best moves are looked at for occlusion
GAIN = 1e-6  # a smaller relative gain is rounding


@dataclass(frozen=True, eq=False)
class Planned:
    """A plan as it stands: views (N), the place of each, what they tell."""

    views: Views
    location: Index
    info: FrameInformation


@dataclass(frozen=True, eq=False)
class Refinement:
    """What refining needs: the places' problems and space, frames already taken, and how views become information."""

    problems: dict[int, ViewProblem]
    space: ViewSpace
    taken: FrameInformation
    inform: Callable[[Array, Index], FrameInformation]
    criterion: str


def refine(
    plan: Planned, how: Refinement, rng: np.random.Generator, progress: Callable[[int, int], None] | None = None
) -> Planned:
    """The plan after ROUNDS of moves; its size by the criterion never grows."""
    for turn in range(ROUNDS):
        moved, slot = _moves(plan, how, FIRST_STEP * SHRINK**turn, rng)
        if len(slot):
            told = how.inform(moved.joints_rad, plan.location[slot])
            for k in range(len(plan.location)):
                plan = _better(plan, how, k, moved, told, np.flatnonzero(slot == k))
        if progress:
            progress(turn + 1, ROUNDS)
    return plan


def _moves(plan: Planned, how: Refinement, step: float, rng: np.random.Generator) -> tuple[Views, Index]:
    """Moved views that can be measured and reached, and the view (N,) that each was moved from."""
    views, slots = plan.views[np.zeros(0, dtype=np.intp)], []
    width = how.space.high - how.space.low
    for place, problem in how.problems.items():
        mine = np.repeat(np.flatnonzero(plan.location == place), TRIES)
        change = rng.normal(size=(len(mine), 6)) * (rng.random((len(mine), 6)) < MOVED_SHARE)
        parameters = how.space.bounded(plan.views.parameters[mine] + change * step * width / 2)
        found, kept = near_views(problem, how.space, parameters, plan.views.joints_rad[mine])
        views = views.followed_by(found)
        slots.append(mine[kept])
    return views, np.concatenate(slots).astype(np.intp)


def _better(plan: Planned, how: Refinement, k: int, moved: Views, told: FrameInformation, candidates: Index) -> Planned:
    """The plan with view k replaced by the best of its moves that nothing hides, where that tells more."""
    candidates = candidates[_distinct(plan, k, moved.T_sensor_jig[candidates])]
    if len(candidates) == 0:
        return plan
    taken, n = len(how.taken.location), len(plan.location)
    others = np.delete(np.arange(taken + n), taken + k)
    everything = how.taken.followed_by(plan.info).followed_by(told[candidates])
    now = size_mm(scp_covariance(everything, np.arange(taken + n)), how.criterion)
    covariances = covariances_with(everything, others, taken + n + np.arange(len(candidates)))
    sizes = size_mm(covariances, how.criterion)
    for j in ascending(np.log(sizes), GAIN)[:LOOKS]:
        if sizes[j] >= now * (1 - GAIN):
            break
        i = candidates[j : j + 1]
        if unhidden(how.problems[int(plan.location[k])], how.space, moved.T_sensor_jig[i])[0]:
            return _replaced(plan, k, moved[i], told[i])
    return plan


def _replaced(plan: Planned, k: int, view: Views, told: FrameInformation) -> Planned:
    order = np.arange(len(plan.location), dtype=np.intp)
    order[k] = len(order)  # the new one stands behind the others
    views, info = plan.views.followed_by(view)[order], plan.info.followed_by(told)[order]
    return replace(plan, views=views, info=info)


def _distinct(plan: Planned, k: int, T_sensor_jig: Pose) -> NDArray[np.bool_]:
    """Which poses (N) differ enough from the other views of view k's place."""
    same = np.flatnonzero(plan.location == plan.location[k])
    out = np.ones(len(T_sensor_jig), dtype=bool)
    for i in same[same != k]:
        off = T_sensor_jig @ plan.views.T_sensor_jig[i].inverse()
        turn = np.linalg.norm(log_so3(off.R), axis=-1)
        shift = np.linalg.norm((T_sensor_jig.inverse()).t - plan.views.T_sensor_jig[i].inverse().t, axis=-1)
        out &= np.hypot(LEVER_MM * turn, shift) > DISTINCT_MM
    return out
