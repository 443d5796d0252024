"""Laws of the jig's pose by least squares: exact points, Jacobians, candidates, weakness."""

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from calib.pose.crossing import anchor_jacobian, crossings, crossings_jacobian
from calib.pose.fit import jig_pose
from calib.pose.solver import PoseProblem, solve_poses
from calib.pose.starts import grid_starts, pencil_starts
from calib.pose.weakness import scaled_condition
from calib.pose.weights import whitening
from calib.synthetic.views import disturbed, random_jig, random_pose, random_view
from geometry import AxisPoints, NoAnswerError, Pose, exp_so3, stack_poses
from jig_cad import DEFAULT_STRINGS, STRINGS, Jig
from tests.pinned import pinned

ATOL_MM, ATOL_RAD = 1e-8, 1e-9
CONDITION = 1e3
seeds = st.integers(0, 2**32 - 1)


def axis_of(T, jig, sigma_mm=0.02, labels=None, rng=None):
    labels = labels or jig.strings
    index = [jig.strings.index(label) for label in labels]
    yz = crossings(T, jig.starts[index], jig.directions[index])[0]
    if rng is not None:
        yz = yz + rng.normal(size=yz.shape) * sigma_mm
    cov = np.tile(np.eye(2) * sigma_mm**2, (len(index), 1, 1))
    return AxisPoints(tuple(labels), np.full(len(index), -1), yz, cov, ("",) * len(index))


def off(a: Pose, b: Pose):
    xi = (a.inverse() @ b).log()
    return np.linalg.norm(xi[..., :3], axis=-1), np.linalg.norm(xi[..., 3:], axis=-1)


@pytest.mark.parametrize("strings", [DEFAULT_STRINGS, tuple(STRINGS)])
def test_exact_points_of_1000_cells_give_the_true_pose(strings):
    """Random sizes, tilts, rolls and half turns: the right branch in all with a scaled condition below 1e3."""
    rng = np.random.default_rng(5)
    n = 1000
    jig = Jig.nominal(110.0, 95.0, strings=strings)
    T = stack_poses([random_pose(rng, jig, rng.uniform(120, 400)) for _ in range(n)])
    yz = crossings(T, jig.starts, jig.directions)[0]
    problem = PoseProblem(jig.starts, jig.directions, yz[:, None], np.eye(2 * len(strings)) / 0.02)
    solution = solve_poses(problem, pencil_starts(jig.starts, jig.directions, yz))
    best = np.argmin(solution.cost, axis=1)
    jacobian = solution.jacobian[np.arange(n), best]
    sound = np.array([scaled_condition(j) < CONDITION for j in jacobian])
    shift, turn = off(T, solution.T_sensor_jig[np.arange(n), best])
    assert sound.mean() > 0.99
    assert np.max(shift[sound]) < ATOL_MM
    assert np.max(turn[sound]) < ATOL_RAD


@given(seeds)
@settings(max_examples=40, deadline=None)
def test_jig_pose_recovers_exact_points_of_any_jig(seed):
    rng = np.random.default_rng(seed)
    jig, _ = random_jig(rng)
    T = random_pose(rng, jig, 300.0, (5.0, 35.0))
    result = jig_pose(axis_of(T, jig), jig)
    shift, turn = off(T, result.T_sensor_jig)
    assert result.converged
    assert shift < 1e-6
    assert turn < 1e-8


@given(seeds)
@example(366388)
@settings(max_examples=30, deadline=None)
def test_all_minima_are_found(seed):
    """No start out of 60 random ones reaches a minimum, possible for the strings, below any that jig_pose lists."""
    rng = np.random.default_rng(seed)
    jig = Jig.nominal(100.0, 100.0)
    T = random_pose(rng, jig, 300.0, (3.0, 30.0))
    axis = axis_of(T, jig, 0.03, rng=rng)
    result = jig_pose(axis, jig)
    starts = grid_starts(jig.starts, jig.directions, axis.yz_mm, kept=60)
    problem = PoseProblem(jig.starts, jig.directions, axis.yz_mm, whitening(axis.cov_yz_mm2))
    dense = solve_poses(problem, starts, max_iterations=60)
    share = dense.along_mm / jig.lengths
    good = dense.converged & np.all((share > 0) & (share < 1), axis=-1) & (dense.cost < result.best.cost + 50)
    for i in np.flatnonzero(good):
        distance = [off(dense.T_sensor_jig[int(i)], c.T_sensor_jig) for c in result.candidates]
        assert min(shift + 100 * turn for shift, turn in distance) < 2.0
    # the best is the most likely, with the anchors' tolerance: of two mirror poses it may be the one of higher cost
    assert min(c.cost for c in result.candidates) <= np.min(dense.cost[good], initial=np.inf) + 1e-3


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_jacobians_match_the_complex_step(seed):
    """Crossings against motion of the jig and of its anchors, relative 1e-8."""
    rng = np.random.default_rng(seed)
    jig, _ = random_jig(rng)
    T = random_pose(rng, jig, 300.0)
    _, _, analytic = crossings_jacobian(T, jig.starts, jig.directions)

    def crossing(R, t, starts, ends):
        p, e = starts @ R.T + t, ends @ R.T + t
        s = -p[:, 0] / (e[:, 0] - p[:, 0])
        return (p + s[:, None] * (e - p))[:, 1:]

    h = 1e-30
    generators = np.array(
        [[[0, 0, 0], [0, 0, -1], [0, 1, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]], [[0, -1, 0], [1, 0, 0], [0, 0, 0]]]
    )
    for k in range(6):
        R = T.R @ (np.eye(3) + 1j * h * generators[k - 3]) if k >= 3 else T.R
        t = T.t + (T.R[:, k] * 1j * h if k < 3 else 0)
        numeric = crossing(R, t, jig.starts, jig.ends).imag / h
        np.testing.assert_allclose(analytic[..., k], numeric, rtol=1e-8, atol=1e-8 * np.abs(numeric).max())
    first, second = anchor_jacobian(T, jig.starts, jig.directions, jig.lengths)
    for k in range(3):
        step = np.eye(3)[k] * 1j * h
        np.testing.assert_allclose(first[..., k], crossing(T.R, T.t, jig.starts + step, jig.ends).imag / h, atol=1e-8)
        np.testing.assert_allclose(second[..., k], crossing(T.R, T.t, jig.starts, jig.ends + step).imag / h, atol=1e-8)


def test_covariance_is_true():
    """Normalised estimation error squared over 250 noisy frames: mean of 6 degrees of freedom within 4 σ."""
    rng = np.random.default_rng(2)
    jig = Jig.nominal(100.0, 100.0, tolerance_mm=0.0)
    T = random_pose(rng, jig, 300.0, (20.0, 30.0))
    nees = []
    for _ in range(250):
        result = jig_pose(axis_of(T, jig, 0.01, rng=rng), jig, guess=T)
        xi = (T.inverse() @ result.T_sensor_jig).log()
        nees.append(xi @ np.linalg.solve(result.covariance, xi))
    assert abs(np.mean(nees) - 6) < 4 * np.sqrt(12 / 250)


def mirror_view(jig):
    """Pitch of 20° through mid-height, where B' and C' stand at equal height (docs/theory.md, mirror poses)."""
    R = exp_so3(np.deg2rad(20.0) * np.array([0.0, 1.0, 0.0]))
    middle = np.array([jig.height_mm / 2, 0.0, 0.5 * np.sqrt(3) / 2 * jig.side_mm])
    return Pose(R, middle - R @ np.array([0.0, 0.0, 300.0])).inverse()


def test_the_mirror_is_reported_and_the_guess_decides():
    jig = Jig.nominal()
    T = mirror_view(jig)
    result = jig_pose(axis_of(T, jig), jig)
    assert result.ambiguity == "mirror"
    assert len(result.candidates) == 2
    assert result.candidates[1].cost < 1e-9
    apart = off(*(c.T_sensor_jig for c in result.candidates))[0]
    assert 30 < apart < 60
    for candidate in result.candidates:
        guess = disturbed(candidate.T_sensor_jig, jig, 3.0, 1.5, np.random.default_rng(0))
        chosen = jig_pose(axis_of(T, jig), jig, guess).T_sensor_jig
        assert off(chosen, candidate.T_sensor_jig)[0] < 1e-6


def test_the_sixth_string_removes_the_mirror():
    jig = Jig.nominal(strings=tuple(STRINGS))
    T = mirror_view(jig)
    result = jig_pose(axis_of(T, jig), jig)
    assert result.ambiguity == "unique"
    assert off(T, result.T_sensor_jig)[0] < 1e-6


def test_a_perpendicular_view_is_weak_with_five_strings_and_sound_with_six():
    T = Pose(np.eye(3), np.array([-50.0, 3.0, 260.0]))
    five, six = Jig.nominal(), Jig.nominal(strings=tuple(STRINGS))
    weak = jig_pose(axis_of(T, five), five)
    assert weak.ambiguity == "weak"
    assert weak.condition > CONDITION
    assert len(weak.weak) >= 1
    sound = jig_pose(axis_of(T, six), six)
    assert sound.condition < 60
    assert sound.ambiguity == "unique"
    assert off(T, sound.T_sensor_jig)[0] < 1e-6


@given(seeds)
@settings(max_examples=25, deadline=None)
def test_near_perpendicular_or_mirrored_views_never_pass_for_unique_and_wrong(seed):
    """Noisy five-string views within 6° of perpendicular: the answer is right by its covariance, or not "unique"."""
    rng = np.random.default_rng(seed)
    jig = Jig.nominal(tolerance_mm=0.0)
    T = random_pose(rng, jig, 300.0, (0.0, 6.0))
    result = jig_pose(axis_of(T, jig, 0.02, rng=rng), jig)
    xi = (result.T_sensor_jig.inverse() @ T).log()
    nees = xi @ np.linalg.solve(result.covariance, xi)
    assert result.ambiguity != "unique" or nees < 30


def test_the_half_turn_fits_the_same_points_under_exchanged_labels():
    jig = Jig.nominal(strings=tuple(STRINGS))
    T = random_pose(np.random.default_rng(3), jig, 300.0)
    yz = crossings(T, jig.starts, jig.directions)[0]
    turned = crossings(T @ jig.symmetries[0].pose, jig.starts, jig.directions)[0]
    exchange = [jig.strings.index(s) for s in ("A", "C", "B", "C'", "B'", "D'")]
    np.testing.assert_allclose(turned, yz[exchange], atol=1e-9)


@pytest.mark.parametrize("labels", [("A", "B", "B'", "C"), ("A", "B'", "C'", "C"), ("B", "B'", "C"), ("B'", "C'", "B")])
def test_few_strings_and_a_guess_give_the_pose(labels):
    rng = np.random.default_rng(11)
    jig = Jig.nominal()
    T = random_pose(rng, jig, 300.0, (10.0, 30.0))
    guess = disturbed(T, jig, 2.0, 1.0, rng)
    result = jig_pose(axis_of(T, jig, labels=labels), jig, guess)
    assert min(off(T, c.T_sensor_jig)[0] for c in result.candidates) < 1e-5


def test_too_few_or_unknown_strings_are_refused_in_words():
    view = random_view(np.random.default_rng(0), six=False)
    axis = axis_of(view.T_sensor_jig, view.jig, labels=("A", "B"))
    with pytest.raises(NoAnswerError, match="2 strings") as refused:
        jig_pose(axis, view.jig)
    pinned(str(refused.value))
    six = Jig.nominal(strings=tuple(STRINGS))
    with pytest.raises(NoAnswerError, match="D'") as refused:
        jig_pose(axis_of(view.T_sensor_jig, six), view.jig)
    pinned(str(refused.value))


def test_points_in_one_place_or_in_one_line_do_not_break_the_solver():
    """Nonsense in, an answer called weak or a refusal out; no NaN, no warning."""
    jig = Jig.nominal()
    cov = np.tile(np.eye(2) * 4e-4, (5, 1, 1))
    line = np.column_stack([np.linspace(-40.0, 40.0, 5), np.full(5, 300.0)])
    for yz in (np.full((5, 2), 300.0), line, line + np.array([0.0, 1e-9])):
        try:
            result = jig_pose(AxisPoints(jig.strings, np.full(5, -1), yz, cov, ("",) * 5), jig)
        except NoAnswerError:
            continue
        assert np.all(np.isfinite(result.T_sensor_jig.matrix))
        assert result.ambiguity == "weak" or result.best.chi2 > 100
