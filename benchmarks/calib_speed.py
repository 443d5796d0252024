"""How long a solve takes in memory: SCP, jig poses, joint noise; 21 and 1,000 frames; with covariance.

Run: python benchmarks/calib_speed.py. The median of several solves on one thread, from the design SCP.
"""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np

from calib.bundle import solve_bundle
from calib.linearise import initial_state
from calib.problem import Problem, robot_chain
from calib.synthetic import Noise
from calib.synthetic_problem import made_problem, true_jigs
from calib.uncertainty import uncertainty


def repeated(problem: Problem, times: int) -> Problem:
    """The same frames again and again: as many rows as a long recording has."""

    def again(x: np.ndarray) -> np.ndarray:
        return np.concatenate([x] * times)

    p, c = problem.points, problem.chain
    assert c.robot is not None
    assert c.joints_rad is not None
    points = replace(
        p, yz_mm=again(p.yz_mm), cov_mm2=again(p.cov_mm2), present=again(p.present), string=again(p.string)
    )
    chain = robot_chain(c.robot, again(c.joints_rad))
    return replace(problem, points=points, chain=chain, location=again(problem.location))


def median_ms(problem: Problem, start: object, estimated: np.ndarray, runs: int) -> float:
    """Median of ``runs`` solves with covariance [ms]."""
    spent = []
    for _ in range(runs):
        started = time.perf_counter()
        uncertainty(solve_bundle(problem, start, estimated))
        spent.append(time.perf_counter() - started)
    return 1e3 * float(np.median(spent))


def main() -> None:
    """Print the medians."""
    problem, cell, made = made_problem(1, Noise())
    start = initial_state(problem, cell.design, true_jigs(made))
    scp, full = np.zeros(24, dtype=bool), np.ones(24, dtype=bool)
    print(f"21 frames, scp:     {median_ms(problem, start, scp, 21):7.1f} ms (reach 10)")
    print(f"21 frames, full:    {median_ms(problem, start, full, 21):7.1f} ms")
    long = repeated(problem, 48)
    start = initial_state(long, cell.design, true_jigs(made))
    print(f"{long.n_frames} frames, scp:   {median_ms(long, start, scp, 5):7.1f} ms (reach 300)")


if __name__ == "__main__":
    main()
