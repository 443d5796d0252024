"""The least-squares problem of all frames: which points on which targets, which unknowns, which of them are free."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from calib.bundle.evidence import Evidence
from calib.bundle.hands import Hands
from calib.bundle.on_target import OnTarget
from calib.sensor_errors import SensorErrors
from geometry import (
    AxisPoints,
    Block,
    InputError,
    Pose,
    Robot,
    SheetPoints,
    State,
    Target,
    Term,
    Unknowns,
    stack_poses,
    target_at,
)
from geometry.robot import GROUP as COMPLIANCE

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
_Number = TypeVar("_Number", bound=np.generic)

SENSOR = "sensor"  # part of the name of a model that estimates the sensor's own errors, too


@dataclass(frozen=True, eq=False)
class Bundle:
    """Frames of one hand and sensor on the targets of their locations, with all unknowns.

    terms: the evidence, one for every target. unknowns: "scp", "robot", "sensor", and for every target the block of its
    shape and that of its place at every location where it stood ("shape" and "target" of the first). hands: of all F
    frames. location (F,): which location each frame belongs to. locations: their names. evidence: what is known beside
    the points, whose unknowns are among those here.
    """

    terms: tuple[OnTarget, ...]
    unknowns: Unknowns
    hands: Hands
    location: Index
    locations: tuple[str, ...]
    evidence: tuple[Evidence, ...] = ()

    @staticmethod
    def of(
        axes: Sequence[AxisPoints],
        locations: Sequence[str],
        target: Target | Mapping[str, Target],
        hands: Hands,
        names: Sequence[str] | None = None,
        errors: SensorErrors | None = None,
    ) -> Bundle:
        """The problem of labelled frames, nothing of robot and sensor estimated.

        target: of all locations, or by location. names: of the locations in their order; by default that of their first
        frames. errors: of the sensor.
        """
        names = tuple(names or dict.fromkeys(locations))
        location = np.array([names.index(n) for n in locations], dtype=np.intp)
        stands = {name: target_at(target, name) for name in names}
        kinds = list({id(t): t for t in stands.values()}.values())
        terms: list[OnTarget] = []
        labels, sigma = ((), np.zeros(0)) if errors is None else (errors.labels, errors.sigma)
        blocks = [
            Block.pose("scp"),
            Block.vector("robot", hands.sigma, free=False, labels=hands.labels),
            Block.vector("sensor", sigma, free=False, labels=labels),
        ]
        for k, kind in enumerate(kinds):
            here = [n for n in names if stands[n] is kind]
            frame = np.array([i for i, n in enumerate(locations) if n in here], dtype=np.intp)
            points = SheetPoints.of([axes[i] for i in frame], kind.features)
            member = np.array([here.index(locations[i]) for i in frame], dtype=np.intp)
            own = hands if len(frame) == len(locations) else hands[frame]
            place, shape = ("target", "shape") if k == 0 else (f"target {k + 1}", f"shape {k + 1}")
            terms.append(OnTarget(points, kind, own, member, own.noise, ~points.present, place, shape, frame, errors))
            blocks.append(Block.vector(shape, kind.shape.sigma, labels=kind.shape.labels))
            blocks.append(Block.pose(place, tuple(here), free=kind.freedom))
        return Bundle(tuple(terms), Unknowns(tuple(blocks)), hands, location, names)

    def with_evidence(self, evidence: Sequence[Evidence]) -> Bundle:
        """The problem with what is known beside the points."""
        blocks = {b.name: b for e in evidence for b in e.blocks(self)}  # a tracker's frame is common to its points
        unknowns = Unknowns((*self.unknowns.blocks, *blocks.values()))
        return replace(self, unknowns=unknowns, evidence=tuple(evidence))

    @property
    def further(self) -> tuple[Term, ...]:
        """The terms of the evidence beside the points."""
        return tuple(t for e in self.evidence if (t := e.term(self)) is not None)

    @property
    def term(self) -> OnTarget:
        """The one term of a problem with one target; ValueError where there are several."""
        if len(self.terms) != 1:
            raise ValueError(f"the problem has {len(self.terms)} targets, and this is asked of one")
        return self.terms[0]

    @property
    def target(self) -> Target:
        """What the points lie on, where that is one target."""
        return self.term.target

    def target_at(self, location: str) -> Target:
        """What stood at a location."""
        return next(t.target for t in self.terms if location in self.unknowns.block(t.place_block).members)

    @property
    def errors(self) -> SensorErrors | None:
        """The sensor's own errors, the same for all targets."""
        return self.terms[0].errors

    @property
    def present(self) -> Mask:
        """Which points (F, M) there are; M is the largest number of points that a frame has."""
        return self.by_frame([t.points.present for t in self.terms])

    @property
    def hand_noise(self) -> Array:
        """Covariance (F, 6, 6) of the hand poses."""
        return self.by_frame([t.hand_noise for t in self.terms])

    @property
    def estimated(self) -> Mask:
        """Which of the robot's parameters (P,) are estimated."""
        return self.unknowns.block("robot").free

    @property
    def shape_blocks(self) -> tuple[str, ...]:
        """Names of the targets' shape blocks."""
        return tuple(t.shape_block for t in self.terms)

    @property
    def place_blocks(self) -> tuple[str, ...]:
        """Names of the targets' place blocks."""
        return tuple(t.place_block for t in self.terms)

    def by_frame(self, values: Sequence[NDArray[_Number]]) -> NDArray[_Number]:
        """What the terms say of their own frames, (F_k, …) each, for all frames (F, …), filled up with zeros."""
        if len(values) == 1:
            return values[0]
        shape = np.max([v.shape[1:] for v in values], axis=0)
        out = np.zeros((len(self.location), *shape), dtype=values[0].dtype)
        for term, value in zip(self.terms, values, strict=True):
            place: tuple[Index | slice, ...] = (term.frame, *(slice(n) for n in value.shape[1:]))
            out[place] = value
        return out

    def estimating(self, robot: Mask, sensor: bool = False) -> Bundle:
        """The problem with the robot's parameters ``robot`` (P,) estimated, and the sensor's; the rest considered."""
        return replace(self, unknowns=self.unknowns.with_free(robot=robot, sensor=sensor))

    def knowing(self, **sigma: Array) -> Bundle:
        """The problem with other prior σ of some blocks' components; what becomes exact is fixed."""
        always = set(self.shape_blocks)  # of the target, estimated in every model
        blocks = tuple(
            replace(b, sigma=s, free=(s > 0) & (b.free | (b.name in always)))
            if (s := sigma.get(b.name)) is not None
            else b
            for b in self.unknowns.blocks
        )
        return replace(self, unknowns=Unknowns(blocks))

    def of_target(self, target: Target) -> Bundle:
        """The problem with another description of its one target, the shape's priors included."""
        shape = Block.vector("shape", target.shape.sigma, labels=target.shape.labels)
        blocks = tuple(shape if b.name == "shape" else b for b in self.unknowns.blocks)
        return replace(self, terms=(replace(self.term, target=target),), unknowns=Unknowns(blocks))

    def of_sensor(self, errors: SensorErrors) -> Bundle:
        """The problem with other errors of the sensor, none of them estimated."""
        sensor = Block.vector("sensor", errors.sigma, free=False, labels=errors.labels)
        blocks = tuple(sensor if b.name == "sensor" else b for b in self.unknowns.blocks)
        terms = tuple(replace(t, errors=errors) for t in self.terms)
        return replace(self, terms=terms, unknowns=Unknowns(blocks))

    def of_robot(self, robot: Robot) -> Bundle:
        """The problem with another description of its robot, nothing of it estimated."""

        def known(hands: Hands) -> Hands:
            return replace(hands, robot=robot, _last={})

        hands = known(self.hands)
        block = Block.vector("robot", hands.sigma, free=False, labels=hands.labels)
        blocks = tuple(block if b.name == "robot" else b for b in self.unknowns.blocks)
        terms = tuple(replace(t, hands=known(t.hands)) for t in self.terms)
        return replace(self, terms=terms, unknowns=Unknowns(blocks), hands=hands)

    def with_noise(self, point_scale: float, hand_noise: Array) -> Bundle:
        """The problem with the points' covariances times ``point_scale`` and hand poses of covariance (F, 6, 6)."""
        return replace(self, terms=tuple(t.with_noise(point_scale, hand_noise[t.frame]) for t in self.terms))

    def at_frames(self, chosen: Mask) -> Bundle:
        """The problem of the ``chosen`` frames (F,) alone, its locations numbered anew."""
        index = np.flatnonzero(chosen)
        kept, location = np.unique(self.location[index], return_inverse=True)
        names = tuple(self.locations[int(k)] for k in kept)
        number = np.cumsum(chosen) - 1  # of the frames that stay
        terms: list[OnTarget] = []
        gone: set[str] = set()
        members: dict[str, tuple[str, ...]] = {}
        for t in self.terms:
            own = np.flatnonzero(chosen[t.frame])
            before = self.unknowns.block(t.place_block).members
            stay, member = np.unique(t.member[own], return_inverse=True)
            members[t.place_block] = tuple(before[int(k)] for k in stay)
            if len(own):
                terms.append(t.at_frames(own, member.astype(np.intp), number[t.frame[own]].astype(np.intp)))
            else:
                gone |= {t.place_block, t.shape_block}
        gone |= {b.name for e in self.evidence for b in e.blocks(self)}
        blocks = (b for b in self.unknowns.blocks if b.name not in gone)
        unknowns = Unknowns(tuple(replace(b, members=members[b.name]) if b.members else b for b in blocks))
        alone = Bundle(tuple(terms), unknowns, self.hands[index], location.astype(np.intp), names)
        return alone.with_evidence(self.evidence) if self.evidence else alone

    def start(self, T_hand_sensor: Pose, Ts_base_target: Pose) -> State:
        """The state with robot, shapes and sensor as stated; Ts_base_target (L): places in ``locations``' order."""
        rest = {name: self.unknowns.block(name).at_rest() for name in ("robot", "sensor", *self.shape_blocks)}
        state = self.with_places(State({"scp": T_hand_sensor, **rest}), Ts_base_target)
        begun: dict[str, Pose | Array] = {}
        for e in self.evidence:
            begun = e.start(self, state) | begun
        return State({**state.values, **begun})

    def with_places(self, state: State, Ts_base_target: Pose) -> State:
        """The state with the places (L) of all locations, and of the rest what the problem has."""
        state = State({name: value for name, value in state.values.items() if name in self.unknowns})
        for name in self.place_blocks:
            index = np.array([self.locations.index(m) for m in self.unknowns.block(name).members], dtype=np.intp)
            alone = len(self.terms) == 1  # of one target the places stand in the order of the locations
            state = state.with_value(name, Ts_base_target if alone else Ts_base_target[index])
        return state

    def places(self, state: State) -> Pose:
        """T_base_target (L) of all locations."""
        if len(self.terms) == 1:
            return state.pose(self.terms[0].place_block)
        found: dict[str, Pose] = {}
        for name in self.place_blocks:
            poses = state.pose(name)
            found |= {m: poses[k] for k, m in enumerate(self.unknowns.block(name).members)}
        return stack_poses([found[n] for n in self.locations])

    def with_axes(self, axes: Sequence[AxisPoints]) -> Bundle:
        """The problem with other points of the same frames (F)."""
        terms = []
        for t in self.terms:
            points = SheetPoints.of([axes[i] for i in t.frame], t.target.features)
            terms.append(replace(t, points=points, removed=~points.present))
        return replace(self, terms=tuple(terms))

    def without(self, removed: Mask) -> Bundle:
        """The problem with the points ``removed`` (F, M) not counting, beside those that are absent."""
        terms = []
        for t in self.terms:
            there = t.points.present
            terms.append(t.without(removed[t.frame][:, : there.shape[1]] | ~there))
        return replace(self, terms=tuple(terms))

    @property
    def degrees_of_freedom(self) -> int:
        """Residuals of the points that count, less the SCP and the places; what has a prior costs none."""
        out = -6
        for t in self.terms:
            free = int(np.sum(t.target.freedom)) * len(self.unknowns.block(t.place_block).members)
            shape = self.unknowns.block(t.shape_block)
            unknown = int(np.sum(shape.free & ~np.isfinite(shape.sigma)))
            out += t.target.residuals_per_point * int((~t.removed).sum()) - free - unknown
        return out + sum(e.freedom(self) for e in self.evidence)


def estimated_groups(model: str) -> Collection[str] | None:
    """Groups of the robot's table that a model estimates; None for all of them."""
    return {"scp": (), "scp+offsets": ("theta",), "full": None, "auto": None}[robot_part(model)]


def robot_part(model: str) -> str:
    """The model without what it estimates of the sensor and of compliance."""
    return "+".join(p for p in model.split("+") if p not in (SENSOR, COMPLIANCE))


def estimates_sensor(model: str) -> bool:
    """Whether a model estimates the sensor's own errors."""
    return SENSOR in model.split("+")


def estimates_compliance(model: str) -> bool:
    """Whether a model estimates how joints give way under gravity."""
    return COMPLIANCE in model.split("+")


def estimated_parameters(hands: Hands, model: str) -> Mask:
    """Which of the robot's parameters (P,) a model estimates; InputError where there is no robot to correct."""
    groups = estimated_groups(model)
    if groups == () and not estimates_compliance(model):
        return np.zeros(len(hands.groups), dtype=bool)
    if hands.poses_only:
        raise InputError(
            f"model {model} corrects the robot's table and needs joint readings j1_deg …, but these frames give hand "
            "poses T_base_hand only: use model scp"
        )
    bends = estimates_compliance(model)
    wanted = [bends if g == COMPLIANCE else groups is None or g in groups for g in hands.groups]
    return np.array(wanted, dtype=bool)
