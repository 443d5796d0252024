"""Evidence beside the points that contradicts them: rows of a tracker, readings in sockets, distances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Evidence, Solution, other_linearisations
from calib.engine import Result, covariance
from calib.result import Verdict
from geometry import Linearised

Array = NDArray[np.float64]

_GATE_CHI2 = 30.0  # of three residuals: 1 in 700,000 by chance, and files hold hundreds of rows
_TOLD = 1e-4  # share of a row's variance that is left in its residual; with less it determines an unknown alone


@dataclass(frozen=True, eq=False)
class FalseRow:
    """A row that the rest contradicts: of which evidence, which of its groups, how far off, and that over its σ."""

    evidence: int
    group: int
    called: str
    off_mm: float
    times_sigma: float


def worst_row(evidence: Sequence[Evidence], lins: Sequence[Linearised], result: Result) -> FalseRow | None:
    """The row that all others contradict most, None where they contradict none beyond chance.

    What leaving it out would gain: a row that pulls the answer towards itself keeps a small residual. lins: of the
    evidence's terms at the solution ``result``, whose robot is free within its priors.
    """
    known = covariance(result)
    worst: FalseRow | None = None
    for number, (one, lin) in enumerate(zip(evidence, lins, strict=True)):
        gain, error = _deletion(lin, known.total, result)
        k = int(np.argmax(gain))
        times = float(np.sqrt(gain[k]))
        if gain[k] > _GATE_CHI2 and (worst is None or times > worst.times_sigma):
            worst = FalseRow(number, k, one.called(k), float(np.linalg.norm(error[k])), times)
    return worst


def evidence_contradicts(solution: Solution) -> Verdict | None:
    """A verdict without σ where a row of the evidence lies far off, whatever the robot's errors within their priors.

    The worst row is named; one wrong row can pull others with it.
    """
    speaking = [e for e in solution.bundle.evidence if e.term(solution.bundle) is not None]
    worst = worst_row(speaking, other_linearisations(solution.every), solution.every) if speaking else None
    if worst is None:
        return None
    return Verdict(
        "priors_contradict",
        f"{worst.called} ([evidence] of cell.toml) lies {worst.off_mm:.2f} mm from where the frames and the robot's "
        f"errors within their priors have it, {worst.times_sigma:.0f} times its σ: correct the row or leave it out; no "
        "σ is given until then",
        withheld=True,
    )


def _deletion(lin: Linearised, total: Array, result: Result) -> tuple[Array, Array]:
    """What leaving each group (G,) out would lower the cost by, and how far off (G, r) the rest has it.

    0 of groups that hang on a target's place.
    """
    u = result.unknowns
    tied = np.zeros(len(lin.residual), dtype=bool)
    for name in lin.member:
        tied |= np.any(lin.jacobian[name] != 0, axis=(1, 2))
    common = np.zeros((*lin.residual.shape, u.size))
    for name, by in lin.jacobian.items():
        if name not in lin.member:
            common[..., u.indices(name)] = by
    common[..., ~u.free] = 0.0
    left = lin.covariance - common @ total @ np.swapaxes(common, -1, -2)
    values, axes = np.linalg.eigh(left)
    along = (np.swapaxes(axes, -1, -2) @ lin.residual[..., None])[..., 0]
    stated = np.einsum("gij,gik,gjk->gk", lin.covariance, axes, axes)
    told = values > _TOLD * stated
    by_variance = np.where(told, along / np.where(told, values, 1.0), 0.0)
    error = lin.covariance @ axes @ by_variance[..., None]
    return np.where(tied, 0.0, np.sum(along * by_variance, axis=1)), error[..., 0]
