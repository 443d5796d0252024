"""More evidence beside the sensor's points: a tracker's positions of a point on the hand, a tool seated in sockets,
known distances between targets. Each is one Term with the unknowns that it brings.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from geometry import Block, InputError, Linearised, Pose, Robot, State, Term, nearest_rotation, skew
from geometry.robot import arm_of

if TYPE_CHECKING:
    from calib.bundle.problem import Bundle

Array = NDArray[np.float64]
Index = NDArray[np.intp]

TRACKER_SIGMA_MM = 0.05  # of a laser tracker's point at some metres, and of what holds the reflector
SEAT_SIGMA_MM = 0.02  # of a ball in its socket, per axis
DISTANCE_SIGMA_MM = 0.02  # of a distance that was measured or milled
_TIE_MM = 1e-4  # by which a distance's ends may leave their targets: nothing, in the units of any σ here
_START_ROUNDS = 60  # of turning the tracker's frame and placing the point in turn
_FEWEST = 4  # positions: a tracker's frame and its point have nine unknowns


class Evidence(Protocol):
    """What is known beside the points: its unknowns, where they begin, and its term in a problem.

    All three hang on the bundle alone; a bundle that lacks what the evidence speaks of (a location) gives no term.
    """

    def blocks(self, bundle: Bundle) -> tuple[Block, ...]:
        """The unknowns that it brings."""

    def start(self, bundle: Bundle, state: State) -> dict[str, Pose | Array]:
        """Where they begin, at a state of all others."""

    def term(self, bundle: Bundle) -> Term | None:
        """Its term."""

    def freedom(self, bundle: Bundle) -> int:
        """Residuals less unknowns."""

    @property
    def rows(self) -> int:
        """How many positions, readings or distances it has."""

    def called(self, group: int) -> str:
        """What a group of its term's residuals is called in a sentence."""

    def without(self, group: int) -> Evidence | None:
        """The same less the row of that group; None where the rest would tell nothing."""


@dataclass(frozen=True, eq=False)
class _Carried:
    """A point on the hand at readings (N, n), by the robot's parameters: where it is, how that moves and scatters."""

    robot: Robot
    joints_rad: Array

    def at(self, point: Array, values: Array) -> tuple[Array, Array, Array, Array]:
        """Points (N, 3) in the base, derivatives by the point (N, 3, 3) and the robot (N, 3, P), and covariance."""
        hand = self.robot.pose(self.joints_rad, values)
        by_hand = np.concatenate([hand.R, -hand.R @ skew(np.broadcast_to(point, hand.t.shape))], -1)  # (N, 3, 6)
        noise = by_hand @ self.robot.joint_noise(self.joints_rad, values) @ np.swapaxes(by_hand, -1, -2)
        return hand @ point, hand.R, by_hand @ self.robot.parameter_jacobian(self.joints_rad, values), noise


@dataclass(frozen=True, eq=False)
class TrackedPoint:
    """Positions (N, 3) [mm] of a point on the hand, in the frame of the tracker or measuring machine that saw it.

    Unknown beside the robot: T_tracker_base, common to all points of one ``tracker``, and the point in the hand. row
    (N,): which of the file's rows each is, from 0; by default all of them in order.
    """

    name: str
    joints_rad: Array
    xyz_mm: Array
    sigma_mm: float = TRACKER_SIGMA_MM
    tracker: str = "tracker"
    row: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def __post_init__(self) -> None:
        """InputError where there are too few positions."""
        if len(self.joints_rad) != len(self.xyz_mm) or len(self.xyz_mm) < _FEWEST:
            raise InputError(
                f"tracked point {self.name}: {len(self.xyz_mm)} positions; {_FEWEST} or more are needed, one a reading"
            )
        if len(self.row) != len(self.xyz_mm):
            object.__setattr__(self, "row", np.arange(len(self.xyz_mm)))

    @property
    def _point(self) -> str:
        return f"{self.tracker}: {self.name}"

    def blocks(self, bundle: Bundle) -> tuple[Block, ...]:
        """See Evidence."""
        return (Block.pose(self.tracker), Block.vector(self._point, np.full(3, np.inf)))

    def start(self, bundle: Bundle, state: State) -> dict[str, Pose | Array]:
        """By turns: the rigid motion onto the positions, and the point that best explains them."""
        hand = arm_of(bundle.hands.robot).pose(self.joints_rad, state.vector("robot"))
        point: Array = np.zeros(3)
        frame = Pose.identity()
        for _ in range(_START_ROUNDS):
            frame = _onto(hand @ point, self.xyz_mm)
            in_base = frame.inverse() @ self.xyz_mm
            rows = hand.R.reshape(-1, 3)
            point = np.asarray(np.linalg.lstsq(rows, (in_base - hand.t).reshape(-1), rcond=1e-9)[0], dtype=float)
        return {self.tracker: frame, self._point: point}

    def term(self, bundle: Bundle) -> Term:
        """See Evidence."""
        return _Tracked(_Carried(arm_of(bundle.hands.robot), self.joints_rad), self, self._point)

    def freedom(self, bundle: Bundle) -> int:
        """See Evidence."""
        return 3 * len(self.xyz_mm) - 9

    @property
    def rows(self) -> int:
        """See Evidence."""
        return len(self.row)

    def called(self, group: int) -> str:
        """See Evidence."""
        return f"position {self.row[group] + 1} of the tracked point {self.name}"

    def without(self, group: int) -> TrackedPoint | None:
        """See Evidence."""
        if len(self.row) <= _FEWEST:
            return None
        stays = np.arange(len(self.row)) != group
        return replace(self, joints_rad=self.joints_rad[stays], xyz_mm=self.xyz_mm[stays], row=self.row[stays])


@dataclass(frozen=True, eq=False)
class _Tracked:
    carried: _Carried
    seen: TrackedPoint
    point: str

    def linearise(self, state: State) -> Linearised:
        """T_tracker_base · T_base_hand · p less the position measured."""
        frame = state.pose(self.seen.tracker)
        at, by_point, by_robot, noise = self.carried.at(state.vector(self.point), state.vector("robot"))
        R = frame.R
        by_frame = np.concatenate([np.broadcast_to(R, (len(at), 3, 3)), -R @ skew(at)], -1)
        jacobian = {self.seen.tracker: by_frame, self.point: R @ by_point, "robot": R @ by_robot}
        covariance = R @ noise @ R.T + self.seen.sigma_mm**2 * np.eye(3)
        return Linearised(frame @ at - self.seen.xyz_mm, jacobian, covariance)


@dataclass(frozen=True, eq=False)
class SeatedTool:
    """A ball on the hand seated in sockets that stand still: readings (N, n), and which socket (N,) each is in.

    Unknown beside the robot: the ball in the hand, and every socket in the base. row (N,): which of its socket's rows
    in the file each is, from 0; by default all of them in order.
    """

    joints_rad: Array
    socket: Index
    names: tuple[str, ...]
    sigma_mm: float = SEAT_SIGMA_MM
    row: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))

    def __post_init__(self) -> None:
        """InputError where the readings tell nothing."""
        for k, name in enumerate(self.names):
            if np.sum(self.socket == k) < 2:
                raise InputError(f"socket {name}: one reading tells nothing of the robot; two or more are needed")
        if len(self.row) != len(self.socket):
            before = [int(np.sum(self.socket[:k] == s)) for k, s in enumerate(self.socket)]
            object.__setattr__(self, "row", np.array(before, dtype=np.intp))

    def blocks(self, bundle: Bundle) -> tuple[Block, ...]:
        """See Evidence."""
        return (Block.vector("ball", np.full(3, np.inf)), Block.vector("sockets", np.full(3 * len(self.names), np.inf)))

    def start(self, bundle: Bundle, state: State) -> dict[str, Pose | Array]:
        """By least squares: with the robot held, ball and sockets are linear."""
        hand = arm_of(bundle.hands.robot).pose(self.joints_rad, state.vector("robot"))
        rows = np.concatenate([hand.R, -self._in_socket()], -1).reshape(3 * len(hand), -1)
        solved = np.linalg.lstsq(rows, -hand.t.reshape(-1), rcond=1e-9)[0]
        return {"ball": solved[:3], "sockets": solved[3:]}

    def term(self, bundle: Bundle) -> Term:
        """See Evidence."""
        return _Seated(_Carried(arm_of(bundle.hands.robot), self.joints_rad), self, self._in_socket())

    def freedom(self, bundle: Bundle) -> int:
        """See Evidence."""
        return 3 * len(self.joints_rad) - 3 - 3 * len(self.names)

    @property
    def rows(self) -> int:
        """See Evidence."""
        return len(self.row)

    def called(self, group: int) -> str:
        """See Evidence."""
        return f"reading {self.row[group] + 1} of socket {self.names[int(self.socket[group])]}"

    def without(self, group: int) -> SeatedTool | None:
        """See Evidence. A socket that is left with one reading goes with it."""
        stays = np.arange(len(self.socket)) != group
        alone = [k for k in range(len(self.names)) if np.sum(self.socket[stays] == k) < 2]
        stays &= ~np.isin(self.socket, alone)
        if not np.any(stays):
            return None
        names = tuple(n for k, n in enumerate(self.names) if k not in alone)
        number = np.cumsum([k not in alone for k in range(len(self.names))]) - 1
        socket = number[self.socket[stays]].astype(np.intp)
        return replace(self, joints_rad=self.joints_rad[stays], socket=socket, names=names, row=self.row[stays])

    def _in_socket(self) -> Array:
        """Derivatives (N, 3, 3 S) of each reading's socket by all sockets."""
        out = np.zeros((len(self.socket), 3, len(self.names), 3))
        out[np.arange(len(self.socket)), :, self.socket] = np.eye(3)
        return out.reshape(len(self.socket), 3, -1)


@dataclass(frozen=True, eq=False)
class _Seated:
    carried: _Carried
    seats: SeatedTool
    in_socket: Array

    def linearise(self, state: State) -> Linearised:
        """T_base_hand · ball less its socket."""
        at, by_point, by_robot, noise = self.carried.at(state.vector("ball"), state.vector("robot"))
        places = state.vector("sockets").reshape(-1, 3)[self.seats.socket]
        jacobian = {"ball": by_point, "robot": by_robot, "sockets": -self.in_socket}
        return Linearised(at - places, jacobian, noise + self.seats.sigma_mm**2 * np.eye(3))


@dataclass(frozen=True, eq=False)
class DistanceBetween:
    """The distance between the origins of the targets at two locations: of two balls on a bar, say."""

    first: str
    second: str
    distance_mm: float
    sigma_mm: float = DISTANCE_SIGMA_MM

    def __post_init__(self) -> None:
        """InputError where it is none."""
        if self.first == self.second:
            raise InputError(f"a distance between {self.first} and itself tells nothing")
        if not (self.distance_mm > 0 and self.sigma_mm > 0):
            raise InputError(f"the distance between {self.first} and {self.second} and its σ must be positive")

    @property
    def _ends(self) -> tuple[str, str]:
        return f"end at {self.first} of {self._name}", f"end at {self.second} of {self._name}"

    @property
    def _name(self) -> str:
        return f"{self.first} to {self.second}"

    def blocks(self, bundle: Bundle) -> tuple[Block, ...]:
        """Its ends in the base: a target's place is eliminated by itself, so what ties two is common."""
        return tuple(Block.vector(e, np.full(3, np.inf)) for e in self._ends) if self._there(bundle) else ()

    def start(self, bundle: Bundle, state: State) -> dict[str, Pose | Array]:
        """Where the targets are."""
        if not self._there(bundle):
            return {}
        places = bundle.places(state)
        where = (places.t[bundle.locations.index(n)] for n in (self.first, self.second))
        return dict(zip(self._ends, where, strict=True))

    def term(self, bundle: Bundle) -> Term | None:
        """See Evidence."""
        if not self._there(bundle):
            return None
        return _Apart(self, self._ends, tuple(self._place(bundle, n) for n in self._both))

    def freedom(self, bundle: Bundle) -> int:
        """See Evidence."""
        return int(self._there(bundle))

    @property
    def rows(self) -> int:
        """See Evidence."""
        return 1

    def called(self, group: int) -> str:
        """See Evidence."""
        return f"the distance from {self._name}"

    def without(self, group: int) -> None:
        """See Evidence: of one number nothing is left."""

    @property
    def _both(self) -> tuple[str, str]:
        return self.first, self.second

    def _there(self, bundle: Bundle) -> bool:
        return all(n in bundle.locations for n in self._both)

    def _place(self, bundle: Bundle, location: str) -> tuple[str, int]:
        """The block of a location's place, and which of its members it is."""
        for name in bundle.place_blocks:
            members = bundle.unknowns.block(name).members
            if location in members:
                return name, members.index(location)
        raise InputError(f"location {location} has no place")


@dataclass(frozen=True, eq=False)
class _Apart:
    known: DistanceBetween
    ends: tuple[str, str]
    places: tuple[tuple[str, int], ...]

    def linearise(self, state: State) -> Linearised:
        """Three groups: each end lies at its target's origin; the ends are as far apart as is known."""
        a, b = (state.vector(e) for e in self.ends)
        between = b - a
        length = float(np.linalg.norm(between))
        unit = between / max(length, 1e-9)
        residual, covariance = np.zeros((3, 3)), np.tile(np.eye(3) * _TIE_MM**2, (3, 1, 1))
        by_end = {e: np.zeros((3, 3, 3)) for e in self.ends}
        jacobian: dict[str, Array] = {}
        member = {name: np.zeros(3, dtype=np.intp) for name, _ in self.places}
        for k, (end, (name, index)) in enumerate(zip(self.ends, self.places, strict=True)):
            pose = state.pose(name)
            residual[k] = state.vector(end) - pose.t[index]
            by_end[end][k] = np.eye(3)
            by_place = jacobian.setdefault(name, np.zeros((3, 3, 6)))
            by_place[k, :, :3] = -pose.R[index]
            member[name][k] = index
        residual[2, 0] = length - self.known.distance_mm
        by_end[self.ends[0]][2, 0], by_end[self.ends[1]][2, 0] = -unit, unit
        covariance[2] = np.diag([self.known.sigma_mm**2, 1.0, 1.0])
        return Linearised(residual, {**by_end, **jacobian}, covariance, member)


def check_evidence(evidence: Sequence[Evidence], robot: Robot | None, joints: bool) -> None:
    """InputError where evidence of readings stands without a robot that they move."""
    for e in evidence:
        if isinstance(e, TrackedPoint | SeatedTool) and (robot is None or not joints):
            raise InputError(
                "[evidence] of readings (a tracker's positions, sockets) needs the robot's table and frames with joint "
                "readings: it tells of the robot, and without them there is none to be told of"
            )


def _onto(points: Array, goals: Array) -> Pose:
    """The rigid motion of points (N, 3) onto goals, by least squares."""
    a, b = points.mean(axis=0), goals.mean(axis=0)
    R = nearest_rotation((goals - b).T @ (points - a))
    return Pose(R, b - R @ a)
