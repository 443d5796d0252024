"""The paper's calibration, Eqs. (1)-(4) with its misprints mended (its printed sign is kept as an option, to show it).

x is the jig's origin in the base by the chain, one vector a frame; differences to the first used frame of each location
eliminate the unknown x*; the step is ΔΦ = (CᵀC + λI)⁻¹ Cᵀ Δx with columns of C scaled to unit norm, and Φ ← Φ - ΔΦ,
since Eq. (1) defines ΔΦ as nominal minus true.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Hands
from geometry import Pose, skew

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_STALLED = 1e-9  # scaled steps below this that no longer shrink are rounding
_FAR = 1e6


@dataclass(frozen=True, eq=False)
class PaperProblem:
    """Jig origins in the sensor (F, 3) [mm], the robot's hands (F), locations (F,).

    offsets: which of the robot's parameters are estimated beside the SCP; the last joint's offset would duplicate a
    rotation of the SCP.
    """

    origins_mm: Array
    hands: Hands
    location: Index
    offsets: tuple[int, ...] = ()


@dataclass(frozen=True)
class PaperSettings:
    """λ while the scaled step exceeds ``switch``, then 0; stop below ``tolerance``; sign -1 is the mended step."""

    damping: float = 1e-3
    switch: float = 1e-3
    tolerance: float = 1e-12
    max_iterations: int = 200
    sign: float = -1.0


@dataclass(frozen=True, eq=False)
class PaperResult:
    """Where the iteration ended.

    jacobian (3·D, K): C at the end, D differences, K = 6 + offsets. residual (3·D,): Δx [mm]. offsets_rad (k,): of
    the offset joints. history: rms of Δx [mm] before each step. condition: of C with columns scaled to unit norm.
    """

    T_hand_sensor: Pose
    offsets_rad: Array
    jacobian: Array
    residual: Array
    history: Array
    converged: bool
    iterations: int
    condition: float


def solve_paper(problem: PaperProblem, T_hand_sensor: Pose, settings: PaperSettings | None = None) -> PaperResult:
    """Iterate Eqs. (1)-(4) from a design SCP until the scaled step falls below the tolerance."""
    settings = settings or PaperSettings()
    scp, offsets, damping = T_hand_sensor, np.zeros(len(problem.offsets)), settings.damping
    history: list[float] = []
    last, converged = np.inf, False
    C, dx = differences(problem, scp, offsets)
    while len(history) < settings.max_iterations and not converged:
        history.append(float(np.sqrt(np.mean(dx**2))))
        scale = np.linalg.norm(C, axis=0)
        scale = np.where(scale > 0, scale, 1.0)
        scaled = damped_step(C / scale, dx, damping)
        size = float(np.linalg.norm(scaled))
        step = settings.sign * scaled / scale
        scp, offsets = scp @ Pose.exp(step[:6]), offsets + step[6:]
        C, dx = differences(problem, scp, offsets)
        if not np.isfinite(size) or size > _FAR:
            break
        converged = damping == 0 and (size < settings.tolerance or (size < _STALLED and size >= last))
        damping = settings.damping if size > settings.switch else 0.0
        last = size
    return PaperResult(scp, offsets, C, dx, np.array(history), converged, len(history), scaled_condition(C))


def differences(problem: PaperProblem, T_hand_sensor: Pose, offsets_rad: Array) -> tuple[Array, Array]:
    """C (3·D, K) and Δx (3·D,) of Eq. (3): each location's first frame minus its others."""
    x, J = origins(problem, T_hand_sensor, offsets_rad)
    first, other = pairs(problem.location)
    return (J[first] - J[other]).reshape(-1, J.shape[-1]), (x[first] - x[other]).reshape(-1)


def origins(problem: PaperProblem, T_hand_sensor: Pose, offsets_rad: Array) -> tuple[Array, Array]:
    """Jig origins x (F, 3) [mm] in the base by the chain, and their Jacobian (F, 3, K) by ξ and the offsets."""
    values = np.zeros(len(problem.hands.sigma))
    values[list(problem.offsets)] = offsets_rad
    hand = problem.hands.pose(values)
    in_hand = T_hand_sensor @ problem.origins_mm
    rotation = hand.R @ T_hand_sensor.R
    scp = np.concatenate([rotation, -rotation @ skew(problem.origins_mm)], -1)
    if not problem.offsets:
        return hand @ in_hand, scp
    twists = problem.hands.jacobian(values)[..., list(problem.offsets)]  # (F, 6, k), hand axes
    moved = hand.R @ (twists[:, :3] - skew(in_hand) @ twists[:, 3:])
    return hand @ in_hand, np.concatenate([scp, moved], -1)


def pairs(location: Index) -> tuple[Index, Index]:
    """For every frame but a location's first: the first frame, and the frame."""
    _, first, inverse = np.unique(location, return_index=True, return_inverse=True)
    firsts = first[inverse]
    other = np.flatnonzero(firsts != np.arange(len(location)))
    return firsts[other], other


def damped_step(C: Array, dx: Array, damping: float) -> Array:
    """(CᵀC + λI)⁻¹ Cᵀ Δx (K,) for columns of unit norm."""
    rows = np.vstack([C, np.sqrt(damping) * np.eye(C.shape[1])]) if damping else C
    right = np.concatenate([dx, np.zeros(len(rows) - len(dx))])
    return np.asarray(np.linalg.lstsq(rows, right, rcond=None)[0])


def scaled_condition(C: Array) -> float:
    """Condition number of C with its columns scaled to unit norm; infinite where rank is lost."""
    norms = np.linalg.norm(C, axis=0)
    if len(C) < C.shape[1] or np.any(norms == 0):
        return float("inf")
    values = np.linalg.svd(C / norms, compute_uv=False)
    return float(values[0] / values[-1]) if values[-1] > 1e-15 * values[0] else float("inf")
