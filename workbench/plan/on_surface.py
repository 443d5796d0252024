"""A proposal of configurations for a cell of balls, plates, edges or wedges, as `propose` makes one for strings."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np

from calib.bundle import Model, observability, scaled
from calib.printed import printed_sigmas
from geometry import InputError
from workbench.files import Cell
from workbench.plan.choose import LEVER_MM, RANDOM_PLANS, size_mm
from workbench.plan.next_view import NextView, next_views, with_file
from workbench.plan.proposal import VERIFY, Proposal, plan_warnings
from workbench.plan.view_space import ViewLimits


def propose_on_surface(
    cell: Cell, per_location: int, criterion: str, model: Model, limits: ViewLimits, seed: int
) -> Proposal:
    """Propose ``per_location`` configurations at every place, and predict what those of calibrating places tell.

    Places that verify get the views that would tell most there by themselves: these are spread apart.
    cell: with T_base_jig of its places; its frames count as taken. criterion, model, limits, seed: as of `propose`;
    of the limits tilt and roll count.
    """
    if not cell.T_base_jig:
        raise InputError(
            f"{cell.folder / 'cell.toml'}: [locations.NAME] T_base_target is missing: where does the target stand?"
        )
    told = {f.location: f.role for f in cell.frames} | dict(cell.roles)
    places = {n: T for n, T in cell.T_base_jig.items() if told.get(n, "calibrate") != VERIFY}
    if not places:
        raise InputError(f"{cell.folder / 'cell.toml'}: every location has role verify; one must calibrate")
    arm = cell.arm
    taken = [f for f in cell.frames if f.location in places and f.reason is None]
    asked = partial(
        next_views,
        cell,
        cell.design,
        count=per_location,
        criterion=criterion,
        model=model,
        tilt_deg=limits.tilt_deg,
        roll_deg=limits.roll_deg,
        seed=seed,
        each=True,
    )
    plan = asked(places, taken, compared=RANDOM_PLANS)
    checked = {n: T for n, T in cell.T_base_jig.items() if n not in places}
    looked = [f for f in cell.frames if f.location in checked and f.reason is None]  # where from; none counts as taken
    checking = asked(checked, looked).views if checked else ()
    views = [*plan.views, *(_to_verify(cell, v, len(plan.views)) for v in checking)]
    views = sorted(views, key=lambda v: list(cell.T_base_jig).index(v.frame.location))
    rows = tuple(v.frame for v in views)
    ratio, of_noise = (
        float(size_mm(own, criterion) / np.median(size_mm(others, criterion)))
        for own, others in ((plan.after, plan.random), (plan.noise, plan.random_noise))
    )
    sigma_deg, sigma_mm = printed_sigmas(cell.design, plan.after)
    return Proposal(
        rows,
        np.rad2deg([r.joints_rad for r in rows if r.joints_rad is not None]).reshape(-1, arm.n_joints),
        np.array([v.tilt_deg for v in views]),
        np.array([v.roll_deg for v in views]),
        tuple(float(v) for v in sigma_deg),
        tuple(float(v) for v in sigma_mm),
        ratio,
        of_noise,
        observability(scaled(plan.noise, LEVER_MM), plan.frames),
        plan_warnings(plan.after),
        np.array([v.room_mm for v in views]),
        (),
    )


def _to_verify(cell: Cell, view: NextView, before: int) -> NextView:
    """A view of a place that verifies, numbered after those ``before``."""
    row = replace(view.frame, number=view.frame.number + before, role="verify")
    return replace(view, frame=with_file(cell, row))
