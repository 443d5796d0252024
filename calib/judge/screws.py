"""Whether hand and jig move alike between frames: the screws of their motions, without any solution.

Whatever the sensor centre position is, the hand's motion between two frames of a location and the jig's motion that the
sensor sees turn by the same angle and advance by the same length along their axes (A X = X B: Chen's invariants of a
screw).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from geometry import Frame, Pose, log_so3, stack_poses
from jig_cad import Jig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# benchmarks/calib_degenerate.py: that sound motions agree by these
ANGLE_RAD, ADVANCE_MM = float(np.deg2rad(1.5)), 5.0  # a nominal arm's and a single jig pose's own errors
LEAST_TURN_RAD = float(np.deg2rad(5.0))  # a smaller motion has no axis to speak of


@dataclass(frozen=True, eq=False)
class ScrewViews:
    """Frames, the names of their locations, pairs (P, 2) that share one, and the jig's screw between them."""

    frames: tuple[Frame, ...]
    names: tuple[str, ...]
    pairs: NDArray[np.intp]
    screws: Array  # (1 + K, P, 2): angle and advance, as labelled and with one frame's labels turned
    joints: Array | None


def views_of(used: tuple[Frame, ...], jig: Jig) -> ScrewViews:
    """The pairs of frames that share a location and turned against each other, with the jig's screws."""
    names = tuple(s.location for s in used)
    index = [(i, j) for i, j in combinations(range(len(used)), 2) if names[i] == names[j]]
    pairs = np.array(index, dtype=np.intp).reshape(-1, 2)
    joints = [s.joints_rad for s in used]
    known = None if any(q is None for q in joints) or not joints else np.array(joints)
    if not len(pairs):
        return ScrewViews(used, names, pairs, np.zeros((2, 0, 2)), known)
    screws = jig_screws(used, pairs, jig)
    far = screws[0, :, 0] > LEAST_TURN_RAD
    return ScrewViews(used, names, pairs[far], screws[:, far], known)


def jig_screws(used: tuple[Frame, ...], pairs: NDArray[np.intp], jig: Jig) -> Array:
    """Angle and advance (1 + K, P, 2) of the jig's motions in the sensor: as labelled, turned by each symmetry."""
    jigs = stack_poses([s.candidates[0] for s in used])
    first, second = jigs[pairs[:, 0]], jigs[pairs[:, 1]]
    turns = (Pose.identity(), *(s.pose for s in jig.symmetries))
    return np.stack([screw(second @ turn @ first.inverse()) for turn in turns])


def screw(motion: Pose) -> Array:
    """Angle [rad] and advance along the axis [mm] of the motions (..., 2)."""
    w = log_so3(motion.R)
    angle = np.linalg.norm(w, axis=-1)
    return np.stack([angle, np.sum(w * motion.t, axis=-1) / np.maximum(angle, 1e-9)], axis=-1)


def disagreement(v: ScrewViews, hands: Pose) -> Array:
    """How far screws of hands (..., F) and jig are apart over what they may be (..., 1 + K, P): as labelled, turned."""
    of_hand = screw(hands[..., v.pairs[:, 1]].inverse() @ hands[..., v.pairs[:, 0]])
    return np.asarray(np.linalg.norm((v.screws - of_hand[..., None, :, :]) / [ANGLE_RAD, ADVANCE_MM], axis=-1))


def share(v: ScrewViews, hands: Pose, known: Mask | None = None) -> float:
    """Share of the pairs that agree, whichever way their labels are turned; of frames whose hand is ``known`` (F,)."""
    agree = disagreement(v, hands).min(axis=0) < 1.0
    return float(np.mean(agree if known is None else agree[known[v.pairs].all(axis=1)]))


def holds(v: ScrewViews, which: Mask, i: int, j: int) -> bool:
    """Whether the pair of frames i and j is one of ``which`` (P,)."""
    return bool(np.any(which & (v.pairs[:, 0] == min(i, j)) & (v.pairs[:, 1] == max(i, j))))


def numbers_of(v: ScrewViews, index: list[int]) -> str:
    """The numbers of the frames of an index: "frame 3", "frames 3, 4"."""
    numbers = [str(v.frames[i].number) for i in sorted(index)]
    return f"frame {numbers[0]}" if len(numbers) == 1 else f"frames {', '.join(numbers)}"


def largest_group(v: ScrewViews, contrary: Mask, group: list[int]) -> list[int]:
    """The frames about the one that contradicts fewest, of which each contradicts few of the others.

    contrary: which pairs (P,) disagree; frames that hardly turned against each other are no pair and tell nothing.
    """
    if not group:
        return []
    alike = {i: {j for j in group if not holds(v, contrary, i, j)} for i in group}
    kept = alike[max(group, key=lambda i: len(alike[i]))]
    return sorted(i for i in kept if len(alike[i] & kept) > 0.6 * len(kept))
