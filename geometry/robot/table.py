"""Corrections of a robot's parameters by name and joint, and random ones of the size that their priors state."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from geometry.errors import InputError
from geometry.robot.dh import DH_ROWS
from geometry.robot.model import Robot

Array = NDArray[np.float64]


def table(robot: Robot, values: ArrayLike) -> dict[str, Array]:
    """Corrections of a robot's parameters as rows over its joints.

    Parameters
    ----------
    robot
        The robot whose ``parameters`` are meant.
    values
        One number (P,) for each of them: corrections, or their σ.

    Returns
    -------
    dict
        A row (n,) for "theta", "d", "a", "alpha", "beta", and for any other kind of parameter that the robot has;
        0 where a joint has no such parameter.
    """
    v = np.asarray(values, dtype=float)
    if v.shape != (len(robot.parameters),):
        raise InputError(f"{v.size} corrections for a robot of {len(robot.parameters)} uncertain parameters")
    rows = {row.group: np.zeros(robot.n_joints) for row in DH_ROWS}
    for parameter, value in zip(robot.parameters, v, strict=True):
        if parameter.joint is not None:
            rows.setdefault(parameter.row, np.zeros(robot.n_joints))[parameter.joint - 1] = value
    return rows


def draw_errors(robot: Robot, rng: np.random.Generator) -> Array:
    """Random errors of a robot's parameters, normal with their prior σ.

    Parameters
    ----------
    robot
        The robot as its maker describes it.
    rng
        Where the numbers come from: one for every number of a Denavit-Hartenberg table, known or not, so that the
        same robot with other priors is drawn alike; then one for each further parameter.

    Returns
    -------
    ndarray
        Values (P,) in the order and the units of ``robot.parameters``: ``robot.corrected(values)`` is the arm as built.
    """
    drawn = dict(zip((row.group for row in DH_ROWS), rng.normal(size=(len(DH_ROWS), robot.n_joints)), strict=True))
    errors = np.zeros(len(robot.parameters))
    for i, p in enumerate(robot.parameters):
        number = drawn[p.row][p.joint - 1] if p.row in drawn and p.joint is not None else rng.normal()
        errors[i] = number * p.sigma
    return errors
