"""The paper's Eqs. (5)-(10) on exact and noisy points."""

import numpy as np
import pytest

from calib.pose.closed_form import LABELS, closed_form_strings, closed_forms
from calib.pose.crossing import crossings
from calib.pose.fit import jig_pose
from calib.pose.solver import PoseProblem, solve_poses
from calib.pose.weakness import scaled_condition
from calib.synthetic.views import random_pose
from geometry import AxisPoints, InputError, Pose, stack_poses
from jig_cad import Jig
from tests.pinned import pinned

ATOL_MM, ATOL_RAD = 1e-8, 1e-9
SIDE_MM, HEIGHT_MM = 115.0, 90.0


def cells(n, seed=1, tilt_deg=(2.0, 35.0)):
    rng = np.random.default_rng(seed)
    jig = Jig.nominal(SIDE_MM, HEIGHT_MM)
    T = stack_poses([random_pose(rng, jig, rng.uniform(120, 400), tilt_deg) for _ in range(n)])
    return jig, T, crossings(T, jig.starts, jig.directions)[0]


def best(forms, n):
    return forms.T_sensor_jig[np.arange(n), np.argmin(forms.h1_disagreement_mm, axis=1)]


def points(yz, sigma_mm=0.02):
    return AxisPoints(LABELS, np.full(5, -1), yz, np.tile(np.eye(2) * sigma_mm**2, (5, 1, 1)), ("",) * 5)


def test_exact_points_of_1000_cells_give_the_true_pose():
    n = 1000
    jig, T, yz = cells(n)
    forms = closed_forms(yz, SIDE_MM, HEIGHT_MM)
    found = best(forms, n)
    solution = solve_poses(PoseProblem(jig.starts, jig.directions, yz, np.eye(10)), T)
    sound = np.array([scaled_condition(j) < 1e3 for j in solution.jacobian])
    xi = (T.inverse() @ found).log()[sound & forms.defined]
    assert np.mean(sound & forms.defined) > 0.98
    assert np.max(np.linalg.norm(xi[:, :3], axis=1)) < ATOL_MM
    assert np.max(np.linalg.norm(xi[:, 3:], axis=1)) < ATOL_RAD


def test_closed_form_and_least_squares_agree():
    jig, _, yz = cells(40, seed=4, tilt_deg=(8.0, 30.0))
    for frame in yz:
        forms = closed_forms(frame, SIDE_MM, HEIGHT_MM)
        closed = forms.T_sensor_jig[int(np.argmin(forms.h1_disagreement_mm))]
        solved = jig_pose(points(frame), jig, closed)
        assert np.linalg.norm((closed.inverse() @ solved.T_sensor_jig).log()[:3]) < 1e-7
        assert np.min(forms.h1_disagreement_mm) < 1e-9 < np.max(forms.h1_disagreement_mm)


def test_the_two_heights_disagree_under_noise():
    _, _, yz = cells(50, seed=2, tilt_deg=(10.0, 30.0))
    noisy = yz + np.random.default_rng(0).normal(0, 0.03, yz.shape)
    forms = closed_forms(noisy, SIDE_MM, HEIGHT_MM)
    smallest = np.min(forms.h1_disagreement_mm[forms.defined], axis=1)
    assert 0.005 < np.median(smallest) < 1.0


def test_noise_near_a_perpendicular_view_leaves_no_angle():
    """a/l > 1 is reported as undefined, never by a number (docs/theory.md, the closed form)."""
    _, _, yz = cells(200, seed=3, tilt_deg=(0.0, 1.0))
    noisy = yz + np.random.default_rng(0).normal(0, 0.03, yz.shape)
    forms = closed_forms(noisy, SIDE_MM, HEIGHT_MM)
    undefined = ~forms.defined
    assert undefined.sum() > 20
    assert np.all(np.isnan(forms.T_sensor_jig.R[undefined]).any(axis=(1, 2, 3)))


def test_a_jig_that_is_no_pillar_is_refused_in_words():
    anchors = {"P": (0.0, 0.0, 0.0), "Q": (90.0, 0.0, 0.0), "R": (0.0, 60.0, 0.0)}
    fan = Jig.of_lines(anchors, {"1": ("P", "Q"), "2": ("P", "R")})
    with pytest.raises(InputError, match="the paper's closed form") as refused:
        closed_form_strings(fan)
    pinned(str(refused.value))


def test_rotations_are_rotations():
    _, _, yz = cells(50, seed=6)
    R = closed_forms(yz + np.random.default_rng(1).normal(0, 0.05, yz.shape), SIDE_MM, HEIGHT_MM).T_sensor_jig.R
    R = R[np.isfinite(R).all(axis=(-1, -2))]
    np.testing.assert_allclose(R @ np.swapaxes(R, -1, -2), np.broadcast_to(np.eye(3), R.shape), atol=1e-12)
    assert np.all(np.linalg.det(R) > 0)
    assert isinstance(Pose(R, np.zeros((len(R), 3))), Pose)
