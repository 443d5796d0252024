"""What configurations would tell about the SCP: information by frame, and the covariance that sets of them predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.bundle.problem import Bundle
from calib.engine import GroupNormals, considered_covariance, group_normals
from geometry import Pose, Unknowns

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Model = Literal["scp", "full"]

WEAK_SCP = np.array([100.0] * 3 + [1.0] * 3)  # σ [mm, rad] known before anything is measured, so that few frames count
WEAK_PLACE = np.array([1000.0] * 3 + [3.0] * 3)  # the same of the target's place


@dataclass(frozen=True, eq=False)
class FrameInformation:
    """What every frame alone says of the common unknowns and of its target's place.

    groups: the normal equations by frame, the location as member. unknowns: which are estimated, which considered.
    """

    groups: GroupNormals
    unknowns: Unknowns

    @property
    def location(self) -> Index:
        """Which location (F,) each frame belongs to."""
        return self.groups.member

    def followed_by(self, other: FrameInformation) -> FrameInformation:
        """These frames and then the ``other`` ones, of the same unknowns."""
        return FrameInformation(self.groups.followed_by(other.groups), self.unknowns)

    def __getitem__(self, index: Index) -> FrameInformation:
        """The frames of ``index``."""
        return FrameInformation(self.groups[index], self.unknowns)


def frame_information(
    bundle: Bundle, T_hand_sensor: Pose, Ts_base_target: Pose, model: Model = "scp"
) -> FrameInformation:
    """The information of the problem's frames, linearised at the SCP and places (L) given."""
    robot = bundle.estimating(np.full(len(bundle.estimated), model == "full"))
    weakly = {"scp": WEAK_SCP, "target": WEAK_PLACE}
    blocks = tuple(replace(b, sigma=weakly[b.name]) if b.name in weakly else b for b in robot.unknowns.blocks)
    lin = robot.term.linearise(robot.start(T_hand_sensor, Ts_base_target))
    return FrameInformation(group_normals(Unknowns(blocks), lin), Unknowns(blocks))


def scp_covariance(info: FrameInformation, chosen: Sequence[int] | Index, *, noise_alone: bool = False) -> Array:
    """Covariance (6, 6) of the SCP, sensor axes [mm, rad], from the ``chosen`` frames; robot errors considered.

    noise_alone: without the robot's own errors, which no choice of views averages out entirely.
    """
    index = np.asarray(chosen, dtype=np.intp)
    return np.asarray(_covariance(info, _reduced(info, index)[None], noise_alone)[0])


def covariances_with(info: FrameInformation, base: Index, candidates: Index, *, noise_alone: bool = False) -> Array:
    """Covariances (N, 6, 6) of the SCP from the ``base`` frames and one of the ``candidates`` (N), all of one place."""
    here = info.location[base] == info.location[candidates[0]]
    mine, others, every = info.groups[base[here]], base[~here], info.groups[candidates]
    common = _reduced(info, others) + mine.common.sum(axis=0) + every.common
    cross = mine.cross.sum(axis=0) + every.cross
    own = mine.own.sum(axis=0) + every.own
    return _covariance(info, common - _place_part(info, cross, own), noise_alone)


def _reduced(info: FrameInformation, index: Index) -> Array:
    """Information (C, C) of the common unknowns once the places are eliminated, without priors."""
    groups = info.groups[index]
    schur = np.asarray(groups.common.sum(axis=0))
    for place in np.unique(groups.member):
        here = groups[np.flatnonzero(groups.member == place)]
        schur = schur - _place_part(info, here.cross.sum(axis=0), here.own.sum(axis=0))
    return schur


def _place_part(info: FrameInformation, cross: Array, own: Array) -> Array:
    """What an unknown place of the target takes from the common unknowns' information (..., C, C)."""
    place = info.unknowns.block("target")
    free = np.flatnonzero(place.free)
    cross, own = cross[..., free], own[..., free[:, None], free] + np.diag(place.sigma[free] ** -2.0)
    return np.asarray(cross @ np.linalg.solve(own, np.swapaxes(cross, -1, -2)))


def _covariance(info: FrameInformation, schur: Array, noise_alone: bool) -> Array:
    """The SCP's covariances (N, 6, 6) of reduced information (N, C, C)."""
    u = info.unknowns
    free, considered = np.flatnonzero(u.free), np.flatnonzero(u.considered)
    noise = np.asarray(np.linalg.inv(schur[:, free[:, None], free] + np.diag(u.sigma[free] ** -2.0)))
    coupling = schur[:, free[:, None], considered]
    total = noise if noise_alone else considered_covariance(noise, coupling, u.sigma[considered])
    scp = np.searchsorted(free, u.indices("scp"))
    return np.asarray(total[:, scp[:, None], scp])


def scaled(covariance: Array, lever_mm: float) -> Array:
    """The covariance (..., 6, 6) with rotations as the millimetres that they move a point ``lever_mm`` away."""
    scale = np.array([1.0, 1.0, 1.0, lever_mm, lever_mm, lever_mm])
    return np.asarray(covariance * np.outer(scale, scale))


def observability(covariance: Array, frames: int) -> dict[str, float]:
    """The indices O1 … O5 of the literature, of the singular values of the whitened, scaled SCP Jacobian.

    covariance: scaled. Source: Borm & Menq (O1), Driels & Pathre (O2), Nahvi et al. (O3, O4), Sun & Hollerbach (O5).
    """
    s = 1 / np.sqrt(np.linalg.eigvalsh(covariance))
    return {
        "O1": float(np.exp(np.mean(np.log(s))) / np.sqrt(frames)),
        "O2": float(s.min() / s.max()),
        "O3": float(s.min()),
        "O4": float(s.min() ** 2 / s.max()),
        "O5": float(1 / np.sum(1 / s)),
    }
