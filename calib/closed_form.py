"""The paper's closed form of the jig pose, Eqs. (5)-(10), with its misprints mended (every sign candidate kept)."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from calib.jig_pose_types import JigPoseCandidate
from geometry import AxisPoints
from jig_cad import Jig

Array = NDArray[np.float64]


def closed_form_poses(
    axis_yz: Mapping[str, Array | tuple[float, float]] | AxisPoints, jig: Jig
) -> tuple[JigPoseCandidate, ...]:
    """Up to four poses T_sensor_jig, one a sign pair (±θ₁, ±θ₂), the smallest disagreement of h₁ first.

    axis_yz: (y, z) [mm] of A, B, C, B', C'. Empty where noise makes a/l > 1, so that θ = acos(a/l) does not exist.
    """
    raise NotImplementedError
