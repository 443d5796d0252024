"""Each frame's own pose of the target: weighted least squares on that frame's points alone, next to the robot chain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import singledispatch

import numpy as np
from numpy.typing import NDArray

from calib.engine import solve_members
from calib.pose.fit import fit_pose
from geometry import (
    Block,
    Frame,
    Linearised,
    NoAnswerError,
    Pose,
    SheetPoints,
    State,
    Target,
    Unknowns,
    stack_poses,
)
from jig_cad import Jig

Array = NDArray[np.float64]

FULL = 5  # strings that determine a pose on their own


@dataclass(frozen=True, eq=False)
class SeenAlone:
    """The evidence of each frame's points alone: unknown is "pose", T_sensor_target, with a member for every frame."""

    points: SheetPoints
    target: Target

    def linearise(self, state: State) -> Linearised:
        """With the points' own covariance; a point that is absent has no weight and no residual."""
        T = state.pose("pose")
        found = self.target.predict(T, np.zeros(len(self.target.shape.sigma)), self.points)
        f, m, k = found.residual.shape
        cov = self.points.cov_mm2
        own = cov if found.by_point is None else found.by_point @ cov @ np.swapaxes(found.by_point, -1, -2)
        own = np.where(self.points.present[..., None, None], own, np.eye(k))
        covariance = np.zeros((f, m, k, m, k))
        i = np.arange(m)
        covariance[:, i, :, i, :] = np.swapaxes(own, 0, 1)
        jacobian = {"pose": found.by_motion.reshape(f, m * k, 6) @ T.adjoint}
        member = {"pose": np.arange(f)}
        return Linearised(found.residual.reshape(f, -1), jacobian, covariance.reshape(f, m * k, m * k), member)


def poses_alone(points: SheetPoints, target: Target, starts: Pose) -> tuple[Pose, NDArray[np.bool_]]:
    """T_sensor_target (F) next to the ``starts`` (F), and which of them converged."""
    names = tuple(str(i) for i in range(len(points)))
    unknowns = Unknowns((Block.pose("pose", names, free=target.freedom),))
    found = solve_members(SeenAlone(points, target), unknowns, State({"pose": starts}))
    return found.state.pose("pose"), found.converged


@singledispatch
def own_poses(target: Target, frames: Sequence[Frame], by_chain: Pose) -> dict[int, Pose]:
    """T_sensor_target of every frame whose points tell one, by its number; of a surface a single curve tells none.

    by_chain: (F) T_sensor_target by the robot.
    """
    return {}


@own_poses.register
def _(target: Jig, frames: Sequence[Frame], by_chain: Pose) -> dict[int, Pose]:
    """Of about equally likely ones the nearest to the chain's, which stands in where the points determine none."""
    lone = [f for f in frames if len(f.candidates) == 1 and len(set(f.axis.label)) >= FULL]
    out: dict[int, Pose] = {}
    if lone:
        points = SheetPoints.of([f.axis for f in lone], target.features)
        poses, converged = poses_alone(points, target, stack_poses([f.candidates[0] for f in lone]))
        out = {f.number: poses[i] for i, f in enumerate(lone) if converged[i]}
    for i, f in enumerate(frames):
        if f.number not in out:
            out[f.number] = _own_pose(f, target, by_chain[i])
    return out


def _own_pose(f: Frame, jig: Jig, by_chain: Pose) -> Pose:
    try:
        return fit_pose(f.axis, jig, by_chain).T_sensor_jig
    except NoAnswerError:
        return by_chain
