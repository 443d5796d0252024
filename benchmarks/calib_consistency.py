"""Is σ true? NEES and coverage of the SCP's covariance over synthetic cells with robot, joint, anchor and point errors.

Run: python benchmarks/calib_consistency.py [RUNS] [SEED]. A consistent estimator has mean NEES 6 (n = 6) and 95 % of
the truths inside its 95 % ellipsoid. Proves nothing about labels or images: points are given with their labels.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from scipy.stats import chi2

from calib import CalibConfig
from calib.bundle.solution import solve_problem
from calib.printed import nees
from calib.synthetic.cell import Noise, made_cell, observe, random_cell
from calib.synthetic.problem import CALIBRATE_ONLY, problem_of, true_candidates

RUNS_A_CELL = 50
MODELS = ("scp", "scp+offsets", "full")
GATE = float(chi2.isf(0.05, 6))


def run(runs: int, seed: int) -> dict[str, np.ndarray]:
    """NEES and χ² per degree of freedom (runs, 2) by model."""
    rng = np.random.default_rng(seed)
    noise, out = Noise(), {model: [] for model in MODELS}
    for i in range(runs):
        if i % RUNS_A_CELL == 0:
            cell = random_cell(rng, CALIBRATE_ONLY)
        made = made_cell(cell, rng, noise)
        problem = problem_of(observe(cell, made, rng, noise), cell)
        candidates = true_candidates(made)
        for model in MODELS:
            answer = solve_problem(problem, candidates, cell.design, CalibConfig(model=model))
            error = nees(made.T_hand_sensor, answer.T_hand_sensor, answer.covariance.of("scp"))
            out[model].append(
                (
                    error,
                    answer.chi2_per_dof,
                    np.any(answer.outlier) or np.any(answer.frame_outlier),
                    len(answer.noise) and answer.noise["point_sigma_factor"] != 1.0,
                )
            )
    return {model: np.array(rows, dtype=float) for model, rows in out.items()}


def main() -> None:
    """Print one line a model."""
    runs = int(sys.argv[1]) if len(sys.argv) > 1 else 2000
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    started = time.perf_counter()
    for model, rows in run(runs, seed).items():
        error = rows[:, 0]
        print(
            f"{model:12s} {runs} runs: mean NEES {error.mean():.3f} ± {np.sqrt(12 / runs):.3f} (reach 5.75 … 6.26), "
            f"95 % coverage {np.mean(error < GATE):.2%}, χ²/dof {rows[:, 1].mean():.2f}, "
            f"with outliers {rows[:, 2].mean():.1%}, noise re-estimated {rows[:, 3].mean():.1%}"
        )
    print(f"{time.perf_counter() - started:.0f} s")


if __name__ == "__main__":
    main()
