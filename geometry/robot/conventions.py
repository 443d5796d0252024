"""A pose in the numbers of robot makers; nothing here guesses a maker from numbers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry.errors import InputError, did_you_mean
from geometry.pose import Pose, exp_so3, log_so3, quaternion_wxyz

Array = NDArray[np.float64]

ATOL_QUATERNION = 1e-3  # a quaternion further from unit length is a mistake, not rounding


@dataclass(frozen=True)
class Convention:
    """How a maker writes a pose: labels of its numbers with units, and the formula of the rotation.

    length_mm: the unit of length in mm. The first three numbers are the translation.
    """

    maker: str
    labels: tuple[str, ...]
    formula: str
    length_mm: float
    rotation_to: Callable[[Pose], Array]
    rotation_from: Callable[[Array], Array]


def express(pose: Pose, convention: str) -> dict[str, float]:
    """A pose in a maker's numbers.

    Parameters
    ----------
    pose : Pose
        One T_a_b.
    convention : str
        A key of CONVENTIONS: kuka, fanuc, abb, ….

    Returns
    -------
    dict of str to float
        By the maker's labels, in mm and in the maker's own angles.
    """
    c = _known(convention)
    numbers = [*(pose.t / c.length_mm), *c.rotation_to(pose)]
    return {label: float(value) for label, value in zip(c.labels, numbers, strict=True)}


def interpret(numbers: Sequence[float], convention: str) -> Pose:
    """The pose of a maker's numbers.

    Parameters
    ----------
    numbers : sequence of float
        In the order of the convention's labels, in mm and in the maker's own angles.
    convention : str
        A key of CONVENTIONS.

    Returns
    -------
    Pose
        One T_a_b.

    Raises
    ------
    InputError
        Where they can not be a pose, such as a quaternion that has no length 1.
    """
    c = _known(convention)
    values = np.asarray(numbers, dtype=float)
    if values.shape != (len(c.labels),) or not np.all(np.isfinite(values)):
        raise InputError(f"{c.maker} takes {len(c.labels)} finite numbers: {', '.join(c.labels)}")
    return Pose(c.rotation_from(values[3:]), values[:3] * c.length_mm)


def _known(convention: str) -> Convention:
    if convention not in CONVENTIONS:
        instead = did_you_mean(convention, CONVENTIONS) or f"; known are {', '.join(CONVENTIONS)}"
        raise InputError(f'no pose convention is called "{convention}"{instead}')
    return CONVENTIONS[convention]


def _euler(order: tuple[int, int, int]) -> tuple[Callable[[Pose], Array], Callable[[Array], Array]]:
    """Angles [deg] about fixed X, Y, Z as ``order`` lists them; at |Y| = 90° the turn about X is given as 0."""

    def to(pose: Pose) -> Array:
        return pose.fixed_xyz_deg[list(order)]

    def back(angles: Array) -> Array:
        xyz = np.empty(3)
        xyz[list(order)] = angles
        return Pose.from_fixed_xyz_deg(xyz, np.zeros(3)).R

    return to, back


def _unit_quaternion(wxyz: Array) -> Array:
    norm = float(np.linalg.norm(wxyz))
    if abs(norm - 1) > ATOL_QUATERNION:
        raise InputError(f"the quaternion has length {norm:.6g}: 1 is right (are its numbers in the right order?)")
    return Pose.from_quaternion_wxyz(wxyz, np.zeros(3)).R


_MM = ("x / mm", "y / mm", "z / mm")
_M = ("x / m", "y / m", "z / m")

CONVENTIONS = {
    "kuka": Convention("KUKA", (*_MM, "A / °", "B / °", "C / °"), "R = Rz(A)·Ry(B)·Rx(C)", 1.0, *_euler((2, 1, 0))),
    "fanuc": Convention("Fanuc", (*_MM, "W / °", "P / °", "R / °"), "R = Rz(R)·Ry(P)·Rx(W)", 1.0, *_euler((0, 1, 2))),
    "yaskawa": Convention(
        "Yaskawa", (*_MM, "Rx / °", "Ry / °", "Rz / °"), "R = Rz(Rz)·Ry(Ry)·Rx(Rx)", 1.0, *_euler((0, 1, 2))
    ),
    "mitsubishi": Convention(
        "Mitsubishi", (*_MM, "A / °", "B / °", "C / °"), "R = Rz(C)·Ry(B)·Rx(A): A is about x", 1.0, *_euler((0, 1, 2))
    ),
    "abb": Convention(
        "ABB",
        (*_MM, "q1", "q2", "q3", "q4"),
        "unit quaternion, scalar q1 first",
        1.0,
        lambda pose: quaternion_wxyz(pose.R),
        _unit_quaternion,
    ),
    "ros": Convention(
        "ROS",
        (*_M, "qx", "qy", "qz", "qw"),
        "unit quaternion, scalar qw last",
        1000.0,
        lambda pose: quaternion_wxyz(pose.R)[[1, 2, 3, 0]],
        lambda q: _unit_quaternion(q[[3, 0, 1, 2]]),
    ),
    "ur": Convention(
        "Universal Robots",
        (*_M, "rx / rad", "ry / rad", "rz / rad"),
        "rotation vector: angle times unit axis",
        1000.0,
        lambda pose: log_so3(pose.R),
        exp_so3,
    ),
}
