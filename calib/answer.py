"""The answer of calibrate, put together from an estimate, the figures and the verdict."""

from __future__ import annotations

from dataclasses import dataclass, field, fields, replace

import numpy as np
from numpy.typing import NDArray

from calib.assemble import Chains, by_location, frame_distances, frame_result, location_figures
from calib.bundle.uncertainty import printed_sigmas
from calib.config import CalibConfig
from calib.observation import Observations
from calib.result import SIGMA_HOLDS, CalibrationResult, FrameResult, LocationResult, Verdict
from calib.stations import Station
from geometry import Pose, RobotModel
from jig_cad import Jig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Estimate:
    """What a method says: the SCP with its covariance, and which frames and points it left out.

    reasons: why a used frame was left out after all, by its number. outliers: its outlying points (N,), by its number.
    The other fields are those of CalibrationResult.
    """

    T_hand_sensor: Pose
    covariance: Array
    robot: RobotModel | None
    robot_delta: Array
    robot_sigma: Array
    chi2_per_dof: float
    degrees_of_freedom: int
    converged: bool
    iterations: int
    initial_cost: float
    final_cost: float
    condition: float
    noise: dict[str, float]
    reasons: dict[int, str] = field(default_factory=dict)
    outliers: dict[int, Mask] = field(default_factory=dict)
    anchors_delta_mm: Array = field(default_factory=lambda: np.zeros((6, 3)))
    anchors_sigma_mm: Array = field(default_factory=lambda: np.zeros((6, 3)))
    weak_directions: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


_OWN = ("reasons", "outliers")  # the other fields go into the result as they are
_SOLVED = (  # withheld where the covariance is not true
    "T_hand_sensor",
    "covariance",
    "robot",
    "robot_delta",
    "robot_sigma",
    "anchors_delta_mm",
    "anchors_sigma_mm",
    "weak_directions",
)


def answer(
    observations: Observations,
    ready: tuple[Station, ...],
    jig: Jig,
    robot: RobotModel | None,
    config: CalibConfig,
    verdict: Verdict,
    estimate: Estimate | None,
) -> CalibrationResult:
    """Everything that calibrate says; ``estimate`` is None where the data were refused."""
    design = observations.T_hand_sensor_design
    solved = None if estimate is None else (estimate.T_hand_sensor, estimate.robot)
    locations, frames = dict[str, LocationResult](), dict[int, FrameResult]()
    for name, group in by_location(observations, ready).items():
        figures = location_figures(group, jig, Chains((design, robot), solved))
        distances = frame_distances(group, figures.fit)
        locations[name] = figures.result
        for s in group:
            number = s.observation.frame
            reason, flags = _marks(s, estimate)
            frames[number] = frame_result(s, reason, flags, distances.get(number), figures.own.get(number))
    n = 0 if robot is None else robot.n_joints
    empty = CalibrationResult(
        method=config.method,
        model=config.model,
        verdict=verdict,
        T_hand_sensor_design=design,
        locations=locations,
        frames=tuple(frames[s.observation.frame] for s in ready),
        robot=robot,
        robot_delta=np.zeros((5, n)),
        robot_sigma=np.zeros((5, n)),
    )
    if estimate is None:
        return empty
    taken = {f.name: getattr(estimate, f.name) for f in fields(Estimate) if f.name not in _OWN}
    if verdict.code not in SIGMA_HOLDS:
        places = {name: replace(place, T_base_jig=None) for name, place in locations.items()}
        return replace(empty, locations=places, **{k: v for k, v in taken.items() if k not in _SOLVED})
    rotation, translation = printed_sigmas(estimate.T_hand_sensor, estimate.covariance)
    return replace(empty, **taken, sigma_rotation_deg=rotation, sigma_translation_mm=translation)


def _marks(s: Station, estimate: Estimate | None) -> tuple[str | None, list[str]]:
    """Why a frame does not count, and its points' flags with the outliers of the solution marked."""
    flags = list(s.axis.flag) if s.axis.flag else [""] * len(s.axis)
    if estimate is None:
        return s.reason, flags
    out = estimate.outliers.get(s.observation.frame)
    if out is not None:
        flags = ["outlier" if out[k] else f for k, f in enumerate(flags)]
    return s.reason or estimate.reasons.get(s.observation.frame), flags
