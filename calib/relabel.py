"""Labels and axis points again, once the chain is solved: surface offsets by its poses, doubtful frames anew."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.axis_offset import axis_points
from calib.config import CalibConfig
from calib.label_refine import take
from calib.observation import Observations
from calib.stations import Station, label, stays
from geometry import AxisPoints, Pose, SensorModel
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

    fresh: the frames with the solved chain's hand poses. T_base_jig: by the chain; it decides the half turn.
    """
    kept: dict[int, Station] = {}
    for s, f in zip(ready, fresh, strict=True):
        place, frame = T_base_jig.get(s.observation.location), s.observation.frame
        if s.observation.axis is not None:
            kept[frame] = replace(s, T_base_hand=f.T_base_hand)
        elif place is not None and len(s.axis) == len(jig.strings):
            predicted = (f.T_base_hand @ T_hand_sensor).inverse() @ place
            if stays(s, predicted):
                axis = _with_offsets(s, predicted, jig, observations.sensor, config)
                kept[frame] = replace(s, T_base_hand=f.T_base_hand, axis=axis)
    doubtful = tuple(f for f in fresh if f.observation.frame not in kept)
    again = label(doubtful, observations.sensor, T_hand_sensor, T_base_jig, jig, config, refined=True)
    found = kept | {s.observation.frame: s for s in again}
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


def _with_offsets(s: Station, T_sensor_jig: Pose, jig: Jig, sensor: SensorModel, config: CalibConfig) -> AxisPoints:
    spots = take(s.observation.points, s.axis.spot)
    yz, cov = axis_points(spots, s.axis.label, jig, sensor, T_sensor_jig, config)
    return replace(s.axis, yz_mm=yz, cov_yz_mm2=cov)
