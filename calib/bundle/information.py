"""What configurations would tell about the SCP: information by frame, and the covariance that sets of them predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.bundle.linearise import initial_state, linearise
from calib.bundle.problem import Problem
from calib.bundle.weights import frame_covariance, removal, whitener
from geometry import Pose

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Model = Literal["scp", "full"]

WEAK_SCP = np.array([100.0] * 3 + [1.0] * 3)  # σ [mm, rad] known before anything is measured, so that few frames count
WEAK_JIG = np.array([1000.0] * 3 + [3.0] * 3)


@dataclass(frozen=True, eq=False)
class FrameInformation:
    """Normal equations of every frame alone: common unknowns (C) = SCP 6, robot P, anchors 12; its jig's six.

    common (F, C, C), cross (F, C, 6), jigs (F, 6, 6), location (F,), prior_sigma (C,), estimated (C,): whether the
    model estimates it; what is not estimated is carried along as considered.
    """

    common: Array
    cross: Array
    jigs: Array
    location: Index
    prior_sigma: Array
    estimated: NDArray[np.bool_]

    def followed_by(self, other: FrameInformation) -> FrameInformation:
        """These frames and then the ``other`` ones, of the same unknowns."""
        return FrameInformation(
            np.concatenate([self.common, other.common]),
            np.concatenate([self.cross, other.cross]),
            np.concatenate([self.jigs, other.jigs]),
            np.concatenate([self.location, other.location]),
            self.prior_sigma,
            self.estimated,
        )

    def __getitem__(self, index: Index) -> FrameInformation:
        """The frames of ``index``."""
        common, cross, jigs = self.common[index], self.cross[index], self.jigs[index]
        return FrameInformation(common, cross, jigs, self.location[index], self.prior_sigma, self.estimated)


def frame_information(
    problem: Problem, T_hand_sensor: Pose, Ts_base_jig: Pose, model: Model = "scp"
) -> FrameInformation:
    """The information of the problem's frames, linearised at the SCP and jig poses (L) given."""
    lin = linearise(problem, initial_state(problem, T_hand_sensor, Ts_base_jig))
    white = whitener(frame_covariance(problem, lin, removal(~problem.points.present), problem.chain.noise))
    f, rows = white.shape[:2]
    moved = lin.hand.reshape(f, rows, 6) @ lin.parameters
    a = white @ np.concatenate([lin.scp.reshape(f, rows, 6), moved, lin.anchors.reshape(f, rows, 12)], -1)
    b = white @ lin.jig.reshape(f, rows, 6)
    a_t, b_t = np.swapaxes(a, -1, -2), np.swapaxes(b, -1, -2)
    sigma = np.concatenate([WEAK_SCP, problem.chain.parameter_sigma, np.full(12, problem.anchor_sigma_mm)])
    estimated = np.ones(len(sigma), dtype=bool)
    estimated[6:-12] = model == "full"
    estimated[-12:] = problem.anchor_sigma_mm > 0
    return FrameInformation(a_t @ a, a_t @ b, b_t @ b, problem.location, sigma, estimated)


def scp_covariance(info: FrameInformation, chosen: Sequence[int] | Index, *, noise_alone: bool = False) -> Array:
    """Covariance (6, 6) of the SCP, sensor axes [mm, rad], from the ``chosen`` frames; robot errors considered.

    noise_alone: without the robot's own errors, which no choice of views averages out entirely.
    """
    index = np.asarray(chosen, dtype=np.intp)
    return np.asarray(_covariance(info, _reduced(info, index)[None], noise_alone)[0])


def covariances_with(info: FrameInformation, base: Index, candidates: Index, *, noise_alone: bool = False) -> Array:
    """Covariances (N, 6, 6) of the SCP from the ``base`` frames and one of the ``candidates`` (N), all of one place."""
    here = info.location[base] == info.location[candidates[0]]
    mine, others = base[here], base[~here]
    common = _reduced(info, others) + info.common[mine].sum(axis=0) + info.common[candidates]
    cross = info.cross[mine].sum(axis=0) + info.cross[candidates]
    jigs = info.jigs[mine].sum(axis=0) + info.jigs[candidates]
    return _covariance(info, common - _jigs_part(cross, jigs), noise_alone)


def _reduced(info: FrameInformation, index: Index) -> Array:
    """Information (C, C) of the common unknowns once the jigs' places are eliminated, without priors."""
    schur = np.asarray(info.common[index].sum(axis=0))
    for place in np.unique(info.location[index]):
        here = index[info.location[index] == place]
        schur = schur - _jigs_part(info.cross[here].sum(axis=0), info.jigs[here].sum(axis=0))
    return schur


def _jigs_part(cross: Array, jigs: Array) -> Array:
    """What an unknown place of the jig takes from the common unknowns' information (..., C, C)."""
    jigs = jigs + np.diag(WEAK_JIG**-2.0)
    return np.asarray(cross @ np.linalg.solve(jigs, np.swapaxes(cross, -1, -2)))


def _covariance(info: FrameInformation, schur: Array, noise_alone: bool) -> Array:
    """The SCP's covariances (N, 6, 6) of reduced information (N, C, C)."""
    known = info.prior_sigma > 0
    weight = np.where(known, 1 / np.where(known, info.prior_sigma, 1.0) ** 2, 0.0)
    free, considered = np.flatnonzero(info.estimated), np.flatnonzero(~info.estimated & known)
    noise = np.linalg.inv(schur[:, free[:, None], free] + np.diag(weight[free]))
    if noise_alone or len(considered) == 0:
        return np.asarray(noise[:, :6, :6])
    bias = noise[:, :6] @ (schur[:, free[:, None], considered] * info.prior_sigma[considered])
    return np.asarray(noise[:, :6, :6] + bias @ np.swapaxes(bias, -1, -2))


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
