"""Where the strings cross the laser plane by the chain, and how that changes with every unknown."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle.problem import Problem
from geometry import InputError, Pose, RobotModel, cross

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class State:
    """The unknowns: T_hand_sensor, Ts_base_jig (L), robot parameters (P,) [rad, mm], anchor shifts (6, 2) in y, z [mm].

    T_base_hand (F): the chain's poses at ``parameters``.
    """

    T_hand_sensor: Pose
    Ts_base_jig: Pose
    parameters: Array
    anchors: Array
    T_base_hand: Pose


@dataclass(frozen=True, eq=False)
class Linearised:
    """Residuals (F, M, 2) [mm], predicted minus measured, and their Jacobians; zero where a point is absent.

    scp (F, M, 2, 6): by ξ of T_hand_sensor·Exp(ξ). jig (F, M, 2, 6): by η of T_base_jig·Exp(η) of the frame's location.
    hand (F, M, 2, 6): by ζ of T_base_hand·Exp(ζ). anchors (F, M, 2, 12): by the anchors' y, z.
    parameters (F, 6, P): twists ζ by the robot's parameters.
    """

    residual: Array
    scp: Array
    jig: Array
    hand: Array
    anchors: Array
    parameters: Array


@dataclass(frozen=True, eq=False)
class Crossing:
    """Crossings (F, M, 3) in {P} [mm], string vectors over their x (F, M, 3), fraction (F, M) from start to end."""

    xyz_mm: Array
    slope: Array
    fraction: Array


def initial_state(problem: Problem, T_hand_sensor: Pose, Ts_base_jig: Pose) -> State:
    """The unknowns with robot and anchors at their nominal values."""
    chain = problem.chain
    return State(T_hand_sensor, Ts_base_jig, np.zeros(len(chain.parameter_sigma)), np.zeros((6, 2)), chain.T_base_hand)


def sensor_jig(problem: Problem, state: State) -> Pose:
    """T_sensor_jig (F) by the chain."""
    return (state.T_base_hand @ state.T_hand_sensor).inverse() @ state.Ts_base_jig[problem.location]


def crossings(problem: Problem, state: State, T_sensor_jig: Pose) -> Crossing:
    """Crossings of the measured strings with the laser plane."""
    anchors = problem.anchors_mm.copy()
    anchors[:, 1:] += state.anchors
    in_sensor = anchors @ np.swapaxes(T_sensor_jig.R, -1, -2) + T_sensor_jig.t[:, None, :]  # (F, 6, 3)
    starts, ends = problem.points.start_weights @ in_sensor, problem.points.end_weights @ in_sensor
    along = ends - starts
    slope = along / along[..., :1]
    return Crossing(starts - starts[..., :1] * slope, slope, -starts[..., 0] / along[..., 0])


def residuals(problem: Problem, state: State) -> Array:
    """Predicted minus measured points (F, M, 2) [mm], zero where absent."""
    crossing = crossings(problem, state, sensor_jig(problem, state))
    return (crossing.xyz_mm[..., 1:] - problem.points.yz_mm) * problem.points.present[..., None]


def linearise(problem: Problem, state: State) -> Linearised:
    """Residuals and Jacobians.

    A point carried by a twist (v, ω) of the jig moves by v + ω × c, and its string then slides along itself back
    into the plane: row r of the Jacobian is (g, c × g) with g = e_r - slope_r e_x.
    """
    T_sensor_jig = sensor_jig(problem, state)
    crossing = crossings(problem, state, T_sensor_jig)
    present = problem.points.present[..., None]
    g = np.zeros((*present.shape[:2], 2, 3))
    g[..., 0] = -crossing.slope[..., 1:] * present
    g[..., 0, 1] = g[..., 1, 2] = present[..., 0]
    twist = np.concatenate([g, cross(crossing.xyz_mm[..., None, :], g)], -1)  # (F, M, 2, 6), in sensor axes
    hand = -twist @ state.T_hand_sensor.inverse().adjoint
    jig = twist @ T_sensor_jig.adjoint[:, None]
    w = crossing.fraction[..., None]
    share = (1 - w) * problem.points.start_weights + w * problem.points.end_weights  # (F, M, 6)
    across = g @ T_sensor_jig.R[:, None, :, 1:]  # (F, M, 2, 2): by y and z of a shift in {J}
    anchors = share[..., None, :, None] * across[..., :, None, :]
    residual = (crossing.xyz_mm[..., 1:] - problem.points.yz_mm) * present
    return Linearised(residual, -twist, jig, hand, anchors.reshape(*twist.shape[:3], 12), _parameters(problem, state))


def moved(problem: Problem, state: State, scp: Array, jigs: Array, parameters: Array, anchors: Array) -> State:
    """The state after steps: SCP twist (6,), jig twists (L, 6), parameter steps (P,), anchor steps (12,)."""
    values = state.parameters + parameters
    hand = state.T_base_hand
    joints = problem.chain.joints_rad
    if np.any(parameters) and joints is not None:
        hand = corrected_robot(problem, values).hand_pose(joints)
    return replace(
        state,
        T_hand_sensor=state.T_hand_sensor @ Pose.exp(scp),
        Ts_base_jig=state.Ts_base_jig @ Pose.exp(jigs),
        parameters=values,
        anchors=state.anchors + anchors.reshape(6, 2),
        T_base_hand=hand,
    )


def corrected_robot(problem: Problem, parameters: Array) -> RobotModel:
    """The robot with the parameters' (P,) corrections; InputError where only poses are known."""
    robot = problem.chain.robot
    if robot is None:
        raise InputError("robot parameters need joint readings, but only hand poses are given: use model scp")
    delta = np.zeros((5, robot.n_joints))
    delta[problem.chain.parameters[:, 0], problem.chain.parameters[:, 1]] = parameters
    return robot.corrected(delta)


def _parameters(problem: Problem, state: State) -> Array:
    chain = problem.chain
    if not np.any(state.parameters) or chain.joints_rad is None:
        return chain.parameter_jacobian
    jacobian = corrected_robot(problem, state.parameters).stacked_jacobian(chain.joints_rad)
    return np.asarray(jacobian[:, :, chain.parameters[:, 0], chain.parameters[:, 1]])
