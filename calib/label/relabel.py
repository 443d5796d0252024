"""Labels and axis points again, once the chain is solved: surface offsets by its poses, doubtful frames anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.config import CalibConfig
from calib.label.refine import upright_turn
from calib.label.surface_offset import surface_offset
from calib.observation import Observations
from calib.stations import Station, label, stays
from geometry import Pose, Sensor, stack_poses
from jig_cad import Jig

SETTLED_SIGMA = 0.05  # axis points that moved by less than this share of their σ leave the solution as it is


def relabel(
    ready: Sequence[Station],
    fresh: Sequence[Station],
    observations: Observations,
    T_hand_sensor: Pose,
    T_base_jig: dict[str, Pose],
    jig: Jig,
    config: CalibConfig,
) -> tuple[Station, ...]:
    """Complete frames that stand where the chain has them get their surface offsets by its pose; others new labels.

    fresh: the frames with the solved chain's hand poses. T_base_jig: by the chain; it decides the half turn, unless an
    earlier frame than before is the location's first used one now: then x_jig · x_sensor > 0 there.
    """
    kept, moved = dict[int, Station](), dict[int, Pose]()
    for s, f in zip(ready, fresh, strict=True):
        place, frame = T_base_jig.get(s.observation.location), s.observation.frame
        if s.observation.axis is not None:
            kept[frame] = replace(s, T_base_hand=f.T_base_hand)
        elif place is not None and len(s.axis) == len(jig.strings):
            predicted = (f.T_base_hand @ T_hand_sensor).inverse() @ place
            if stays(s, predicted):
                kept[frame] = replace(s, T_base_hand=f.T_base_hand)
                moved[frame] = predicted
    if moved:
        complete = [kept[frame] for frame in moved]
        offsets = _with_offsets(complete, stack_poses(list(moved.values())), jig, observations.sensor, config)
        kept |= dict(zip(moved, offsets, strict=True))
    doubtful = tuple(f for f in fresh if f.observation.frame not in kept)
    again = label(doubtful, observations.sensor, T_hand_sensor, T_base_jig, jig, config, refined=True)
    found = kept | {s.observation.frame: s for s in again}
    return _first_upright(found, fresh, observations, T_hand_sensor, T_base_jig, jig, config)


def _first_upright(
    found: dict[int, Station],
    fresh: Sequence[Station],
    observations: Observations,
    T_hand_sensor: Pose,
    T_base_jig: dict[str, Pose],
    jig: Jig,
    config: CalibConfig,
) -> tuple[Station, ...]:
    """Locations whose first used frame, labelled only now, does not show the jig upright get the labels turned."""
    decided = set(observations.T_base_jig) | {f.location for f in observations.frames if f.axis is not None}
    first: dict[str, list[Pose | None]] = {name: [] for name in T_base_jig if name not in decided}
    for f in fresh:
        s = found[f.observation.frame]
        if s.observation.location in first and s.usable:
            first[s.observation.location].append(s.candidates[0])
    turns = {name: upright_turn(poses, jig) for name, poses in first.items()}
    turned = {name: T_base_jig[name] @ turn.pose for name, turn in turns.items() if turn is not None}
    over = tuple(f for f in fresh if f.observation.location in turned)
    anew = label(over, observations.sensor, T_hand_sensor, turned, jig, config, refined=True)
    found = found | {s.observation.frame: s for s in anew}
    return tuple(found[f.observation.frame] for f in fresh)


def settled(before: Sequence[Station], after: Sequence[Station]) -> bool:
    """Whether labels stayed as they were and no axis point moved by more than a small share of its σ."""
    return all(_unchanged(a, b) for a, b in zip(before, after, strict=True))


def _unchanged(a: Station, b: Station) -> bool:
    same = a.reason == b.reason and a.axis.label == b.axis.label and np.array_equal(a.axis.spot, b.axis.spot)
    if not same or a.axis.flag != b.axis.flag:
        return False
    sigma = np.sqrt(np.diagonal(a.axis.cov_yz_mm2, axis1=-2, axis2=-1))
    return bool(np.all(np.abs(b.axis.yz_mm - a.axis.yz_mm) <= SETTLED_SIGMA * sigma))


def _with_offsets(
    frames: Sequence[Station], Ts_sensor_jig: Pose, jig: Jig, sensor: Sensor, config: CalibConfig
) -> list[Station]:
    """Frames (F) that show every string, their axis points by the poses (F)."""
    yz = np.stack([s.observation.points.yz_mm[s.axis.spot] for s in frames])
    cov = np.stack([s.observation.points.cov_yz_mm2[s.axis.spot] for s in frames])
    index = np.array([[jig.strings.index(label) for label in s.axis.label] for s in frames])
    directions = jig.directions[index] @ np.swapaxes(Ts_sensor_jig.R, -1, -2)
    offset, spread = surface_offset(yz, directions, jig.string_diameter_mm / 2, sensor, config.surface)
    points = zip(frames, yz - offset, cov + spread, strict=True)
    return [replace(s, axis=replace(s.axis, yz_mm=p, cov_yz_mm2=c)) for s, p, c in points]
