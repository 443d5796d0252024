"""Labels and axis points again, once the chain is solved: surface offsets by its poses, doubtful frames anew."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from calib.config import CalibConfig
from calib.label.all_frames import label_frames, stays
from calib.label.refine import upright_turn
from calib.label.surface_offset import surface_offset
from geometry import Frame, Pose, Sensor, Target, stack_poses
from jig_cad import Jig

SETTLED_SIGMA = 0.05  # axis points that moved by less than this share of their σ leave the solution as it is


def relabel(
    before: Sequence[Frame],
    fresh: Sequence[Frame],
    target: Target,
    sensor: Sensor,
    T_hand_sensor: Pose,
    places: Mapping[str, Pose],
    decided: Mapping[str, Pose],
    config: CalibConfig,
) -> tuple[Frame, ...]:
    """Complete frames that stand where the chain has them get their surface offsets by its pose; others new labels.

    before: as labelled so far. fresh: the frames without labels, with the solved chain's hand poses. places:
    T_base_target by the chain; it decides the half turn, unless an earlier frame than before is the location's first
    used one now: then x_jig · x_sensor > 0 there. decided: places that were given and stay.
    """
    if not isinstance(target, Jig):  # the points of a surface carry no offset, and no choice was made
        return tuple(replace(f, hand=g.hand) for f, g in zip(before, fresh, strict=True))
    kept, moved = dict[int, Frame](), dict[int, Pose]()
    for f, g in zip(before, fresh, strict=True):
        place = places.get(f.location)
        if f.labels_given:
            kept[f.number] = replace(f, hand=g.hand)
        elif place is not None and len(f.axis) == len(target.strings):
            predicted = (g.at @ T_hand_sensor).inverse() @ place
            if stays(f, predicted):
                kept[f.number] = replace(f, hand=g.hand)
                moved[f.number] = predicted
    if moved:
        complete = [kept[number] for number in moved]
        offsets = _with_offsets(complete, stack_poses(list(moved.values())), target, sensor, config)
        kept |= dict(zip(moved, offsets, strict=True))
    doubtful = tuple(g for g in fresh if g.number not in kept)
    again = label_frames(doubtful, target, sensor, T_hand_sensor, places, config, refined=True)
    found = kept | {f.number: f for f in again}
    turned = _first_not_upright([found[g.number] for g in fresh], target, places, decided)
    over = tuple(g for g in fresh if g.location in turned)
    anew = label_frames(over, target, sensor, T_hand_sensor, turned, config, refined=True)
    found |= {f.number: f for f in anew}
    return tuple(found[g.number] for g in fresh)


def _first_not_upright(
    frames: Sequence[Frame], jig: Jig, places: Mapping[str, Pose], decided: Mapping[str, Pose]
) -> dict[str, Pose]:
    """Turned places of locations whose first used frame, labelled only now, does not show the jig upright."""
    given = set(decided) | {f.location for f in frames if f.labels_given}
    first: dict[str, list[Pose | None]] = {name: [] for name in places if name not in given}
    for f in frames:
        if f.location in first and f.usable:
            first[f.location].append(f.candidates[0])
    turns = {name: upright_turn(poses, jig) for name, poses in first.items()}
    return {name: places[name] @ turn.pose for name, turn in turns.items() if turn is not None}


def settled(before: Sequence[Frame], after: Sequence[Frame]) -> bool:
    """Whether labels stayed as they were and no axis point moved by more than a small share of its σ."""
    return all(_unchanged(a, b) for a, b in zip(before, after, strict=True))


def _unchanged(a: Frame, b: Frame) -> bool:
    same = a.reason == b.reason and a.axis.label == b.axis.label and np.array_equal(a.axis.spot, b.axis.spot)
    if not same or a.axis.flag != b.axis.flag:
        return False
    return bool(np.all(np.abs(b.axis.yz_mm - a.axis.yz_mm) <= SETTLED_SIGMA * a.axis.sigma_yz_mm))


def _with_offsets(
    frames: Sequence[Frame], Ts_sensor_jig: Pose, jig: Jig, sensor: Sensor, config: CalibConfig
) -> list[Frame]:
    """Frames (F) that show every string, their axis points by the poses (F)."""
    yz = np.stack([f.points.yz_mm[f.axis.spot] for f in frames])
    cov = np.stack([f.points.cov_yz_mm2[f.axis.spot] for f in frames])
    index = np.array([[jig.strings.index(label) for label in f.axis.label] for f in frames])
    directions = jig.directions[index] @ np.swapaxes(Ts_sensor_jig.R, -1, -2)
    offset, spread = surface_offset(yz, directions, jig.string_diameter_mm / 2, sensor, config.surface)
    points = zip(frames, yz - offset, cov + spread, offset, strict=True)
    return [replace(f, axis=replace(f.axis, yz_mm=p, cov_yz_mm2=c, offset_mm=o)) for f, p, c, o in points]
