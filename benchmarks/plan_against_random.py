"""Planned views against random ones from the same feasible set and bounds: σ of the SCP predicted and achieved.

Run: python benchmarks/plan_against_random.py [CELL.toml|PRESET ...] [--draws N] [--criteria DE] [--models scp,full].
A preset is an arm's: its starter cell is taken; of a recorded cell robot, jig and places, none of its frames. Each plan
has 7 views at each of three places. Achieved: calibrations of synthetic points whose robot, joints, anchors, mounting
and points err as they are believed to, solved by the bundle from the nominal table; the size is that of the errors'
second moments. Proves nothing about images.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from calib import CalibConfig
from calib.bundle.hands import Hands
from calib.bundle.information import scp_covariance
from calib.bundle.problem import Bundle
from calib.bundle.solution import solve_problem
from calib.synthetic.cell import axis_points
from geometry import Pose, draw_errors, stack_poses
from jig_cad import sample_tolerance
from workbench.cell import located, write_starter
from workbench.files import Cell, read_cell
from workbench.plan import (
    LEVER_MM,
    RANDOM_PLANS,
    ViewPools,
    best_plan,
    candidates,
    expected_points,
    plan_limits,
    pooled,
    random_plans,
    size_mm,
)

PER_LOCATION = 7
BLOCKS = 10  # of as many draws as each random plan gets, for the planned views
MOUNTING_SIGMA = np.array([1.0] * 3 + [np.deg2rad(0.5)] * 3)


def calibrated_error(
    cell: Cell, places: Pose, joints: np.ndarray, location: np.ndarray, model: str, rng: np.random.Generator
) -> np.ndarray:
    """The error ξ (6,) [mm, rad] of one calibration with everything drawn anew."""
    true_scp = cell.T_hand_sensor_design @ Pose.exp(rng.normal(size=6) * MOUNTING_SIGMA)
    robot, jig = cell.robot.corrected(draw_errors(cell.robot, rng)), sample_tolerance(cell.jig, rng)
    moved = joints + rng.normal(size=joints.shape) * cell.robot.uncertainty.joint_sigma_rad
    T_sensor_jig = (robot.pose(moved) @ true_scp).inverse() @ places[location]
    expected = expected_points(cell.sensor, cell.jig, T_sensor_jig)
    truth = axis_points(T_sensor_jig, jig)
    axes = [
        replace(a, yz_mm=yz + (np.linalg.cholesky(a.cov_yz_mm2) @ rng.normal(size=(len(a), 2, 1)))[..., 0])
        for a, yz in zip(expected, truth, strict=True)
    ]
    names = [str(k) for k in range(len(places))]
    problem = Bundle.of(axes, [names[k] for k in location], cell.jig, Hands(cell.robot, joints), names)
    own = [T_sensor_jig[i : i + 1] for i in range(len(joints))]
    answer = solve_problem(problem, own, cell.T_hand_sensor_design, CalibConfig(model=model))
    return (answer.T_hand_sensor.inverse() @ true_scp).log()


def second_moment(cell: Cell, found: ViewPools, q: np.ndarray, place: np.ndarray, model: str, n: int, seed: int):
    """Second moments (6, 6) of the errors of n calibrations."""
    rng = np.random.default_rng(seed)
    index = np.searchsorted(found.calibrating, place)
    places = stack_poses([found.problems[i].T_base_jig for i in found.calibrating])
    errors = np.array([calibrated_error(cell, places, q, index, model, rng) for _ in range(n)])
    return errors.T @ errors / n


def run(name: str, cell: Cell, model: str, criteria: str, draws: int) -> None:
    """Print a line a criterion."""
    rng = np.random.default_rng(11)
    found = candidates(cell, PER_LOCATION, model, plan_limits(), rng, lambda *_: None)
    views, location, info = pooled(found)
    wanted = dict.fromkeys(found.calibrating, PER_LOCATION)
    random = random_plans(info, np.zeros(0, dtype=np.intp), wanted, rng, RANDOM_PLANS)
    predicted = np.array([scp_covariance(info, p) for p in random])
    noise = np.array([scp_covariance(info, p, noise_alone=True) for p in random])
    achieved = None
    if draws:
        achieved = np.array(
            [
                second_moment(cell, found, views.joints_rad[p], location[p], model, draws, k)
                for k, p in enumerate(random)
            ]
        )
    for criterion in criteria:
        started = time.process_time()
        plan = best_plan(found, PER_LOCATION, criterion, rng)
        spent = time.process_time() - started
        every = np.arange(len(plan.location))
        own, own_noise = (scp_covariance(plan.info, every, noise_alone=n) for n in (False, True))
        parts = [("predicted", own[None], predicted), ("noise alone", own_noise[None], noise)]
        if achieved is not None:
            joints = plan.views.joints_rad
            blocks = [second_moment(cell, found, joints, plan.location, model, draws, 1000 + k) for k in range(BLOCKS)]
            parts.append(("achieved", np.array(blocks), achieved))
        words = ", ".join(f"{what} {_ratios(mine, others)}" for what, mine, others in parts)
        print(f"{name:16s} {model:5s} {criterion}-optimal: {words}; {spent:.1f} CPU-s", flush=True)


def _ratios(mine: np.ndarray, others: np.ndarray) -> str:
    sizes = ((c, np.median(size_mm(mine, c)), np.median(size_mm(others, c))) for c in "DEA")
    return " ".join(f"{c} {a / b:.2f}" for c, a, b in sizes)


def _name(what: str) -> str:
    return Path(what).parent.name if what.endswith(".toml") else what


def _cell(what: str) -> Cell:
    if what.endswith(".toml"):
        recorded = located(read_cell(Path(what), recorded=False))
        roles = {row.location: row.role for row in recorded.frames}
        return replace(recorded, frames=(), roles={**roles, **recorded.roles})
    folder = Path(tempfile.mkdtemp()) / "cell"
    write_starter(folder, what, "nominal", "paper")
    return read_cell(folder, recorded=False)


def main() -> None:
    """Print the ratios to the median of random plans: D mean axis, E longest axis, A rms error, at the lever."""
    parser = argparse.ArgumentParser()
    parser.add_argument("cells", nargs="*", default=["abb_irb6640_180_255", "kuka_kr210_l150"])
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--criteria", default="DE")
    parser.add_argument("--models", default="scp,full")
    given = parser.parse_args()
    print(f"ratios to the median of {RANDOM_PLANS} random plans; rotations at {LEVER_MM:.0f} mm")
    for what in given.cells:
        for model in given.models.split(","):
            run(_name(what), _cell(what), model, given.criteria, given.draws)


if __name__ == "__main__":
    main()
