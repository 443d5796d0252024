"""Fixed-point closure: a tool's point seated again and again in the same socket, joint readings alone.

The paper's setting without the sensor: T_base_hand(q) · p_tool = x_socket for every configuration of a socket. Unknown
are the tool's point, each socket's place, and the robot's parameters under their priors. Positions alone leave the
arm's scale open (a smaller arm closes better); a known distance between the two sockets of one base holds it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle.normal import Normal, reduced, solve, with_prior
from calib.bundle.problem import parameter_sigmas
from geometry import InputError, RobotModel, skew

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_DISTANCE_SIGMA_MM = 0.02
_MAX_ITERATIONS = 80
_PLAIN_ITERATIONS = 6  # before the residuals say which configurations to trust
_TOLERANCE = 1e-8
_CAUCHY = 4.0
_CHI3_MEDIAN = 1.538  # median of the length of three standard normal numbers
_LONE = np.diag([0.0] * 3 + [1.0] * 3)  # holds the second socket that a location does not have


@dataclass(frozen=True, eq=False)
class Socket:
    """The configurations (N, n) [rad] in which the tool sat in one socket of one base location."""

    location: str
    name: str
    joints_rad: Array


@dataclass(frozen=True, eq=False)
class ClosureFit:
    """A solved closure: the tool's point in the hand, the sockets in the base [mm], the robot.

    residual_mm (N, 3), rms_mm: between the tool's point and its socket. parameters (P,): corrections of the robot.
    weight (N,): robust weights, 1 where a configuration is trusted. chi2_per_dof: by the noise of seat and joints.
    tool_covariance (3, 3) [mm²]: of the point, with the noise that the residuals show where chi2_per_dof is above 1.
    evidence: minus twice the log marginal likelihood, comparable between priors and models on the same data.
    """

    tool_mm: Array
    sockets_mm: Array
    robot: RobotModel
    parameters: Array
    residual_mm: Array
    rms_mm: float
    evidence: float
    tool_covariance: Array
    chi2_per_dof: float
    weight: Array
    converged: bool


@dataclass(frozen=True, eq=False)
class ClosureProblem:
    """Configurations stacked (N, n), the location (N,) and the side 0 or 1 (N,) of their socket, and noise.

    paired (L,): locations with two sockets, ``distance_mm`` apart. seat_mm: σ of the ball in its socket, per axis.
    joint_rad: σ of the joints. parameters (P, 2), prior_sigma (P,): of the robot.
    """

    robot: RobotModel
    joints_rad: Array
    location: NDArray[np.intp]
    side: NDArray[np.intp]
    paired: Mask
    distance_mm: float | None
    seat_mm: float
    joint_rad: float
    parameters: NDArray[np.intp]
    prior_sigma: Array


def closure_problem(
    sockets: Sequence[Socket],
    robot: RobotModel,
    distance_mm: float | None,
    prior_scale: float,
    seat_mm: float,
    beta_sigma_rad: float = 0.0,
) -> ClosureProblem:
    """The problem of some sockets; the two sockets of a location that has two are ``distance_mm`` apart."""
    if len(sockets) == 0:
        raise InputError("no sockets were given: each needs the joint readings of at least three configurations")
    sigma = prior_scale * parameter_sigmas(robot, beta_sigma_rad)
    rows, columns = np.nonzero(sigma > 0)
    places = list(dict.fromkeys(s.location for s in sockets))
    seen: dict[str, int] = {}
    location, side = [], []
    for s in sockets:
        number = seen.setdefault(s.location, 0)
        if number > 1:
            raise InputError(f'location "{s.location}" has more than two sockets: give each base its own location')
        seen[s.location] += 1
        location += [places.index(s.location)] * len(s.joints_rad)
        side += [number] * len(s.joints_rad)
    return ClosureProblem(
        robot,
        np.concatenate([s.joints_rad for s in sockets]),
        np.array(location, dtype=np.intp),
        np.array(side, dtype=np.intp),
        np.array([seen[place] == 2 for place in places]),
        distance_mm,
        seat_mm,
        robot.uncertainty.joint_sigma_rad,
        np.column_stack([rows, columns]),
        sigma[rows, columns],
    )


def solve_closure(problem: ClosureProblem, estimated: Mask) -> ClosureFit:
    """Levenberg-Marquardt over tool, sockets and the ``estimated`` (P,) robot parameters."""
    p = problem
    tool, values = np.zeros(3), np.zeros(len(p.prior_sigma))
    sockets = socket_means(p, positions(p.robot, p.joints_rad, tool))
    sigma = np.concatenate([np.full(3, np.inf), p.prior_sigma])
    free = np.concatenate([np.ones(3, dtype=bool), estimated])
    prior = np.where(free, sigma, 0.0)
    damping, converged, weight = 0.0, False, np.ones(len(p.location))
    for i in range(_MAX_ITERATIONS):
        if i >= _PLAIN_ITERATIONS and damping == 0:
            weight = _robust_weights(_rows(p, tool, sockets, values, free, np.ones_like(weight)))
        rows = _rows(p, tool, sockets, values, free, weight)
        normal = with_prior(rows.normal, prior, np.concatenate([np.zeros(3), values]))
        step = solve(normal, free, damping)
        moved = (tool + step.common[:3], sockets + step.jigs.reshape(-1, 2, 3), values + step.common[3:])
        worse = _cost(p, rows.white, *moved) > _cost(p, rows.white, tool, sockets, values) * (1 + 1e-12)
        if worse and step.decrement > 1e-14:
            damping = max(10 * damping, 1e-4)
            continue
        tool, sockets, values = moved
        damping /= 10
        damping = damping if damping > 1e-8 else 0.0
        if step.decrement < _TOLERANCE and i > _PLAIN_ITERATIONS:
            converged = True
            break
    return _fit(p, tool, sockets, values, free, prior, weight, converged)


def positions(robot: RobotModel, joints_rad: Array, tool_mm: Array) -> Array:
    """Places (N, 3) [mm] of the tool's point in the base."""
    return robot.hand_pose(joints_rad) @ tool_mm


def socket_means(p: ClosureProblem, points_mm: Array) -> Array:
    """Mean point (L, 2, 3) of each location's two sockets, zero where there is none."""
    out = np.zeros((len(p.paired), 2, 3))
    for k in range(len(out)):
        for side in range(2 if p.paired[k] else 1):
            out[k, side] = points_mm[(p.location == k) & (p.side == side)].mean(axis=0)
    return out


@dataclass(frozen=True, eq=False)
class _Rows:
    normal: Normal
    white: Array
    log_determinant: float
    residual: Array
    distance: Array


def corrected(problem: ClosureProblem, values: Array) -> RobotModel:
    """The robot with its corrections (P,)."""
    delta = np.zeros((5, problem.robot.n_joints))
    delta[problem.parameters[:, 0], problem.parameters[:, 1]] = values
    return problem.robot.corrected(delta)


def _rows(p: ClosureProblem, tool: Array, sockets: Array, values: Array, free: Mask, weight: Array) -> _Rows:
    """Whitened normal equations: every configuration's closure, and the known distances."""
    robot = corrected(p, values)
    hand = robot.hand_pose(p.joints_rad)
    to_point = np.concatenate([hand.R, -hand.R @ skew(np.broadcast_to(tool, hand.t.shape))], -1)  # (N, 3, 6)
    joints = to_point @ robot.joint_jacobian(p.joints_rad)
    covariance = p.seat_mm**2 * np.eye(3) + p.joint_rad**2 * joints @ np.swapaxes(joints, -1, -2)
    white = np.linalg.inv(np.linalg.cholesky(covariance)) * np.sqrt(weight)[:, None, None]
    moved = to_point @ robot.stacked_jacobian(p.joints_rad)[:, :, p.parameters[:, 0], p.parameters[:, 1]]
    residual = hand @ tool - sockets[p.location, p.side]
    a = white @ np.concatenate([hand.R, moved], -1) * free
    r = (white @ residual[..., None])[..., 0]
    places = np.zeros((len(r), 3, 6))
    for side in (0, 1):
        places[p.side == side, :, 3 * side : 3 * side + 3] = -white[p.side == side]
    at = (np.arange(len(sockets))[:, None] == p.location).astype(float)
    count, c = len(sockets), a.shape[-1]
    cross = (at @ (np.swapaxes(a, -1, -2) @ places).reshape(len(r), -1)).reshape(count, c, 6)
    own = (at @ (np.swapaxes(places, -1, -2) @ places).reshape(len(r), -1)).reshape(count, 6, 6)
    gradient = at @ np.einsum("nij,ni->nj", places, r)
    distance, along = _distances(p, sockets)
    own += along[:, :, None] * along[:, None, :] + np.eye(6) * (1e-12 + (~p.paired)[:, None, None] * _LONE)
    gradient += along * distance[:, None]
    flat = a.reshape(-1, c)
    normal = Normal(flat.T @ flat, cross, own, flat.T @ r.reshape(-1), gradient)
    determinant = -2 * np.sum(np.log(np.diagonal(white, axis1=1, axis2=2)))
    return _Rows(normal, white, float(determinant), residual, np.linalg.norm(r, axis=1))


def _robust_weights(rows: _Rows) -> Array:
    """Cauchy weights (N,) on the whitened distances, in units of their own median."""
    scale = np.median(rows.distance) / _CHI3_MEDIAN
    return np.asarray(1 / (1 + (rows.distance / (_CAUCHY * scale)) ** 2))


def _cost(p: ClosureProblem, white: Array, tool: Array, sockets: Array, values: Array) -> float:
    residual = positions(corrected(p, values), p.joints_rad, tool) - sockets[p.location, p.side]
    r = (white @ residual[..., None]).ravel()
    prior = values / np.where(p.prior_sigma > 0, p.prior_sigma, 1.0)
    distance, _ = _distances(p, sockets)
    return float(r @ r + prior @ prior + distance @ distance)


def _distances(p: ClosureProblem, sockets: Array) -> tuple[Array, Array]:
    """Whitened residual (L,) of the known distances and its gradient (L, 6), zero where there is none."""
    if p.distance_mm is None:
        return np.zeros(len(sockets)), np.zeros((len(sockets), 6))
    between = sockets[:, 1] - sockets[:, 0]
    length = np.linalg.norm(between, axis=1)
    known = p.paired / _DISTANCE_SIGMA_MM
    unit = between / np.maximum(length, 1e-9)[:, None]
    return (length - p.distance_mm) * known, np.concatenate([-unit, unit], 1) * known[:, None]


def _fit(
    p: ClosureProblem,
    tool: Array,
    sockets: Array,
    values: Array,
    free: Mask,
    prior: Array,
    weight: Array,
    converged: bool,
) -> ClosureFit:
    rows = _rows(p, tool, sockets, values, free, weight)
    normal = with_prior(rows.normal, prior, np.concatenate([np.zeros(3), values]))
    information = reduced(normal)[0][np.ix_(free, free)]
    determinants = np.linalg.slogdet(information)[1] + np.sum(np.linalg.slogdet(normal.jigs)[1])
    priors = 2 * np.sum(np.log(p.prior_sigma[free[3:]]))
    evidence = _cost(p, rows.white, tool, sockets, values) + rows.log_determinant + determinants + priors
    rms = float(np.sqrt(np.mean(np.sum(rows.residual**2, axis=1))))
    dof = 3 * len(p.location) - 3 - 3 * (len(p.paired) + int(p.paired.sum()))
    chi2 = float(np.sum(rows.distance**2)) / max(dof, 1)
    covariance = np.asarray(np.linalg.inv(information)[:3, :3] * max(1.0, chi2), dtype=np.float64)
    robot = corrected(p, values)
    return ClosureFit(
        tool, sockets, robot, values, rows.residual, rms, float(evidence), covariance, chi2, weight, converged
    )
