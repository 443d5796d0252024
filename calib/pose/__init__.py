"""The target's pose in the sensor from one frame's points: all candidates, how likely each is, what is weak."""

from calib.pose.candidates import JigPoseCandidate, JigPoseFit, JigPoseResult
from calib.pose.closed_form import closed_form_strings, closed_forms
from calib.pose.crossing import crossings, crossings_jacobian
from calib.pose.fit import MIN_STRINGS, fit_pose, jig_pose, pose_near
from calib.pose.own import own_poses
from calib.pose.solver import PoseProblem, PoseSolution, solve_poses
from calib.pose.starts import pencil_starts
from calib.pose.tangent import departure
from calib.pose.weights import whitening

__all__ = [
    "MIN_STRINGS",
    "JigPoseCandidate",
    "JigPoseFit",
    "JigPoseResult",
    "PoseProblem",
    "PoseSolution",
    "closed_form_strings",
    "closed_forms",
    "crossings",
    "crossings_jacobian",
    "departure",
    "fit_pose",
    "jig_pose",
    "own_poses",
    "pencil_starts",
    "pose_near",
    "solve_poses",
    "whitening",
]
