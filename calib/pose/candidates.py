"""What a search for the jig's pose in the sensor answers: candidates, how likely each is, what is weak."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from geometry import Pose

Array = NDArray[np.float64]
Ambiguity = Literal["unique", "mirror", "weak"]


@dataclass(frozen=True, eq=False)
class JigPoseCandidate:
    """One pose of the jig in the sensor frame that may explain a frame's points.

    cost: the sum of residuals squared, whitened by the points' covariances.
    chi2: the same with the anchors' tolerance in the covariance. likelihood: share among all candidates, by ``chi2``.
    residuals_mm: predicted minus measured (y, z) (N, 2). covariance: of ξ in T = T̂ · Exp(ξ) (6, 6).
    """

    T_sensor_jig: Pose
    cost: float = float("nan")
    chi2: float = float("nan")
    likelihood: float = float("nan")
    converged: bool = True
    residuals_mm: Array = field(default_factory=lambda: np.zeros((0, 2)))
    covariance: Array = field(default_factory=lambda: np.full((6, 6), np.nan))


@dataclass(frozen=True, eq=False)
class WeakDirection:
    """A motion of the jig that a frame's points hardly see: unit tangent (6,) and its σ at the jig's anchors [mm]."""

    tangent: Array
    sigma_mm: float


@dataclass(frozen=True, eq=False)
class JigPoseFit:
    """All local minima of a frame's jig pose, the chosen one first; ``dof``: degrees of freedom of the cost."""

    candidates: tuple[JigPoseCandidate, ...]
    dof: int

    @property
    def best(self) -> JigPoseCandidate:
        """The chosen candidate: the most likely, or the nearest to the guess among the likely."""
        return self.candidates[0]

    @property
    def T_sensor_jig(self) -> Pose:
        """Pose of the chosen candidate."""
        return self.best.T_sensor_jig

    @property
    def covariance(self) -> Array:
        """Covariance (6, 6) of the chosen candidate; tangent (translation [mm], rotation [rad]), jig axes."""
        return self.best.covariance

    @property
    def converged(self) -> bool:
        """Whether the chosen candidate's iteration converged."""
        return self.best.converged


@dataclass(frozen=True, eq=False)
class JigPoseResult(JigPoseFit):
    """The local minima, and what the points leave undetermined.

    condition: of the whitened Jacobian, columns scaled to unit norm.
    ambiguity: "unique"; "mirror": a second pose is about as likely; "weak": a direction is (nearly) undetermined.
    """

    condition: float
    weak: tuple[WeakDirection, ...] = ()
    ambiguity: Ambiguity = "unique"
