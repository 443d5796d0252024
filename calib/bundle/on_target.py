"""The evidence of a hand-eye calibration: points of the laser plane on a target, seen from the robot's hand."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle.hands import Hands
from calib.sensor_errors import SensorErrors
from geometry import Linearised, Pose, Prediction, SheetPoints, State, Target

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

_REMOVED = 1e8  # factor on the variance of a removed point


@dataclass(frozen=True, eq=False)
class OnTargetLinearised(Linearised):
    """As Linearised, with what outliers and noise are judged by.

    by_hand (F, r, 6): by ζ of T_base_hand·Exp(ζ). twists (F, 6, P): ζ by the robot's parameters. by_point
    (F, M, k, 2): of the target's prediction. offset (F, r): the residuals of all points; those of removed ones are 0 in
    ``residual``, and so are their Jacobians: a point a metre off would pull however small its weight.
    """

    by_hand: Array = field(default_factory=lambda: np.zeros((0, 0, 6)))
    twists: Array = field(default_factory=lambda: np.zeros((0, 6, 0)))
    by_point: Array | None = None
    offset: Array = field(default_factory=lambda: np.zeros((0, 0)))


@dataclass(frozen=True, eq=False)
class OnTarget:
    """Points of F frames on one target that stands at some locations, by the chain base – hand – sensor – target.

    Unknowns: "scp" T_hand_sensor, "robot" corrections of its parameters, "sensor" its own errors, ``shape_block`` the
    target's shape, and ``place_block`` T_base_target with a member for every location. T_sensor_target = (T_base_hand
    T_hand_sensor)⁻¹ T_base_target.

    Parameters
    ----------
    points : SheetPoints
    target : Target
    hands : Hands
    member : ndarray (F,) of int
        Whose copy of the place each frame sees.
    hand_noise : ndarray (F, 6, 6)
        Covariance of the hand's poses. It is common to a frame's points and ties them together; to first order this
        is the same as a hand pose per frame as an unknown with that prior.
    removed : ndarray (F, M) of bool
        Points that do not count.
    place_block, shape_block : str
        Names of its unknowns.
    frame : ndarray (F,) of int
        Which of all the bundle's frames these are.
    errors : SensorErrors or None
        What moves the points and their plane where the sensor is not what its file says.
    """

    points: SheetPoints
    target: Target
    hands: Hands
    member: Index
    hand_noise: Array
    removed: Mask
    place_block: str = "target"
    shape_block: str = "shape"
    frame: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    errors: SensorErrors | None = None

    def without(self, removed: Mask) -> OnTarget:
        """The term with other points (F, M) not counting."""
        return replace(self, removed=removed)

    def at_frames(self, index: Index, member: Index, frame: Index | None = None) -> OnTarget:
        """The term of the frames of ``index`` alone, whose members, and places among all frames, are numbered anew."""
        return replace(
            self,
            frame=np.arange(len(index), dtype=np.intp) if frame is None else frame,
            points=self.points[index],
            hands=self.hands[index],
            member=member,
            hand_noise=self.hand_noise[index],
            removed=self.removed[index],
        )

    def with_noise(self, point_scale: float, hand_noise: Array) -> OnTarget:
        """The term with the points' covariances times ``point_scale`` and hand poses of covariance (F, 6, 6).

        Points that do not count keep theirs: they have no residual, and would tell of a smaller scale.
        """
        scale = np.where(self.removed, 1.0, point_scale)[..., None, None]
        points = replace(self.points, cov_mm2=self.points.cov_mm2 * scale)
        return replace(self, points=points, hand_noise=hand_noise)

    def T_sensor_target(self, state: State) -> Pose:
        """The target's poses (F) in the sensor by the chain."""
        hand = self.hands.pose(state.vector("robot"))
        return (hand @ state.pose("scp")).inverse() @ state.pose(self.place_block)[self.member]

    def residual(self, state: State) -> Array:
        """Residuals (F, r) [mm]."""
        found = self._predicted(self.T_sensor_target(state), state)[0]
        f, m, k = found.residual.shape
        return found.residual.reshape(f, m * k)

    def linearise(self, state: State) -> OnTargetLinearised:
        """Residuals (F, r), their Jacobians, and their covariance with the hand's."""
        T = self.T_sensor_target(state)
        found, sheet = self._predicted(T, state)
        f, m, k = found.residual.shape
        in_sheet = found.by_motion.reshape(f, m * k, 6)
        twist = in_sheet if self.errors is None else in_sheet @ sheet.inverse().adjoint
        hand = -twist @ state.pose("scp").inverse().adjoint
        twists = self.hands.jacobian(state.vector("robot"))
        jacobian = {
            "scp": -twist,
            "robot": hand @ twists,
            self.place_block: twist @ T.adjoint,
            self.shape_block: found.by_shape.reshape(f, m * k, found.by_shape.shape[-1]),
        }
        if self.errors is not None:
            moved = self.errors.derivatives(self.points.yz_mm, state.vector("sensor"))
            jacobian["sensor"] = self.by_plane_and_points(in_sheet, found.by_point, *moved)
        member = {self.place_block: self.member}
        noise = self.covariance(found.by_point, hand)
        residual = offset = found.residual.reshape(f, m * k)
        gone = self.removed & self.points.present
        if np.any(gone):
            counts = np.repeat(~gone, k, axis=1)
            residual = offset * counts
            jacobian = {name: by * counts[..., None] for name, by in jacobian.items()}
        return OnTargetLinearised(residual, jacobian, noise, member, hand, twists, found.by_point, offset)

    def by_plane_and_points(self, in_sheet: Array, by_point: Array | None, twists: Array, motions: Array) -> Array:
        """Residuals (F, r, K) by what turns the plane's frame by ``twists`` (6, K) and moves points (F, M, 2, K) in it.

        in_sheet (F, r, 6): by a motion of the target in the plane's axes.
        """
        moved = -motions if by_point is None else by_point @ motions
        moved = np.where(self.points.present[..., None, None], moved, 0.0)
        return np.asarray(moved.reshape(*in_sheet.shape[:2], twists.shape[-1]) - in_sheet @ twists)

    def _predicted(self, T: Pose, state: State) -> tuple[Prediction, Pose]:
        """What the target at T_sensor_target (F) makes of the points in their plane, and T_sensor_sheet."""
        shape = state.vector(self.shape_block)
        if self.errors is None:
            return self.target.predict(T, shape, self.points), Pose.identity()
        seen = self.errors.seen(self.points.yz_mm, state.vector("sensor"))
        points = replace(self.points, yz_mm=seen.yz_mm)
        return self.target.predict(seen.T_sensor_sheet.inverse() @ T, shape, points), seen.T_sensor_sheet

    def relinearised(self, lin: OnTargetLinearised) -> OnTargetLinearised:
        """A linearisation of the same points with this term's noise."""
        return replace(lin, covariance=self.covariance(lin.by_point, lin.by_hand))

    def covariance(self, by_point: Array | None, by_hand: Array, hand_noise: Array | None = None) -> Array:
        """Covariance (F, r, r) of the residuals: of the points, inflated where removed, and of the hands' poses."""
        f, m = self.points.present.shape
        out = by_hand @ (self.hand_noise if hand_noise is None else hand_noise) @ np.swapaxes(by_hand, -1, -2)
        k = by_hand.shape[1] // m
        blocks = out.reshape(f, m, k, m, k)
        i = np.arange(m)
        own = self.point_covariance(by_point) * removal(self.removed)[..., None, None]
        blocks[:, i, :, i, :] += np.swapaxes(own, 0, 1)
        return out

    def point_covariance(self, by_point: Array | None) -> Array:
        """Covariance (F, M, k, k) [mm²] of each point's residuals by the point's own."""
        cov = self.points.cov_mm2
        if by_point is None:
            return cov
        out = by_point @ cov @ np.swapaxes(by_point, -1, -2)
        return np.asarray(np.where(self.points.present[..., None, None], out, np.eye(out.shape[-1])))


def removal(removed: Mask) -> Array:
    """Inflation (F, M) that takes the removed points out of the solution."""
    return np.where(removed, _REMOVED, 1.0)
