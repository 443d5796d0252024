"""Makers' pose numbers against their published formulas written out, and round trips through the gimbal lock."""

from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from numpy.typing import NDArray
from pytransform3d import rotations as pr
from scipy.spatial.transform import Rotation

from geometry import InputError, Pose
from geometry.robot.conventions import CONVENTIONS, express, interpret
from tests.geometry.strategies import poses
from tests.pinned import pinned

ATOL_ROTATION = 3e-9  # within 1e-9 of the gimbal lock the turn about X is set to 0
ATOL_MM = 1e-8

# a pose whose angles differ, by each maker's formula with scipy's elementary turns
X, Y, Z = 10.0, 20.0, 30.0
BY_FORMULA = Rotation.from_euler("z", Z, degrees=True) * Rotation.from_euler("y", Y, degrees=True)
BY_FORMULA = BY_FORMULA * Rotation.from_euler("x", X, degrees=True)
POSE = Pose(BY_FORMULA.as_matrix(), np.array([1000.0, 2000.0, 3000.0]))
EXPECTED = {
    "kuka": {"A / °": Z, "B / °": Y, "C / °": X},
    "fanuc": {"W / °": X, "P / °": Y, "R / °": Z},
    "yaskawa": {"Rx / °": X, "Ry / °": Y, "Rz / °": Z},
    "mitsubishi": {"A / °": X, "B / °": Y, "C / °": Z},
    "abb": dict(zip(("q1", "q2", "q3", "q4"), BY_FORMULA.as_quat()[[3, 0, 1, 2]], strict=True)),
    "ros": dict(zip(("qx", "qy", "qz", "qw"), BY_FORMULA.as_quat(), strict=True)),
    "ur": dict(zip(("rx / rad", "ry / rad", "rz / rad"), BY_FORMULA.as_rotvec(), strict=True)),
}


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_numbers_are_those_of_the_makers_formula(convention: str) -> None:
    numbers = express(POSE, convention)
    for label, value in EXPECTED[convention].items():
        assert numbers[label] == pytest.approx(value, abs=1e-12)
    metres = convention in ("ros", "ur")
    assert list(numbers.values())[:3] == pytest.approx([1, 2, 3] if metres else [1000, 2000, 3000])
    assert next(iter(numbers)) == ("x / m" if metres else "x / mm")


@pytest.mark.parametrize("convention", CONVENTIONS)
@given(pose=poses())
@settings(max_examples=40)
def test_round_trips(convention: str, pose: Pose) -> None:
    again = interpret(list(express(pose, convention).values()), convention)
    np.testing.assert_allclose(again.R, pose.R, rtol=0, atol=ATOL_ROTATION)
    np.testing.assert_allclose(again.t, pose.t, rtol=0, atol=ATOL_MM)


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("y_deg", [90.0, -90.0, 90 - 1e-10, -90 + 1e-7])
def test_round_trips_at_the_gimbal_lock(convention: str, y_deg: float) -> None:
    pose = Pose.from_fixed_xyz_deg([25.0, y_deg, -70.0], [1.0, 2.0, 3.0])
    again = interpret(list(express(pose, convention).values()), convention)
    np.testing.assert_allclose(again.R, pose.R, rtol=0, atol=ATOL_ROTATION)


def test_what_can_not_be_a_pose_is_refused() -> None:
    with pytest.raises(InputError, match='did you mean "kuka"') as refused:
        express(POSE, "kukka")
    pinned(str(refused.value))
    with pytest.raises(InputError, match=r"ABB takes 7 finite numbers: x / mm") as refused:
        interpret([0, 0, 0, 0, 0, 0], "abb")
    pinned(str(refused.value))
    with pytest.raises(InputError, match="length 2") as refused:
        interpret([0, 0, 0, 2, 0, 0, 0], "abb")
    pinned(str(refused.value))
    with pytest.raises(InputError, match="finite") as refused:
        interpret([0, 0, 0, np.nan, 0, 0], "kuka")
    pinned(str(refused.value))


Reader = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def euler_readers(order: str) -> tuple[Reader, Reader]:
    """A maker's angles [deg] as a matrix by scipy (turns about fixed axes) and by pytransform3d (about moving axes).

    ``order``: the axes in the order in which the maker lists their angles. All these makers turn about fixed X, Y, Z.
    """
    zyx = [order.index(axis) for axis in "zyx"]
    return (
        lambda n: Rotation.from_euler("xyz", n[zyx[::-1]], degrees=True).as_matrix(),
        lambda n: pr.matrix_from_euler(np.deg2rad(n[zyx]), 2, 1, 0, extrinsic=False),
    )


READERS: dict[str, tuple[Reader, Reader]] = {
    "kuka": euler_readers("zyx"),
    "fanuc": euler_readers("xyz"),
    "yaskawa": euler_readers("xyz"),
    "mitsubishi": euler_readers("xyz"),
    "abb": (lambda n: Rotation.from_quat(n, scalar_first=True).as_matrix(), pr.matrix_from_quaternion),
    "ros": (
        lambda n: Rotation.from_quat(n).as_matrix(),
        lambda n: pr.matrix_from_quaternion(pr.quaternion_wxyz_from_xyzw(n)),
    ),
    "ur": (lambda n: Rotation.from_rotvec(n).as_matrix(), pr.matrix_from_compact_axis_angle),
}
LOCKED = [Pose.from_fixed_xyz_deg([25.0, y, -70.0], np.zeros(3)) for y in (90.0, -90.0, 90 - 1e-10, -90 + 1e-7)]
HALF_TURNS = [Pose(np.diag(signs), np.zeros(3)) for signs in ([1.0, -1, -1], [-1.0, 1, -1], [-1.0, -1, 1])]


def assert_others_agree(convention: str, pose: Pose) -> None:
    """What is written, scipy and pytransform3d read as the pose; and what they read so is read here so too."""
    numbers = np.array(list(express(pose, convention).values()))
    for reader in READERS[convention]:
        np.testing.assert_allclose(reader(numbers[3:]), pose.R, rtol=0, atol=ATOL_ROTATION)
        np.testing.assert_allclose(reader(numbers[3:]), interpret(numbers, convention).R, rtol=0, atol=ATOL_ROTATION)


@pytest.mark.parametrize("convention", CONVENTIONS)
@given(pose=poses())
@settings(max_examples=60)
def test_scipy_and_pytransform3d_read_what_is_written(convention: str, pose: Pose) -> None:
    assert_others_agree(convention, pose)


@pytest.mark.parametrize("convention", CONVENTIONS)
@pytest.mark.parametrize("pose", [Pose.identity(), *LOCKED, *HALF_TURNS])
def test_scipy_and_pytransform3d_read_the_singular_poses(convention: str, pose: Pose) -> None:
    """Gimbal lock of the angles, half turns of vector and quaternion."""
    assert_others_agree(convention, pose)
