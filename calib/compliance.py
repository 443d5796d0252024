"""Of which joints the frames tell how they give way under gravity: a prior that stays as it was tells nothing."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Robot, compliant_part
from geometry.robot import GROUP

Array = NDArray[np.float64]

OBSERVED = 0.7  # of the prior's σ: half of what is then known of a joint comes from the frames


@dataclass(frozen=True)
class JointCompliance:
    """How one joint gives way [rad/(N·m)]: as solved, its σ and that of the prior. joint: from 1."""

    joint: int
    compliance: float
    sigma: float
    prior_sigma: float

    @property
    def observed(self) -> bool:
        """Whether the frames tell it."""
        return self.sigma < OBSERVED * self.prior_sigma


def joint_compliances(robot: Robot | None, sigma: Array) -> tuple[JointCompliance, ...]:
    """What a solved robot says of its joints; sigma (P,) of its parameters."""
    compliant = None if robot is None else compliant_part(robot)
    if robot is None or compliant is None:
        return ()
    each = zip(robot.parameters, sigma, strict=True)
    stiffness = np.array(compliant.load.stiffness)
    return tuple(
        JointCompliance(p.joint, float(1 / stiffness[p.joint - 1]), float(s), p.sigma)
        for p, s in each
        if p.group == GROUP and p.joint is not None
    )


def compliance_words(joints: tuple[JointCompliance, ...]) -> str:
    """The sentence on joints of which the frames tell nothing, or ""."""
    silent = [str(j.joint) for j in joints if not j.observed]
    if not silent:
        return ""
    one = len(silent) == 1
    named = f"joint{'' if one else 's'} {', '.join(silent)}"
    text = f"the compliance of {named} is not told by these frames and stays at its prior"
    if len(silent) == len(joints):
        text += (
            ": nothing of the arm's compliance is observable here. Take frames with the arm stretched out and drawn in "
            "at each location, or more locations at other distances, or use a model without +compliance"
        )
    return text
