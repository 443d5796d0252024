"""Where strings begin without a drawing of the sensor's mount: the SCP in closed form from the frames' own jig poses.

Every frame tells its jig's pose but for a mirror and the jig's symmetries. Rotations of a grid are tried: under the
right one some choice of a pose a frame has the jig of each location stand still. The choices of the best rotations
give the SCP in closed form; the choice is made again with that, and the one on which most frames agree is taken.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.bundle.starts import hand_eye_start
from calib.figures import agreeing_pose, pose_distance
from geometry import Pose, stack_poses
from geometry.ties import ascending

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_GRID = 2500  # rotations, some 15 degrees apart
_TRIED = 12  # of the best, refined
_REACH_MM = 100.0  # that turns an angle between two poses of the jig into a length
_FAR_MM = 60.0  # beyond which a frame agrees with none and counts no more
_ROUNDS = 4  # of choosing poses and solving for the SCP
_SAME_SINE, _SAME_MM = 1e-6, 1e-6
_LEAST_SHARE = 0.5  # of the frames that must agree
_AGREE_MM = 15.0  # a frame of an arm as built and of five noisy strings is nearer


def free_start(hands: Pose, options: Sequence[Pose], location: Index) -> Pose | None:
    """T_hand_sensor from jig poses alone, or None where they do not tell it.

    hands: Ts_base_hand (F). options: the poses T_sensor_jig (K) that each frame may have, images by the jig's
    symmetries included. location (F,): which of them belong to one jig that stood still.
    """
    if len(options) < 3 or any(len(o) == 0 for o in options):
        return None
    frame = np.repeat(np.arange(len(options)), [len(o) for o in options])
    every = Pose(np.concatenate([o.R for o in options]), np.concatenate([o.t for o in options]))
    best: tuple[float, Pose] | None = None
    for first_choice in _chosen_by_rotation(hands, every, frame, location):
        chosen = first_choice
        X = hand_eye_start(hands, every[chosen], location)
        for _ in range(_ROUNDS):
            if X is None:
                break
            again = _chosen_by(X, hands, options, location)
            settled = np.array_equal(again, chosen)
            chosen = again
            X = hand_eye_start(hands, every[chosen], location)
            if settled:
                break
        if X is None:
            continue
        apart = _apart(X, hands, every[chosen], location)
        cost = float(np.mean(np.minimum(apart, _FAR_MM) ** 2))
        if np.mean(apart < _AGREE_MM) >= _LEAST_SHARE and (best is None or cost < best[0] - _SAME_MM):
            best = cost, X
    return None if best is None else best[1]


def _chosen_by_rotation(hands: Pose, every: Pose, frame: Index, location: Index) -> list[Index]:
    """Which pose (of ``every``) each frame takes, under the rotations that let the jigs stand stillest."""
    grid = rotation_grid(_GRID)
    base = np.einsum("kij,gjl,klm->gkim", hands.R[frame], grid, every.R)  # R_base_jig of every option
    misfit = np.zeros(len(grid))
    chosen = np.zeros((len(grid), len(hands)), dtype=np.intp)
    for name in np.unique(location):
        frames = np.flatnonzero(location == name)
        least = np.full(len(grid), np.inf)
        picked = np.zeros((len(grid), len(frames)), dtype=np.intp)
        for first in np.flatnonzero(frame == frames[0]):
            cosine = (np.einsum("gij,gkij->gk", base[:, first], base) - 1) / 2
            own = np.stack([_best(cosine, np.flatnonzero(frame == f)) for f in frames], axis=1)
            total = np.sum(1 - np.take_along_axis(cosine, own, axis=1), axis=1)
            better = total < least - _SAME_SINE
            least, picked = np.where(better, total, least), np.where(better[:, None], own, picked)
        misfit += least
        chosen[:, frames] = picked
    order = ascending(misfit, _SAME_SINE)
    _, once = np.unique(chosen[order], axis=0, return_index=True)
    return [chosen[int(order[k])] for k in np.sort(once)[:_TRIED]]


def _best(cosine: Array, options: Index) -> Index:
    """Of a frame's options the one turned least; of equal ones the first."""
    mine = np.round(cosine[:, options], 6)
    return np.asarray(options[np.argmax(mine, axis=1)])


def _chosen_by(X: Pose, hands: Pose, options: Sequence[Pose], location: Index) -> Index:
    """The options on which the frames of each location agree under an SCP."""
    first = np.concatenate([[0], np.cumsum([len(o) for o in options])[:-1]])
    out = np.zeros(len(options), dtype=np.intp)
    for name in np.unique(location):
        frames = np.flatnonzero(location == name)
        _, choice = agreeing_pose([hands[f] @ X @ options[int(f)] for f in frames], _REACH_MM)
        out[frames] = first[frames] + np.array(choice)
    return out


def _apart(X: Pose, hands: Pose, own: Pose, location: Index) -> Array:
    """How far (F,) [mm] each frame has its jig from where its location's frames agree."""
    out = np.zeros(len(hands))
    for name in np.unique(location):
        frames = np.flatnonzero(location == name)
        placed = (hands @ X @ own)[frames]
        place, _ = agreeing_pose([placed[k : k + 1] for k in range(len(frames))], _REACH_MM)
        out[frames] = pose_distance(placed, stack_poses([place] * len(frames)), _REACH_MM)
    return out


def rotation_grid(count: int) -> Array:
    """Rotations (N, 3, 3) spread evenly over all of them.

    References
    ----------
    Alexa, Super-Fibonacci spirals: fast, low-discrepancy sampling of SO(3), 2022.
    """
    i = np.arange(count) + 0.5
    phi, psi = np.sqrt(2.0), 1.533751168755204288118041
    inner, outer = np.sqrt(i / count), np.sqrt(1 - i / count)
    a, b = 2 * np.pi * i / phi, 2 * np.pi * i / psi
    x, y, z, w = inner * np.sin(a), inner * np.cos(a), outer * np.sin(b), outer * np.cos(b)
    return np.stack(
        [
            np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)], -1),
            np.stack([2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)], -1),
            np.stack([2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)], -1),
        ],
        -2,
    )
