"""Evidence beside the points that contradicts them: rows of a tracker, readings in sockets, distances."""

from __future__ import annotations

import numpy as np

from calib.bundle import Solution, other_linearisations
from calib.engine import whitener
from calib.result import Verdict

_GATE_CHI2 = 30.0  # of three residuals: 1 in 700,000 by chance, and files hold hundreds of rows


def evidence_contradicts(solution: Solution) -> Verdict | None:
    """A verdict without σ where a row of the evidence lies far off, whatever the robot's errors within their priors.

    The worst row is named; one wrong row can pull others with it.
    """
    bundle = solution.bundle
    speaking = [e for e in bundle.evidence if e.term(bundle) is not None]
    worst, words, mm = _GATE_CHI2, "", 0.0
    for evidence, lin in zip(speaking, other_linearisations(solution.every), strict=True):
        white = (whitener(lin.covariance) @ lin.residual[..., None])[..., 0]
        chi2 = np.sum(white**2, axis=1)
        k = int(np.argmax(chi2))
        if chi2[k] > worst:
            worst, words, mm = float(chi2[k]), evidence.called(k), float(np.linalg.norm(lin.residual[k]))
    if not words:
        return None
    return Verdict(
        "priors_contradict",
        f"{words} ([evidence] of cell.toml) lies {mm:.2f} mm from where the frames and the robot's errors within their "
        f"priors have it, {np.sqrt(worst):.0f} times its σ: correct the row or leave it out; no σ is given until then",
        withheld=True,
    )
