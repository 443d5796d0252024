"""How much better a labelling explains a frame's spots than clutter does: its pose, χ² and log evidence."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.label.gates import DETECTED
from calib.pose import PoseProblem, PoseSolution, departure, pencil_starts, solve_poses, whitening
from geometry import Pose
from geometry.ties import ascending, first_least_of_each
from jig_cad import Jig

Array = NDArray[np.float64]
IntArray = NDArray[np.intp]

FREE_SIGMA_MM, FREE_SIGMA_RAD = 150.0, 1.0  # where the jig may be when nothing is known
FACING_SIGMA_RAD = float(np.deg2rad(60.0))  # string A, the front of the pillar, mostly faces the sensor
END_MARGIN = 0.03  # share of its length by which a string may be crossed beyond its anchors
ITERATIONS = 15  # of the search among hypotheses, whose best is refined to the end afterwards
SAME_CHI2, SAME_NATS = 1e-6, 1e-6  # minima and labellings nearer than this are equal, and the first is taken


@dataclass(frozen=True, eq=False)
class Spots:
    """Spots as approximate axis points (N, 2), covariance (N, 2, 2), log odds of a string (N,), clutter per mm²."""

    yz_mm: Array
    cov_mm2: Array
    log_odds: Array
    density: float


@dataclass(frozen=True, eq=False)
class Prior:
    """A guess of T_sensor_jig and the covariance (6, 6) of ξ in T = guess · Exp(ξ)."""

    T_sensor_jig: Pose
    covariance: Array

    def chi2(self, T_sensor_jig: Pose) -> float:
        """Squared Mahalanobis distance of a pose from the guess."""
        return float(np.sum((self.root_information @ departure(self.T_sensor_jig, T_sensor_jig)) ** 2))

    @property
    def root_information(self) -> Array:
        """Square root (6, 6) of the information."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance)))


@dataclass(frozen=True, eq=False)
class Hypotheses:
    """Labellings (H, S), best first: poses (H), posterior covariances (H, 6, 6), χ² (H,) and log evidence (H,).

    minima (H, K): all poses at which each labelling's search ended.
    """

    labels: IntArray
    T_sensor_jig: Pose
    covariance: Array
    chi2: Array
    log_evidence: Array
    minima: Pose

    def __len__(self) -> int:
        """The number of hypotheses."""
        return len(self.chi2)


def weigh(
    labels: IntArray, spots: Spots, jig: Jig, prior: Prior | None, max_tilt_rad: float, near: Pose | None = None
) -> Hypotheses:
    """Solve every labelling's pose and weigh it; impossible ones (tilt, beyond the strings' ends) are left out.

    Without a prior every labelling must name five spots. near: a further pose (H) from which each is solved.
    """
    problem = _problem(labels, spots, jig, prior)
    start = _starts(labels, spots, jig, prior)
    if near is not None:
        start = Pose(np.concatenate([start.R, near.R[:, None]], 1), np.concatenate([start.t, near.t[:, None]], 1))
    many = PoseProblem(
        problem.starts, problem.directions, problem.yz_mm[:, None], problem.whitening[:, None], problem.prior
    )
    solution = solve_poses(many, start, max_iterations=ITERATIONS, tolerance=1e-5)
    chi2 = np.where(_possible(solution, labels, jig, max_tilt_rad), solution.cost, np.inf)
    best = first_least_of_each(chi2, SAME_CHI2)  # starts that ended in one minimum differ by rounding alone
    rows = np.arange(len(labels))
    chi2, T, jacobian = chi2[rows, best], solution.T_sensor_jig[rows, best], solution.jacobian[rows, best]
    covariance, log_volume = _posterior(jacobian, prior)
    evidence = _log_evidence(labels, spots, chi2, log_volume)
    if prior is None and jig.pillar is not None:
        evidence = evidence - 0.5 * (np.arccos(np.clip(T.R[:, 2, 2], -1, 1)) / FACING_SIGMA_RAD) ** 2
    order = [int(i) for i in ascending(-evidence, SAME_NATS) if np.isfinite(evidence[i])]
    return Hypotheses(
        labels[order], T[order], covariance[order], chi2[order], evidence[order], solution.T_sensor_jig[order]
    )


def _problem(labels: IntArray, spots: Spots, jig: Jig, prior: Prior | None) -> PoseProblem:
    found = labels >= 0
    cov = np.where(found[..., None, None], spots.cov_mm2[labels], np.eye(2))
    rows = np.repeat(found, 2, axis=1)
    white = whitening(cov) * rows[..., :, None]
    yz = np.where(found[..., None], spots.yz_mm[labels], 0.0)
    given = None if prior is None else (prior.T_sensor_jig, prior.root_information)
    return PoseProblem(jig.starts, jig.directions, yz, white, given)


def _starts(labels: IntArray, spots: Spots, jig: Jig, prior: Prior | None) -> Pose:
    """Starting poses (H, K): the prior's mean, or those of the pencil through five spots."""
    if prior is not None:
        R, t = prior.T_sensor_jig.R, prior.T_sensor_jig.t
        return Pose(np.broadcast_to(R, (len(labels), 1, 3, 3)), np.broadcast_to(t, (len(labels), 1, 3)))
    five = np.argsort(labels < 0, axis=1, kind="stable")[:, :5]
    chosen = np.take_along_axis(labels, five, axis=1)
    return pencil_starts(jig.starts[five], jig.directions[five], spots.yz_mm[chosen])


def _possible(solution: PoseSolution, labels: IntArray, jig: Jig, max_tilt_rad: float) -> NDArray[np.bool_]:
    share = solution.along_mm / jig.lengths
    inside = (share > -END_MARGIN) & (share < 1 + END_MARGIN) | (labels < 0)[:, None, :]
    upright = np.abs(solution.T_sensor_jig.R[..., 0, :] @ jig.axis) > np.cos(max_tilt_rad)
    return np.asarray(np.all(inside, axis=-1) & upright & np.isfinite(solution.cost))


def _posterior(jacobian: Array, prior: Prior | None) -> tuple[Array, Array]:
    """Covariance (H, 6, 6) and log of the share (H,) of the prior's volume that the data leave."""
    information = np.swapaxes(jacobian, -1, -2) @ jacobian
    if prior is None:
        sigma = np.array([FREE_SIGMA_MM] * 3 + [FREE_SIGMA_RAD] * 3)
        information = information + np.diag(sigma**-2)
        log_prior = 2 * float(np.sum(np.log(sigma)))
    else:
        log_prior = float(np.linalg.slogdet(prior.covariance)[1])
    return np.asarray(np.linalg.inv(information)), np.asarray(
        -0.5 * np.linalg.slogdet(information)[1] - 0.5 * log_prior
    )


def _log_evidence(labels: IntArray, spots: Spots, chi2: Array, log_volume: Array) -> Array:
    """Log of p(spots | labels) / p(spots | all clutter), the pose integrated out (Laplace)."""
    density_of_noise = -0.5 * np.linalg.slogdet(2 * np.pi * spots.cov_mm2)[1]
    gain = np.log(DETECTED / (1 - DETECTED) / spots.density) + density_of_noise + spots.log_odds
    total = np.sum(np.where(labels >= 0, gain[labels], 0.0), axis=1) + labels.shape[1] * np.log(1 - DETECTED)
    return np.asarray(total - 0.5 * chi2 + log_volume)
