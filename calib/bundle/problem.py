"""The least-squares problem of all frames: which points on which target, which unknowns, which of them are free."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle.hands import Hands
from calib.bundle.on_target import OnTarget
from calib.bundle.sensor_errors import SensorErrors
from geometry import AxisPoints, Block, InputError, Pose, SheetPoints, State, Target, Unknowns

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

WITH_SENSOR = "+sensor"  # ends the name of a model that estimates the sensor's own errors, too


@dataclass(frozen=True, eq=False)
class Bundle:
    """Frames of one target kind, its unknowns, and the names of its locations.

    term: the evidence. unknowns: "scp", "robot", "shape", "sensor" and "target", the place at every location.
    """

    term: OnTarget
    unknowns: Unknowns

    @staticmethod
    def of(
        axes: Sequence[AxisPoints],
        locations: Sequence[str],
        target: Target,
        hands: Hands,
        names: Sequence[str] | None = None,
        errors: SensorErrors | None = None,
    ) -> Bundle:
        """The problem of labelled frames, nothing of robot and sensor estimated.

        names: of the locations in their order; by default that of their first frames. errors: of the sensor.
        """
        names = tuple(names or dict.fromkeys(locations))
        points = SheetPoints.of(axes, target.features)
        member = np.array([names.index(n) for n in locations], dtype=np.intp)
        term = OnTarget(points, target, hands, member, hands.noise, ~points.present, errors=errors)
        labels, sigma = ((), np.zeros(0)) if errors is None else (errors.labels, errors.sigma)
        unknowns = Unknowns(
            (
                Block.pose("scp"),
                Block.vector("robot", hands.sigma, free=False, labels=hands.labels),
                Block.vector("shape", target.shape.sigma, labels=target.shape.labels),
                Block.vector("sensor", sigma, free=False, labels=labels),
                Block.pose("target", names, free=target.freedom),
            )
        )
        return Bundle(term, unknowns)

    @property
    def hands(self) -> Hands:
        """The robot's hand in every frame."""
        return self.term.hands

    @property
    def target(self) -> Target:
        """What the points lie on."""
        return self.term.target

    @property
    def location(self) -> Index:
        """Which location (F,) every frame belongs to."""
        return self.term.member

    @property
    def locations(self) -> tuple[str, ...]:
        """Names of the locations."""
        return self.unknowns.block("target").members

    @property
    def estimated(self) -> Mask:
        """Which of the robot's parameters (P,) are estimated."""
        return self.unknowns.block("robot").free

    def estimating(self, robot: Mask, sensor: bool = False) -> Bundle:
        """The problem with the robot's parameters ``robot`` (P,) estimated, and the sensor's; the rest considered."""
        return replace(self, unknowns=self.unknowns.with_free(robot=robot, sensor=sensor))

    def knowing(self, **sigma: Array) -> Bundle:
        """The problem with other prior σ of some blocks' components; what becomes exact is fixed."""
        always = {"shape"}  # of the target, estimated in every model
        blocks = tuple(
            replace(b, sigma=s, free=(s > 0) & (b.free | (b.name in always)))
            if (s := sigma.get(b.name)) is not None
            else b
            for b in self.unknowns.blocks
        )
        return replace(self, unknowns=Unknowns(blocks))

    def of_target(self, target: Target) -> Bundle:
        """The problem with another description of the same target, its shape's priors included."""
        shape = Block.vector("shape", target.shape.sigma, labels=target.shape.labels)
        blocks = tuple(shape if b.name == "shape" else b for b in self.unknowns.blocks)
        return Bundle(replace(self.term, target=target), Unknowns(blocks))

    def of_sensor(self, errors: SensorErrors) -> Bundle:
        """The problem with other errors of the sensor, none of them estimated."""
        sensor = Block.vector("sensor", errors.sigma, free=False, labels=errors.labels)
        blocks = tuple(sensor if b.name == "sensor" else b for b in self.unknowns.blocks)
        return Bundle(replace(self.term, errors=errors), Unknowns(blocks))

    def with_noise(self, point_scale: float, hand_noise: Array) -> Bundle:
        """The problem with the points' covariances times ``point_scale`` and hand poses of covariance (F, 6, 6)."""
        return replace(self, term=self.term.with_noise(point_scale, hand_noise))

    def at_frames(self, chosen: Mask) -> Bundle:
        """The problem of the ``chosen`` frames (F,) alone, its locations numbered anew."""
        index = np.flatnonzero(chosen)
        kept, member = np.unique(self.location[index], return_inverse=True)
        names = tuple(self.locations[int(k)] for k in kept)
        blocks = tuple(replace(b, members=names) if b.members else b for b in self.unknowns.blocks)
        return Bundle(self.term.at_frames(index, member.astype(np.intp)), Unknowns(blocks))

    def start(self, T_hand_sensor: Pose, Ts_base_target: Pose) -> State:
        """The state with robot, shape and sensor as stated."""
        rest = {name: self.unknowns.block(name).at_rest() for name in ("robot", "shape", "sensor")}
        return State({"scp": T_hand_sensor, **rest, "target": Ts_base_target})

    def without(self, removed: Mask) -> Bundle:
        """The problem with the points ``removed`` (F, M) not counting, beside those that are absent."""
        return replace(self, term=self.term.without(removed | ~self.term.points.present))

    @property
    def degrees_of_freedom(self) -> int:
        """Residuals of the points that count, less the SCP and the places; what has a prior costs none."""
        place = int(np.sum(self.target.freedom)) * len(self.locations)
        return self.target.residuals_per_point * int((~self.term.removed).sum()) - 6 - place


def estimated_groups(model: str) -> Collection[str] | None:
    """Groups of the robot's parameters that a model estimates; None for all of them."""
    return {"scp": (), "scp+offsets": ("theta",), "full": None}[robot_part(model)]


def robot_part(model: str) -> str:
    """The model without what it estimates of the sensor."""
    return model.removesuffix(WITH_SENSOR)


def estimates_sensor(model: str) -> bool:
    """Whether a model estimates the sensor's own errors."""
    return model.endswith(WITH_SENSOR)


def estimated_parameters(hands: Hands, model: str) -> Mask:
    """Which of the robot's parameters (P,) a model estimates; InputError where there is no robot to correct."""
    groups = estimated_groups(model)
    if groups == ():
        return np.zeros(len(hands.groups), dtype=bool)
    if hands.poses_only or hands.inferred:
        raise InputError(
            f"model {model} corrects the robot's table and needs joint readings j1_deg …, but these frames give hand "
            "poses T_base_hand only: use model scp"
        )
    return np.array([groups is None or g in groups for g in hands.groups], dtype=bool)
