"""Where the bundle starts: the design SCP with the frames' own jig poses, or a closed-form hand-eye solution."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from calib.bundle.problem import Bundle
from calib.figures import agreeing_pose, pose_distance
from geometry import Pose, State, log_so3, nearest_rotation, stack_poses

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_STRAY_MM, _STRAY_TIMES = 200.0, 8.0  # beyond any mounting's error, and times the median of the location's frames
_STRAY_LEAST = 4  # frames of a location, of which most agree


def chain_start(bundle: Bundle, T_hand_sensor: Pose, candidates: Sequence[Pose]) -> tuple[State, Pose]:
    """A start from an SCP: each location's target where its frames agree; with the chosen Ts_sensor_target (F).

    candidates: one batch of poses T_sensor_target a frame.
    """
    count = len(bundle.locations)
    nowhere = Pose(np.broadcast_to(np.eye(3), (count, 3, 3)), np.zeros((count, 3)))
    start = bundle.start(T_hand_sensor, nowhere)
    Ts_base_sensor = bundle.hands.pose(start.vector("robot")) @ T_hand_sensor
    places, chosen = [], np.zeros(len(candidates), dtype=int)
    for location in range(len(bundle.locations)):
        frames = [int(f) for f in np.flatnonzero(bundle.location == location)]
        place, chosen[frames] = agreeing_pose([Ts_base_sensor[f] @ candidates[f] for f in frames])
        places.append(place)
    own = stack_poses([c[int(k)] for c, k in zip(candidates, chosen, strict=True)])
    return bundle.with_places(start, stack_poses(places)), own


def strays(bundle: Bundle, start: State, own: Pose) -> Mask:
    """Frames (F,) that stand where most others of their location do not by far: a location's name, or a reading.

    start, own: of chain_start. A solve that carries such a frame settles slowly, or in no place.
    """
    Ts_base_sensor = bundle.hands.pose(start.vector("robot")) @ start.pose("scp")
    apart = pose_distance(Ts_base_sensor @ own, bundle.places(start)[bundle.location])
    out = np.zeros(len(apart), dtype=bool)
    for location in range(len(bundle.locations)):
        mine = np.flatnonzero(bundle.location == location)
        if len(mine) >= _STRAY_LEAST:
            out[mine] = apart[mine] > max(_STRAY_MM, _STRAY_TIMES * float(np.median(apart[mine])))
    return out


def hand_eye_start(Ts_base_hand: Pose, Ts_sensor_jig: Pose, location: NDArray[np.intp]) -> Pose | None:
    """T_hand_sensor in closed form from pairs of frames of a location, or None where the rotations do not suffice.

    A X = X B with A = T_hand(i)_hand(j), B = T_sensor(i)_sensor(j), X = T_hand_sensor. Source: Park & Martin 1994.
    """
    i, j = (
        np.array([(a, b) for a in range(len(location)) for b in range(a) if location[a] == location[b]])
        .reshape(-1, 2)
        .T
    )
    if len(i) < 2:
        return None
    A = Ts_base_hand[i].inverse() @ Ts_base_hand[j]
    B = Ts_sensor_jig[i] @ Ts_sensor_jig[j].inverse()
    alpha, beta = log_so3(A.R), log_so3(B.R)
    moment = np.einsum("ni,nj->ij", alpha, beta)
    if np.linalg.svd(moment, compute_uv=False)[1] < 1e-9:
        return None
    R = nearest_rotation(moment)
    rows, right = (A.R - np.eye(3)).reshape(-1, 3), ((R @ B.t[..., None])[..., 0] - A.t).reshape(-1)
    return Pose(R, np.asarray(np.linalg.lstsq(rows, right, rcond=None)[0]))
