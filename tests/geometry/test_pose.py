"""Pose obeys the laws of SE(3), at 0 and at π too. What this does not prove: that callers chain frames rightly."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from pytransform3d import rotations as pr
from pytransform3d import transformations as pt

from geometry import (
    InputError,
    Pose,
    exp_so3,
    log_so3,
    nearest_rotation,
    quaternion_wxyz,
    skew,
    stack_poses,
)
from tests.geometry.strategies import SEEDS, poses, rotation_vectors, tangents
from tests.pinned import pinned

ATOL_MM = 1e-8  # rounding of some metres through a few products, and near π of the logarithm's own slope
ATOL_ROTATION = 1e-13


def assert_same(first: Pose, second: Pose, atol_mm: float = ATOL_MM, atol: float = ATOL_ROTATION) -> None:
    np.testing.assert_allclose(first.R, second.R, rtol=0, atol=atol)
    np.testing.assert_allclose(first.t, second.t, rtol=0, atol=atol_mm)


@given(poses(), poses(), poses())
def test_poses_form_a_group(a: Pose, b: Pose, c: Pose) -> None:
    assert_same((a @ b) @ c, a @ (b @ c))
    assert_same(a @ Pose.identity(), a)
    assert_same(Pose.identity() @ a, a)
    assert_same(a @ a.inverse(), Pose.identity())
    assert_same((a @ b).inverse(), b.inverse() @ a.inverse())


@given(poses(), poses(), SEEDS)
def test_composition_maps_points_in_turn(a: Pose, b: Pose, seed: int) -> None:
    points = np.random.default_rng(seed).normal(size=(4, 3)) * 100
    np.testing.assert_allclose((a @ b) @ points, a @ (b @ points), rtol=0, atol=ATOL_MM)


@given(poses())
def test_exp_undoes_log(pose: Pose) -> None:
    assert_same(Pose.exp(pose.log()), pose)


@given(tangents())
def test_log_undoes_exp_inside_the_ball_of_pi(xi: np.ndarray) -> None:
    """Where the angle is π the axis has two signs; the pose, not the vector, is then the same."""
    angle = np.linalg.norm(xi[3:])
    if angle < np.pi - 1e-7:
        np.testing.assert_allclose(Pose.exp(xi).log(), xi, rtol=0, atol=ATOL_MM)
    else:
        assert_same(Pose.exp(Pose.exp(xi).log()), Pose.exp(xi))


@given(rotation_vectors())
def test_log_so3_keeps_the_digits_of_small_angles(w: np.ndarray) -> None:
    angle = np.linalg.norm(w)
    if angle < np.pi - 1e-7:
        np.testing.assert_allclose(log_so3(exp_so3(w)), w, rtol=1e-9 if angle < 0.1 else 1e-12, atol=1e-15)
    assert np.linalg.norm(log_so3(exp_so3(w))) <= np.pi + 1e-12


@given(poses(), tangents())
def test_adjoint_carries_twists(pose: Pose, xi: np.ndarray) -> None:
    """T · exp(ξ) = exp(Ad ξ) · T, checked through the exponential of both sides."""
    xi = xi * np.array([1e-3, 1e-3, 1e-3, 1, 1, 1])
    assert_same(pose @ Pose.exp(xi), Pose.exp(pose.adjoint @ xi) @ pose, atol_mm=1e-6, atol=1e-12)


@given(poses(), poses())
def test_adjoint_is_a_homomorphism(a: Pose, b: Pose) -> None:
    np.testing.assert_allclose((a @ b).adjoint, a.adjoint @ b.adjoint, rtol=0, atol=1e-8)


@given(tangents())
def test_exp_agrees_with_an_independent_library(xi: np.ndarray) -> None:
    theirs = pt.transform_from_exponential_coordinates(np.concatenate([xi[3:], xi[:3]]))
    # they switch to the identity's series at another angle: compare to their accuracy
    np.testing.assert_allclose(Pose.exp(xi).matrix, theirs, rtol=0, atol=1e-6)


@given(poses())
def test_quaternions_agree_with_an_independent_library(pose: Pose) -> None:
    q = quaternion_wxyz(pose.R)
    assert q[0] >= 0
    np.testing.assert_allclose(np.linalg.norm(q), 1, rtol=0, atol=1e-14)
    assert_same(Pose.from_quaternion_wxyz(q, pose.t), pose)
    np.testing.assert_allclose(pr.matrix_from_quaternion(q), pose.R, rtol=0, atol=1e-12)


@given(
    st.floats(-180, 180),
    st.one_of(st.floats(-90, 90), st.sampled_from([90.0, -90.0, 90 - 1e-7, 90 - 1e-12, -90 + 1e-9])),
    st.floats(-180, 180),
)
def test_fixed_angles_round_trip_also_at_the_gimbal_lock(x: float, y: float, z: float) -> None:
    """The matrix comes back at every angle; the three numbers themselves away from |Y| = 90°."""
    pose = Pose.from_fixed_xyz_deg([x, y, z], [1.0, 2.0, 3.0])
    again = Pose.from_fixed_xyz_deg(pose.fixed_xyz_deg, pose.t)
    assert_same(again, pose, atol=3e-9)  # within 1e-9 of the lock X is set to 0
    if abs(y) < 89:
        turned = (pose.fixed_xyz_deg - [x, y, z] + 180) % 360 - 180
        np.testing.assert_allclose(turned, 0, rtol=0, atol=1e-10)


def test_fixed_angles_are_the_papers_table_1() -> None:
    """R = Rz·Ry·Rx, spelled out."""
    x, y, z = np.deg2rad([-1.5241, 1.5871, 22.5287])
    rx = np.array([[1, 0, 0], [0, np.cos(x), -np.sin(x)], [0, np.sin(x), np.cos(x)]])
    ry = np.array([[np.cos(y), 0, np.sin(y)], [0, 1, 0], [-np.sin(y), 0, np.cos(y)]])
    rz = np.array([[np.cos(z), -np.sin(z), 0], [np.sin(z), np.cos(z), 0], [0, 0, 1]])
    pose = Pose.from_fixed_xyz_deg([-1.5241, 1.5871, 22.5287], [-16.8786, -75.5423, 116.5369])
    np.testing.assert_allclose(pose.R, rz @ ry @ rx, rtol=0, atol=1e-15)
    np.testing.assert_allclose(pose.fixed_xyz_deg, [-1.5241, 1.5871, 22.5287], rtol=0, atol=1e-13)


@given(SEEDS)
def test_batches_are_rows_of_single_poses(seed: int) -> None:
    rng = np.random.default_rng(seed)
    singles = [Pose.exp(rng.normal(size=6)) for _ in range(5)]
    batch, points, grids = stack_poses(singles), rng.normal(size=(5, 7, 3)), rng.normal(size=(5, 2, 4, 3))
    assert (batch @ points[0, 0]).shape == (5, 3)
    assert len(batch) == 5
    for i, one in enumerate(singles):
        assert_same(batch[i], one, 0, 0)
        assert_same((batch @ batch[::-1])[i], one @ singles[4 - i], 1e-14, 1e-14)
        assert_same((singles[0] @ batch)[i], singles[0] @ one, 1e-14, 1e-14)
        assert_same(batch.inverse()[i], one.inverse(), 1e-14, 1e-14)
        np.testing.assert_allclose((batch @ points)[i], one @ points[i], rtol=0, atol=1e-14)
        np.testing.assert_allclose((batch @ grids)[i], one @ grids[i], rtol=0, atol=1e-14)
        np.testing.assert_allclose((batch @ points[0, 0])[i], one @ points[0, 0], rtol=0, atol=1e-14)
        np.testing.assert_allclose((batch @ points[:, 0])[i], one @ points[i, 0], rtol=0, atol=1e-14)
        np.testing.assert_allclose(batch.log()[i], one.log(), rtol=0, atol=1e-14)
        np.testing.assert_allclose(batch.matrix[i], one.matrix, rtol=0, atol=0)
        np.testing.assert_allclose(batch.fixed_xyz_deg[i], one.fixed_xyz_deg, rtol=0, atol=1e-12)
    assert len(stack_poses([])) == 0


@given(SEEDS)
def test_nearest_rotation_is_nearer_than_its_neighbours(seed: int) -> None:
    """Also for matrices that are nearer to a reflection."""
    rng = np.random.default_rng(seed)
    m = rng.normal(size=(3, 3))
    r = nearest_rotation(m)
    np.testing.assert_allclose(r @ r.T, np.eye(3), rtol=0, atol=1e-13)
    np.testing.assert_allclose(np.linalg.det(r), 1, rtol=0, atol=1e-13)
    distance = np.linalg.norm(m - r)
    for _ in range(20):
        assert np.linalg.norm(m - r @ exp_so3(rng.normal(size=3) * 0.3)) >= distance - 1e-12


def test_skew_is_the_cross_product() -> None:
    a, b = np.random.default_rng(1).normal(size=(2, 4, 3))
    np.testing.assert_allclose((skew(a) @ b[..., None])[..., 0], np.cross(a, b), rtol=0, atol=1e-15)


@pytest.mark.parametrize(
    ("matrix", "message"),
    [
        (np.diag([1.0, 1, -1, 1]), "reflection"),
        (np.eye(4) * 1.001, "not a rotation"),
        (np.eye(3), "4 × 4"),
        (np.full((4, 4), np.nan), "not finite"),
        (np.eye(4) + np.diag([np.inf], k=3), "not finite"),
        (np.eye(4) + 5 * np.eye(4, k=-3), "last row"),
    ],
)
def test_matrices_that_are_no_pose_are_refused(matrix: np.ndarray, message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        Pose.from_matrix(matrix)
    pinned(str(refused.value))


def test_matrices_of_five_decimals_are_made_orthogonal() -> None:
    pose = Pose.exp([10.0, 20, 30, 0.3, -0.2, 1.1])
    again = Pose.from_matrix(np.round(pose.matrix, 5))
    np.testing.assert_allclose(again.R @ again.R.T, np.eye(3), rtol=0, atol=1e-14)
    assert_same(again, pose, 1e-5, 1e-5)


def test_misuse_is_an_error() -> None:
    with pytest.raises(InputError, match="quaternion") as refused:
        Pose.from_quaternion_wxyz([0.0, 0, 0, 0], [0.0, 0, 0])
    pinned(str(refused.value))
    with pytest.raises(TypeError):
        np.eye(3) @ Pose.identity()
    with pytest.raises(TypeError, match="single pose") as refused:
        len(Pose.identity())
    pinned(str(refused.value))
    with pytest.raises(TypeError, match="single pose") as refused:
        Pose.identity()[0]
    pinned(str(refused.value))
