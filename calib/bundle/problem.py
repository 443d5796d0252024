"""The least-squares problem of all frames: measured points, the robot's poses and Jacobians, priors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from geometry import PARAMETERS, AxisPoints, Pose, RobotModel, RobotUncertainty
from jig_cad import ANCHORS, STRINGS

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_STARTS = np.array([[a == STRINGS[s][0] for a in ANCHORS] for s in STRINGS], dtype=float)
_ENDS = np.array([[a == STRINGS[s][1] for a in ANCHORS] for s in STRINGS], dtype=float)
_ORDER = {s: i for i, s in enumerate(STRINGS)}
_SIGMA_FLOOR_MM = 1e-6  # exact points must not make the weights infinite


@dataclass(frozen=True, eq=False)
class Points:
    """Axis points of F frames, filled up to M a frame.

    yz_mm (F, M, 2), cov_mm2 (F, M, 2, 2) (unit where absent), present (F, M), string (F, M) index into STRINGS.
    """

    yz_mm: Array
    cov_mm2: Array
    present: NDArray[np.bool_]
    string: Index

    @property
    def start_weights(self) -> Array:
        """Which anchor starts each point's string, one-hot (F, M, 6)."""
        return np.asarray(_STARTS[self.string])

    @property
    def end_weights(self) -> Array:
        """Which anchor ends each point's string, one-hot (F, M, 6)."""
        return np.asarray(_ENDS[self.string])


@dataclass(frozen=True, eq=False)
class Chain:
    """The robot at F frames.

    T_base_hand (F). parameter_jacobian (F, 6, P): twists in hand axes of the P uncertain parameters. parameters (P, 2):
    (row of PARAMETERS, joint). parameter_sigma (P,): prior. noise (F, 6, 6): covariance of the hand pose, hand axes.
    robot, joints_rad (F, n): to recompute poses, None where only poses are known. inferred: the readings follow from
    poses by the nominal table, which they can therefore not correct.
    """

    T_base_hand: Pose
    parameter_jacobian: Array
    parameters: Index
    parameter_sigma: Array
    noise: Array
    robot: RobotModel | None = None
    joints_rad: Array | None = None
    inferred: bool = False


@dataclass(frozen=True, eq=False)
class Problem:
    """Points, chain, location (F,) of 0 … L - 1, anchors (6, 3) and the σ of their y and z (0: taken as exact)."""

    points: Points
    chain: Chain
    location: Index
    n_locations: int
    anchors_mm: Array
    anchor_sigma_mm: float

    @property
    def n_frames(self) -> int:
        """The number of frames."""
        return len(self.location)


def at_frames(problem: Problem, chosen: NDArray[np.bool_]) -> Problem:
    """The problem of the ``chosen`` frames (F,) alone, its locations numbered anew."""
    i = np.flatnonzero(chosen)
    p, c = problem.points, problem.chain
    points = Points(p.yz_mm[i], p.cov_mm2[i], p.present[i], p.string[i])
    joints = None if c.joints_rad is None else c.joints_rad[i]
    chain = replace(
        c,
        T_base_hand=c.T_base_hand[i],
        parameter_jacobian=c.parameter_jacobian[i],
        noise=c.noise[i],
        joints_rad=joints,
    )
    names, location = np.unique(problem.location[i], return_inverse=True)
    return replace(problem, points=points, chain=chain, location=location.astype(np.intp), n_locations=len(names))


def pad_points(frames: Sequence[AxisPoints]) -> Points:
    """Frames' axis points in rectangular arrays."""
    count = max((len(f) for f in frames), default=0)
    shape = (len(frames), max(count, 1))
    yz, present, string = np.zeros((*shape, 2)), np.zeros(shape, dtype=bool), np.zeros(shape, dtype=np.intp)
    covariance = np.broadcast_to(np.eye(2), (*shape, 2, 2)).copy()
    for i, f in enumerate(frames):
        n = len(f)
        yz[i, :n], present[i, :n], string[i, :n] = f.yz_mm, True, [_ORDER[s] for s in f.label]
        covariance[i, :n] = f.cov_yz_mm2 + np.eye(2) * _SIGMA_FLOOR_MM**2
    return Points(yz, covariance, present, string)


def robot_chain(robot: RobotModel, joints_rad: Array, beta_sigma_rad: float = 0.0) -> Chain:
    """The chain of a robot by its table, with its uncertain parameters and joint noise.

    beta_sigma_rad: prior of Hayati's β at joints whose axis is parallel to the next (α near 0 or π); 0 leaves β fixed.
    """
    sigma = parameter_sigmas(robot, beta_sigma_rad)
    rows, joints = np.nonzero(sigma > 0)
    jacobian = robot.stacked_jacobian(joints_rad)[:, :, rows, joints]
    j = robot.joint_jacobian(joints_rad)
    noise = robot.uncertainty.joint_sigma_rad**2 * (j @ np.swapaxes(j, -1, -2))
    parameters = np.column_stack([rows, joints])
    hand = robot.hand_pose(joints_rad)
    return Chain(hand, jacobian, parameters, sigma[rows, joints], noise, robot, joints_rad)


def pose_chain(Ts_base_hand: Pose, noise: Array) -> Chain:
    """The chain where only hand poses are known; ``noise`` (6, 6) is their covariance in hand axes."""
    n = len(Ts_base_hand)
    none = np.zeros((n, 6, 0))
    return Chain(
        Ts_base_hand, none, np.zeros((0, 2), dtype=np.intp), np.zeros(0), np.broadcast_to(noise, (n, 6, 6)).copy()
    )


def parameter_sigmas(robot: RobotModel, beta_sigma_rad: float = 0.0) -> Array:
    """Prior σ (5, n) of the robot's PARAMETERS; β has one at parallel axes only."""
    u: RobotUncertainty = robot.uncertainty
    sigma = np.zeros((len(PARAMETERS), robot.n_joints))
    sigma[:4] = np.array([u.theta_sigma_rad, u.d_sigma_mm, u.a_sigma_mm, u.alpha_sigma_rad])[:, None]
    sigma[4, parallel_axes(robot)] = beta_sigma_rad
    return sigma


def parallel_axes(robot: RobotModel) -> NDArray[np.bool_]:
    """Whether link i (n,) carries its joint's axis into a (nearly) parallel one, where d is not identifiable alone."""
    parallel = np.abs(np.sin(robot.alpha)) < np.sin(np.deg2rad(1.0))
    parallel[-1 if robot.convention == "standard" else 0] = False  # that α joins no two joints
    return np.asarray(parallel)
