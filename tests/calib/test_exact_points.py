"""The paper reproduced: exact points give back the exact SCP, by its own iteration and by the bundle."""

from __future__ import annotations

import numpy as np
import pytest

from calib.figures import agreeing_pose
from calib.paper.scp import PaperProblem, PaperSettings, solve_paper
from calib.synthetic.cell import DESIGN
from calib.synthetic.exact_recovery import recover
from calib.synthetic.problem import exact_pose_problem
from geometry import Pose
from jig_cad import Jig

ATOL_MM, ATOL_RAD = 1e-8, 1e-9
JIG = Jig.nominal()


def _check(seed: int, cells: int) -> None:
    rng = np.random.default_rng(seed)
    sound = [r for r in (recover(rng, JIG) for _ in range(cells)) if r.sound]
    assert len(sound) > 0.99 * cells  # views of 8 to 26° are hardly ever degenerate
    assert all(r.converged for r in sound)
    errors = np.abs(np.concatenate([[r.paper, r.bundle] for r in sound]))
    assert np.max(errors[:, :3]) < ATOL_MM
    assert np.max(errors[:, 3:]) < ATOL_RAD


def test_exact_points_give_the_exact_scp() -> None:
    _check(1, 200)


@pytest.mark.slow
def test_exact_points_give_the_exact_scp_in_10000_cells() -> None:
    _check(2, 10000)


def test_printed_sign_diverges() -> None:
    """With the printed plus the differences double each step; with minus they fall to rounding (docs/theory.md)."""
    problem, _, Ts_sensor_jig = exact_pose_problem(np.random.default_rng(3), JIG)
    paper = PaperProblem(Ts_sensor_jig.t, problem.hands, problem.location)
    printed = solve_paper(paper, DESIGN, PaperSettings(sign=1.0, damping=0.0, max_iterations=4)).history
    mended = solve_paper(paper, DESIGN).history
    np.testing.assert_allclose(printed[1:] / printed[:-1], 2.0, atol=0.1)
    assert mended[-1] < 1e-10


def test_agreeing_pose_takes_the_majority() -> None:
    """Frames with a mirror candidate agree on the true one."""
    rng = np.random.default_rng(4)
    truth = Pose.exp(rng.normal(size=6))
    frames = []
    for _ in range(5):
        wrong = truth @ Pose.exp(rng.normal(size=6) * np.array([40.0] * 3 + [0.5] * 3))
        noisy = truth @ Pose.exp(rng.normal(size=6) * 1e-3)
        both = [wrong, noisy] if rng.random() < 0.5 else [noisy, wrong]
        frames.append(Pose(np.stack([p.R for p in both]), np.stack([p.t for p in both])))
    pose, _ = agreeing_pose(frames)
    assert np.max(np.abs((truth.inverse() @ pose).log())) < 5e-3
