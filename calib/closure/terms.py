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

from calib import engine
from calib.bundle import Hands
from geometry import Block, InputError, Linearised, Robot, State, Unknowns, skew, with_beta_prior

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_DISTANCE_SIGMA_MM = 0.02  # of a distance between two sockets that was measured or milled
_MAX_ITERATIONS = 80
_PLAIN_ITERATIONS = 6  # before the residuals say which configurations to trust
_TOLERANCE = 1e-4  # of a step, in σ
_CAUCHY = 4.0  # robust σ at which a configuration's weight is a half


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
    weight (N,): robust weights, 1 where a configuration is trusted. cost: squared residuals by the noise of seat,
    joints and distance, with the squared departures from the priors; chi2_per_dof: the same by its degrees of freedom.
    covariance (3 + P, 3 + P): of the tool's point and the robot's parameters, those that were not estimated with their
    priors; with the noise that the residuals show where the robot was estimated and chi2_per_dof is above 1. seat_mm: σ
    of the ball in its socket, likewise. distance_mm: of two sockets, with its σ where it was tried. learnt: how many of
    the robot's parameters the data replaced their priors of.
    evidence: minus twice the log marginal likelihood, comparable between priors and models on the same data.
    """

    tool_mm: Array
    sockets_mm: Array
    robot: Robot
    parameters: Array
    residual_mm: Array
    rms_mm: float
    evidence: float
    covariance: Array
    cost: float
    chi2_per_dof: float
    prior_sigma: Array
    weight: Array
    seat_mm: float
    distance_mm: tuple[float, float] | None
    learnt: float
    converged: bool

    @property
    def tool_covariance(self) -> Array:
        """Of the tool's point (3, 3) [mm²]."""
        return self.covariance[:3, :3]

    @property
    def pulls(self) -> Array:
        """How far the robot's parameters (P,) are from their priors' mean, in the priors' σ."""
        known = self.prior_sigma > 0
        return np.where(known, self.parameters / np.where(known, self.prior_sigma, 1.0), 0.0)


@dataclass(frozen=True, eq=False)
class Seated:
    """The evidence of N configurations: the tool's point sits in a socket of one base, within the seat's play.

    Unknown: "tool" (3,) in the hand, "robot", and "sockets" (L, 6), the places of each location's two sockets.
    location (N,), side (N,) 0 or 1: of each configuration's socket. seat_mm: σ of the ball in its socket, per axis.
    """

    hands: Hands
    location: Index
    side: Index
    seat_mm: float

    def linearise(self, state: State) -> Linearised:
        """The joints' noise moves the point as the hand's pose does."""
        tool, values, places = state.vector("tool"), state.vector("robot"), state.vector("sockets").reshape(-1, 2, 3)
        hand = self.hands.pose(values)
        by_hand = np.concatenate([hand.R, -hand.R @ skew(np.broadcast_to(tool, hand.t.shape))], -1)  # (N, 3, 6)
        noise = by_hand @ self.hands.robot.joint_noise(self.hands.readings, values) @ np.swapaxes(by_hand, -1, -2)
        sockets = np.zeros((len(hand), 3, 2, 3))
        sockets[np.arange(len(hand)), :, self.side] = -np.eye(3)
        jacobian = {
            "tool": hand.R,
            "robot": by_hand @ self.hands.jacobian(values),
            "sockets": sockets.reshape(-1, 3, 6),
        }
        member = {"sockets": self.location}
        residual = hand @ tool - places[self.location, self.side]
        return Linearised(residual, jacobian, noise + self.seat_mm**2 * np.eye(3), member)


@dataclass(frozen=True, eq=False)
class KnownDistance:
    """The evidence that the two sockets of each ``paired`` (L,) location are ``distance_mm`` apart.

    Unknown: "excess" (1,), what the distance is more than that, common to all, where it is tried; and "sockets".
    """

    paired: Mask
    distance_mm: float

    def linearise(self, state: State) -> Linearised:
        """No evidence where there is one socket alone."""
        places = state.vector("sockets").reshape(-1, 2, 3)
        between = places[:, 1] - places[:, 0]
        length = np.linalg.norm(between, axis=1)
        unit = between / np.maximum(length, 1e-9)[:, None] * self.paired[:, None]
        apart = self.distance_mm + state.vector("excess")[0]
        residual = ((length - apart) * self.paired)[:, None]
        variance = np.full((len(length), 1, 1), _DISTANCE_SIGMA_MM**2)
        jacobian = {
            "sockets": np.concatenate([-unit, unit], 1)[:, None, :],
            "excess": -1.0 * self.paired[:, None, None],
        }
        return Linearised(residual, jacobian, variance, {"sockets": np.arange(len(length))})


@dataclass(frozen=True, eq=False)
class ClosureProblem:
    """Configurations of the sockets of some locations, with what is known beforehand.

    paired (L,): locations with two sockets, ``distance_mm`` apart where that is known. prior_sigma (P,): of the robot.
    """

    seated: Seated
    places: tuple[str, ...]
    paired: Mask
    distance_mm: float | None
    prior_sigma: Array


def closure_problem(
    sockets: Sequence[Socket],
    robot: Robot,
    distance_mm: float | None,
    prior_scale: float,
    seat_mm: float,
    beta_sigma_rad: float = 0.0,
) -> ClosureProblem:
    """The problem of some sockets; the two sockets of a location that has two are ``distance_mm`` apart."""
    if len(sockets) == 0:
        raise InputError("no sockets were given: each needs the joint readings of at least three configurations")
    places = tuple(dict.fromkeys(s.location for s in sockets))
    seen: dict[str, int] = {}
    location, side = [], []
    for s in sockets:
        number = seen.setdefault(s.location, 0)
        if number > 1:
            raise InputError(f'location "{s.location}" has more than two sockets: give each base its own location')
        seen[s.location] += 1
        location += [places.index(s.location)] * len(s.joints_rad)
        side += [number] * len(s.joints_rad)
    hands = Hands(with_beta_prior(robot, beta_sigma_rad), np.concatenate([s.joints_rad for s in sockets]))
    seated = Seated(hands, np.array(location, dtype=np.intp), np.array(side, dtype=np.intp), seat_mm)
    paired = np.array([seen[place] == 2 for place in places])
    return ClosureProblem(seated, places, paired, distance_mm, prior_scale * hands.sigma)


def solve_closure(problem: ClosureProblem, estimated: Mask, free_distance: bool = False) -> ClosureFit:
    """Tool, sockets and the ``estimated`` (P,) robot parameters from all configurations, the trusted ones most.

    free_distance: the distance between two sockets is the same everywhere, but not known.
    """
    p = problem
    unknowns = Unknowns(
        (
            Block.vector("tool", np.full(3, np.inf)),
            Block.vector("robot", p.prior_sigma, free=estimated),
            Block.vector("excess", np.array([np.inf if free_distance else 0.0]), free=free_distance),
            Block.vector("sockets", np.full(6, np.inf), members=p.places),
        )
    )
    values = np.zeros(len(p.prior_sigma))
    sockets = socket_means(p, p.seated.hands.pose(values).t)
    start = State({"tool": np.zeros(3), "robot": values, "excess": np.zeros(1), "sockets": sockets.reshape(-1, 6)})
    known = [] if p.distance_mm is None else [KnownDistance(p.paired, p.distance_mm)]
    result = engine.solve(
        [p.seated, *known],
        unknowns,
        start,
        losses=[engine.cauchy(_CAUCHY), *(None for _ in known)],
        max_iterations=_MAX_ITERATIONS,
        tolerance=_TOLERANCE,
        plain_iterations=_PLAIN_ITERATIONS,
    )
    return _fit(p, result)


def positions(robot: Robot, joints_rad: Array, tool_mm: Array) -> Array:
    """Places (N, 3) [mm] of the tool's point in the base."""
    return robot.pose(joints_rad) @ tool_mm


def socket_means(p: ClosureProblem, points_mm: Array) -> Array:
    """Mean point (L, 2, 3) of each location's two sockets, zero where there is none."""
    out = np.zeros((len(p.paired), 2, 3))
    for k in range(len(out)):
        for side in range(2 if p.paired[k] else 1):
            out[k, side] = points_mm[(p.seated.location == k) & (p.seated.side == side)].mean(axis=0)
    return out


def predicted_covariance(fit: ClosureFit, joints_rad: Array) -> Array:
    """Covariance (3N, 3N) [mm²] of where the tool's point is, less its mean over readings (N, n) of one socket.

    Of tool and robot as the fit knows them, and of each configuration's own seat and joints.
    """
    n = len(joints_rad)
    hands = Hands(fit.robot, joints_rad)
    zero = np.zeros(len(fit.parameters))
    hand = hands.pose(zero)
    by_hand = np.concatenate([hand.R, -hand.R @ skew(np.broadcast_to(fit.tool_mm, hand.t.shape))], -1)
    J = np.concatenate([hand.R, by_hand @ hands.jacobian(zero)], -1)  # (N, 3, 3 + P)
    J = (J - J.mean(axis=0)).reshape(3 * n, -1)
    own = by_hand @ fit.robot.joint_noise(joints_rad, zero) @ np.swapaxes(by_hand, -1, -2)
    own += fit.seat_mm**2 * np.eye(3)
    noise = np.zeros((n, 3, n, 3))
    noise[np.arange(n), :, np.arange(n)] = own
    centre = np.kron(np.eye(n) - 1 / n, np.eye(3))
    return np.asarray(J @ fit.covariance @ J.T + centre @ noise.reshape(3 * n, 3 * n) @ centre)


def _fit(p: ClosureProblem, result: engine.Result) -> ClosureFit:
    state, residual, n = result.state, result.linearised[0].residual, len(p.seated.location)
    known = int(p.paired.sum()) if p.distance_mm is not None else 0
    freedom = 3 * n + known - 3 - 3 * (len(p.paired) + int(p.paired.sum()))  # what has a prior costs none
    chi2 = result.cost / max(freedom, 1)
    found = engine.covariance(result)
    i, j = result.unknowns["tool"], result.unknowns["robot"]
    index = np.r_[i, j]
    corrected = np.any(result.unknowns.block("robot").free)
    widened = max(1.0, chi2) if corrected else 1.0  # the nominal robot's misfit is no noise: its priors say it
    prior = np.where(p.prior_sigma > 0, p.prior_sigma, 1.0) ** 2
    replaced = 1 - np.diag(found.total)[j] / prior
    distance = None
    if p.distance_mm is not None:
        sigma = float(np.sqrt(found.of("excess")[0, 0] * max(1.0, chi2)))
        distance = p.distance_mm + float(state.vector("excess")[0]), sigma
    return ClosureFit(
        tool_mm=state.vector("tool"),
        sockets_mm=state.vector("sockets").reshape(-1, 2, 3),
        robot=p.seated.hands.robot.corrected(state.vector("robot")),
        parameters=state.vector("robot"),
        residual_mm=residual,
        rms_mm=float(np.sqrt(np.mean(np.sum(residual**2, axis=1)))),
        evidence=engine.evidence(result),
        covariance=found.total[np.ix_(index, index)] * widened,
        cost=result.cost,
        chi2_per_dof=chi2,
        prior_sigma=p.prior_sigma,
        weight=result.weights[0],
        seat_mm=p.seated.seat_mm * float(np.sqrt(widened)),
        distance_mm=distance,
        learnt=float(np.sum(replaced[p.prior_sigma > 0])) if corrected else 0.0,
        converged=result.converged,
    )
