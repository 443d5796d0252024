"""Each frame's own jig pose: weighted least squares on that frame's points alone, next to the robot chain."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.pose.fit import fit_pose, string_indices
from calib.pose.solver import PoseProblem, PoseSolution, solve_poses
from calib.pose.weights import whitening
from calib.stations import Station
from geometry import NoAnswerError, Pose, stack_poses
from jig_cad import Jig

Array = NDArray[np.float64]

FULL = 5  # strings that determine a pose on their own


def own_poses(frames: Sequence[Station], jig: Jig, by_chain: Pose) -> dict[int, Pose]:
    """T_sensor_jig of every frame, by its number; of about equally likely ones the nearest to the chain's.

    by_chain: (F) T_sensor_jig by the robot; it stands in where a frame's points determine no pose.
    """
    lone = [s for s in frames if len(s.candidates) == 1 and len(set(s.axis.label)) >= FULL]
    solution = _solve(lone, jig) if lone else None
    out: dict[int, Pose] = {}
    for i, s in enumerate(lone):
        if solution is not None and solution.converged[i]:
            out[s.observation.frame] = solution.T_sensor_jig[i]
    for i, s in enumerate(frames):
        if s.observation.frame not in out:
            out[s.observation.frame] = _own_pose(s, jig, by_chain[i])
    return out


def _solve(frames: Sequence[Station], jig: Jig) -> PoseSolution:
    """All frames with a single candidate at once, from it; what a frame lacks has no weight."""
    most = max(len(s.axis) for s in frames)
    index = np.zeros((len(frames), most), dtype=np.intp)
    yz, white = np.zeros((len(frames), most, 2)), np.zeros((len(frames), 2 * most, 2 * most))
    for i, s in enumerate(frames):
        n = len(s.axis)
        index[i, :n], yz[i, :n] = string_indices(s.axis, jig), s.axis.yz_mm
        white[i, : 2 * n, : 2 * n] = whitening(s.axis.cov_yz_mm2)
    starts = stack_poses([s.candidates[0] for s in frames])
    return solve_poses(PoseProblem(jig.starts[index], jig.directions[index], yz, white), starts)


def _own_pose(s: Station, jig: Jig, by_chain: Pose) -> Pose:
    try:
        return fit_pose(s.axis, jig, by_chain).T_sensor_jig
    except NoAnswerError:
        return by_chain
