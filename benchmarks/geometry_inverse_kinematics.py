"""Inverse kinematics of every preset arm: share of reachable poses found, and solves a second beside scipy's.

Poses are taken on by random readings within the limits, so each can be reached. No seed is given to either solver;
scipy's least_squares starts from the middle of the limits and from random readings, 24 at most, as ours does.
Run: python benchmarks/geometry_inverse_kinematics.py
"""

from __future__ import annotations

from time import process_time

import numpy as np
from scipy.optimize import least_squares

import assets
from geometry import DhRobot, Pose, inverse_kinematics
from workbench.files import read_robot

GOALS, PEER_GOALS, STARTS = 1000, 5, 24
ATOL_MM = 1e-6


def by_scipy(robot: DhRobot, goal: Pose, rng: np.random.Generator) -> bool:
    """The bounded trust-region solver with our Jacobian-free error, restarted at random."""

    def error(q: np.ndarray) -> np.ndarray:
        return (robot.pose(q).inverse() @ goal).log() * [1, 1, 1, 500, 500, 500]

    start = (robot.min_rad + robot.max_rad) / 2
    for _ in range(STARTS):
        fit = least_squares(error, start, bounds=(robot.min_rad, robot.max_rad), xtol=1e-14, ftol=1e-14, gtol=1e-14)
        if np.linalg.norm(fit.fun) < ATOL_MM:
            return True
        start = rng.uniform(robot.min_rad, robot.max_rad)
    return False


def main() -> None:
    """Print a line per arm."""
    print(f"{'arm':22}{'found':>9}{'solves/s':>10}{'scipy found':>13}{'solves/s':>10}")
    for name in assets.list_presets("robots"):
        robot, rng = read_robot(assets.path("robots", name)).dh_part(), np.random.default_rng(1)
        goals = robot.pose(rng.uniform(robot.min_rad, robot.max_rad, (GOALS, robot.n_joints)))
        began = process_time()
        found = inverse_kinematics(robot, goals, rng, max_starts=STARTS)
        ours = GOALS / (process_time() - began)
        began = process_time()
        theirs = [by_scipy(robot, goals[i], rng) for i in range(PEER_GOALS)]
        rate = PEER_GOALS / (process_time() - began)
        print(f"{name:22}{found.converged.mean():9.4f}{ours:10.0f}{np.mean(theirs):13.2f}{rate:10.1f}")


if __name__ == "__main__":
    main()
