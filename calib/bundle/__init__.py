"""All frames at once: SCP, places of the target, robot and shape, with outliers, noise and covariance."""

from calib.bundle.evidence import (
    DISTANCE_SIGMA_MM,
    SEAT_SIGMA_MM,
    TRACKER_SIGMA_MM,
    DistanceBetween,
    Evidence,
    SeatedTool,
    TrackedPoint,
    check_evidence,
)
from calib.bundle.hands import Hands
from calib.bundle.information import (
    FrameInformation,
    Model,
    covariances_with,
    frame_information,
    observability,
    scaled,
    scp_covariance,
)
from calib.bundle.noise import JOINT, JOINT_STATED, POINTS, ROBOT_EVIDENCE, ROBOT_TIMES, given_noise, reweighed
from calib.bundle.on_target import OnTarget, OnTargetLinearised
from calib.bundle.problem import Bundle, estimated_parameters, estimates_compliance, estimates_sensor
from calib.bundle.robust import solve_robust
from calib.bundle.solution import Explained, Mask, Solution, answered, explain, make_bundle, solve_problem
from calib.bundle.solve import other_linearisations, solve_bundle
from calib.bundle.starts import chain_start, hand_eye_start
from calib.bundle.unknown_mount import free_start, rotation_grid

__all__ = [
    "DISTANCE_SIGMA_MM",
    "JOINT",
    "JOINT_STATED",
    "POINTS",
    "ROBOT_EVIDENCE",
    "ROBOT_TIMES",
    "SEAT_SIGMA_MM",
    "TRACKER_SIGMA_MM",
    "Bundle",
    "DistanceBetween",
    "Evidence",
    "Explained",
    "FrameInformation",
    "Hands",
    "Mask",
    "Model",
    "OnTarget",
    "OnTargetLinearised",
    "SeatedTool",
    "Solution",
    "TrackedPoint",
    "answered",
    "chain_start",
    "check_evidence",
    "covariances_with",
    "estimated_parameters",
    "estimates_compliance",
    "estimates_sensor",
    "explain",
    "frame_information",
    "free_start",
    "given_noise",
    "hand_eye_start",
    "make_bundle",
    "observability",
    "other_linearisations",
    "reweighed",
    "rotation_grid",
    "scaled",
    "scp_covariance",
    "solve_bundle",
    "solve_problem",
    "solve_robust",
]
