"""What configurations would tell about the SCP: information by frame, and the covariance that sets predict."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.linearise import initial_state, linearise
from calib.problem import Points, Problem, pad_points, robot_chain
from calib.weights import frame_covariance, removal, whitener
from extraction import image_to_sheet
from geometry import AxisPoints, Pose, RobotModel, SensorModel, cross_plane_x0
from jig_cad import Jig
from perceptron_emu import project

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Model = Literal["scp", "full"]

SPOT_SIGMA_PX = 0.07  # a speckled string spot's scatter, as cell recordings show it
SURFACE_SIGMA_MM = 0.015  # what stays unknown of the way from the lit surface to the axis
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


def frame_information(
    robot: RobotModel,
    sensor: SensorModel,
    jig: Jig,
    T_hand_sensor: Pose,
    Ts_base_jig: Pose,
    joints_rad: Array,
    location: Index,
    model: Model = "scp",
) -> FrameInformation:
    """The information of configurations (F, n) [rad] at locations (F,), indices into Ts_base_jig."""
    T_sensor_jig = (robot.hand_pose(joints_rad) @ T_hand_sensor).inverse() @ Ts_base_jig[location]
    points = _expected_points(sensor, jig, T_sensor_jig)
    anchor_sigma = 0.0 if jig.measured else jig.tolerance_mm / np.sqrt(12)
    problem = Problem(points, robot_chain(robot, joints_rad), location, len(Ts_base_jig), jig.anchors_mm, anchor_sigma)
    lin = linearise(problem, initial_state(problem, T_hand_sensor, Ts_base_jig))
    white = whitener(frame_covariance(problem, lin, removal(~points.present), problem.chain.noise))
    f, rows = white.shape[:2]
    moved = lin.hand.reshape(f, rows, 6) @ lin.parameters
    a = white @ np.concatenate([lin.scp.reshape(f, rows, 6), moved, lin.anchors.reshape(f, rows, 12)], -1)
    b = white @ lin.jig.reshape(f, rows, 6)
    a_t, b_t = np.swapaxes(a, -1, -2), np.swapaxes(b, -1, -2)
    sigma = np.concatenate([WEAK_SCP, problem.chain.parameter_sigma, np.full(12, anchor_sigma)])
    estimated = np.ones(len(sigma), dtype=bool)
    estimated[6:-12] = model == "full"
    estimated[-12:] = anchor_sigma > 0
    return FrameInformation(a_t @ a, a_t @ b, b_t @ b, location, sigma, estimated)


def scp_covariance(info: FrameInformation, chosen: Sequence[int] | Index, *, noise_alone: bool = False) -> Array:
    """Covariance (6, 6) of the SCP, sensor axes [mm, rad], from the ``chosen`` frames; robot errors considered.

    noise_alone: without the robot's own errors, which no choice of views averages out entirely.
    """
    index = np.asarray(chosen, dtype=np.intp)
    weight = np.where(info.prior_sigma > 0, 1 / np.where(info.prior_sigma > 0, info.prior_sigma, 1.0) ** 2, 0.0)
    schur = info.common[index].sum(axis=0)
    for place in np.unique(info.location[index]):
        here = index[info.location[index] == place]
        cross = info.cross[here].sum(axis=0)
        jig = info.jigs[here].sum(axis=0) + np.diag(WEAK_JIG**-2.0)
        schur = schur - cross @ np.linalg.solve(jig, cross.T)
    free, considered = info.estimated, ~info.estimated & (info.prior_sigma > 0)
    noise = np.linalg.inv(schur[np.ix_(free, free)] + np.diag(weight[free]))
    if noise_alone:
        return np.asarray(noise[:6, :6])
    bias = -noise @ schur[np.ix_(free, considered)] * info.prior_sigma[considered]
    return np.asarray((noise + bias @ bias.T)[:6, :6])


def scaled(covariance: Array, lever_mm: float) -> Array:
    """The covariance with rotations as the millimetres that they move a point ``lever_mm`` away."""
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


def _expected_points(sensor: SensorModel, jig: Jig, T_sensor_jig: Pose) -> Points:
    """Where the strings' axes will be seen, with the covariance that a spot there has."""
    frames = []
    for pose in (T_sensor_jig[i] for i in range(len(T_sensor_jig))):
        crossing, _ = cross_plane_x0(pose @ jig.starts, jig.directions @ pose.R.T)
        _, jacobian = image_to_sheet(sensor, project(sensor, crossing))
        covariance = SPOT_SIGMA_PX**2 * jacobian @ np.swapaxes(jacobian, -1, -2) + SURFACE_SIGMA_MM**2 * np.eye(2)
        none = np.full(len(jig.strings), -1, dtype=np.intp)
        frames.append(AxisPoints(jig.strings, none, crossing[:, 1:], covariance, ("",) * len(jig.strings)))
    return pad_points(frames)
