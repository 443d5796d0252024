"""What the robot chain says of a frame's jig pose: from another frame's, or from the jig's pose in the base."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib.config import LabellingConfig
from calib.label.evidence import Prior
from calib.pose import departure
from geometry import Pose

Array = NDArray[np.float64]
Index = int | NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class HandChain:
    """Hand poses of a location's frames, the SCP, and how wrong both may be.

    Ts_base_hand: (N). scp_covariance: of ξ in T = T_hand_sensor · Exp(ξ) (6, 6). robot_covariance: of every hand
    pose, in its sensor's axes (6, 6).
    """

    Ts_base_hand: Pose
    T_hand_sensor: Pose
    scp_covariance: Array
    robot_covariance: Array

    @staticmethod
    def build(Ts_base_hand: Pose, T_hand_sensor: Pose, config: LabellingConfig, refined: bool) -> HandChain:
        """The chain with the configuration's σ; a solved SCP is taken to be wrong by a tenth of the design's."""
        share = 0.1 if refined else 1.0
        scp = _diagonal(share * config.scp_sigma_mm, share * config.scp_sigma_deg)
        return HandChain(Ts_base_hand, T_hand_sensor, scp, _diagonal(config.robot_sigma_mm, config.robot_sigma_deg))

    @cached_property
    def Ts_base_sensor(self) -> Pose:
        """Pose of the sensor in every frame (N)."""
        return self.Ts_base_hand @ self.T_hand_sensor

    def from_frame(self, i: Index, T_sensor_jig: Pose, covariance: Array, j: Index) -> Prior:
        """Jig pose of frame j by that of frame i; batches of frames broadcast.

        With the SCP wrong by ξ and G the sensor's motion:
        T_j = Exp(-ξ) G Exp(ξ) T_i ≈ G T_i · Exp(Ad(T_j⁻¹) (Ad(G) - 1) ξ).
        """
        sensors = self.Ts_base_sensor
        G = sensors[j].inverse() @ sensors[i]
        T = G @ T_sensor_jig
        to_jig = T.inverse().adjoint
        scp = to_jig @ (G.adjoint - np.eye(6))
        total = _carried(scp, self.scp_covariance) + 2 * _carried(to_jig, self.robot_covariance)
        return Prior(T, total + covariance)

    def from_base(self, T_base_jig: Pose, covariance: Array, j: int) -> Prior:
        """Jig pose of frame j by the jig's pose in the base, whose covariance (6, 6) is given in the jig's axes."""
        T = self.Ts_base_sensor[j].inverse() @ T_base_jig
        to_jig = T.inverse().adjoint
        return Prior(T, _carried(to_jig, self.scp_covariance + self.robot_covariance) + covariance)


def mahalanobis2(prior: Prior, T_sensor_jig: Pose, covariance: Array) -> Array:
    """Squared distances (...), 6 degrees of freedom, of found poses (...) from their prediction."""
    near = np.sum(prior.T_sensor_jig.R * T_sensor_jig.R, axis=(-1, -2)) >= -0.5  # not turned by more than 138°
    xi = departure(prior.T_sensor_jig, T_sensor_jig)[..., None]
    distance = np.swapaxes(xi, -1, -2) @ np.linalg.solve(prior.covariance + covariance, xi)
    return np.asarray(np.where(near, distance[..., 0, 0], np.inf))


def _carried(by: Array, covariance: Array) -> Array:
    return np.asarray(by @ covariance @ np.swapaxes(by, -1, -2))


def _diagonal(sigma_mm: float, sigma_deg: float) -> Array:
    return np.diag(np.repeat([sigma_mm, np.deg2rad(sigma_deg)], 3) ** 2)
