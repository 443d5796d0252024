"""The paper's answer held against the bundle over the same frames: a wrong answer must not look like a right one."""

from __future__ import annotations

import numpy as np

from calib.result import Estimate, Verdict
from geometry.special import chdtri

_TAIL = 1e-6  # of the paper's own covariance, which contains what the bundle makes better use of
_REACH_MM = 300.0  # turns the angle between two SCPs into a length where the jig is


def checked(verdict: Verdict, paper: Estimate, bundle_verdict: Verdict, bundle: Estimate | None) -> Verdict:
    """The paper's verdict, unless the data allow no answer or its answer is far from what all points together say.

    Nothing is taken from the bundle but this judgement.
    """
    if not verdict.trustworthy:
        return verdict
    if bundle is None or not bundle_verdict.trustworthy:
        return bundle_verdict
    xi = (paper.T_hand_sensor.inverse() @ bundle.T_hand_sensor).log()
    distance = float(xi @ np.linalg.lstsq(paper.covariance, xi, rcond=None)[0])
    if distance <= float(chdtri(6, _TAIL)):
        return verdict
    return Verdict(
        "not_converged",
        f"the iteration ended {np.linalg.norm(xi[:3]):.2g} mm and {np.rad2deg(np.linalg.norm(xi[3:])):.2g}° from what "
        f"all points together give, far beyond its σ (χ² {distance:.3g} with 6 degrees of freedom): jig poses of "
        "single frames are too uncertain here, or a mirror image was taken for one; use --method bundle",
    )
