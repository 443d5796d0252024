"""The paper reproduced: exact points give back the exact SCP, by its own iteration and by the bundle."""

from __future__ import annotations

import numpy as np
import pytest

from calib.closed_form import closed_forms
from calib.figures import agreeing_pose
from calib.paper_scp import PaperProblem, PaperSettings, differences, scaled_condition, solve_paper
from calib.robust import solve_robust
from calib.starts import chain_start
from calib.synthetic import DESIGN
from calib.synthetic_problem import exact_pose_problem
from calib.uncertainty import uncertainty
from geometry import Pose
from jig_cad import Jig

ATOL_MM, ATOL_RAD = 1e-8, 1e-9
MAX_CONDITION = 1e3
JIG = Jig.nominal()


def _recover(rng: np.random.Generator) -> tuple[bool, np.ndarray, np.ndarray]:
    """Whether a random cell is non-degenerate, and the errors (6,) of the paper's and of the bundle's SCP."""
    problem, truth, Ts_sensor_jig = exact_pose_problem(rng, JIG)
    forms = closed_forms(problem.points.yz_mm, JIG.side_mm, JIG.height_mm)
    candidates = []
    for i in range(problem.n_frames):
        exact = forms.h1_disagreement_mm[i] < 1e-6
        candidates.append(forms.T_sensor_jig[i][np.flatnonzero(exact)])
    start, own = chain_start(problem, DESIGN, candidates)
    paper = PaperProblem(own.t, problem.chain.T_base_hand, problem.location)
    at_truth, _ = differences(
        PaperProblem(Ts_sensor_jig.t, problem.chain.T_base_hand, problem.location), truth, np.zeros(0)
    )
    first = solve_paper(paper, DESIGN)
    second = solve_robust(problem, start, np.zeros(0, dtype=bool)).bundle
    fine = scaled_condition(at_truth) < MAX_CONDITION and uncertainty(second).condition < MAX_CONDITION
    errors = [(T.inverse() @ truth).log() for T in (first.T_hand_sensor, second.state.T_hand_sensor)]
    return fine and first.converged and second.converged, errors[0], errors[1]


def _check(seed: int, cells: int) -> None:
    rng = np.random.default_rng(seed)
    counted = 0
    for _ in range(cells):
        fine, paper, bundle = _recover(rng)
        counted += fine
        if fine:
            assert np.max(np.abs(np.concatenate([paper[:3], bundle[:3]]))) < ATOL_MM
            assert np.max(np.abs(np.concatenate([paper[3:], bundle[3:]]))) < ATOL_RAD
    assert counted > 0.99 * cells  # views of 8 to 26° are hardly ever degenerate, and then both iterations converge


def test_exact_points_give_the_exact_scp() -> None:
    _check(1, 1000)


@pytest.mark.slow
def test_exact_points_give_the_exact_scp_in_10000_cells() -> None:
    _check(2, 10000)


def test_printed_sign_diverges() -> None:
    """With the paper's plus the differences double each step; with minus they fall to rounding (THEORY 1.1)."""
    problem, _, Ts_sensor_jig = exact_pose_problem(np.random.default_rng(3), JIG)
    paper = PaperProblem(Ts_sensor_jig.t, problem.chain.T_base_hand, problem.location)
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
