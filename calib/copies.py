"""Frames in one order whatever the file's, and copies of a frame: what was recorded once counts once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from geometry import Frame

Array = NDArray[np.float64]

COPY = "copy"  # why a frame is left out whose twin is used


def in_order(frames: Sequence[Frame]) -> tuple[Frame, ...]:
    """The frames by their numbers: sums over them and what is decided by the first of them hang on no file's order."""
    return tuple(sorted(frames, key=lambda f: f.number))


def without_copies(frames: Sequence[Frame]) -> tuple[Frame, ...]:
    """The frames, those that repeat an earlier one of their location to the last digit with the reason "copy".

    Noise never repeats itself: equal points are one recording, be it of one image or of two files of it.
    """
    seen: set[tuple[str, bytes, bytes]] = set()
    out = []
    for f in frames:
        points = _points(f)
        key = (f.location, points, _hand(f))
        out.append(replace(f, reason=COPY) if points and f.usable and key in seen else f)
        seen.add(key)
    return tuple(out)


def copy_notes(frames: Sequence[Frame]) -> tuple[str, ...]:
    """Sentences on copies that were left out, and on one recording that stands at two places or with two readings."""
    groups: dict[bytes, list[Frame]] = {}
    for f in frames:
        if points := _points(f):
            groups.setdefault(points, []).append(f)
    twins = [g for g in groups.values() if len(g) > 1]
    copies = [f.number for f in frames if f.reason == COPY]
    notes = []
    if copies:
        same = "; ".join(_listed([f.number for f in g]) for g in twins if any(f.reason == COPY for f in g))
        notes.append(
            f"{len(copies)} of {len(frames)} frames are copies of others to the last digit and count once ({same})"
        )
    for g in twins:
        where = list(dict.fromkeys(f.location for f in g))
        readings = {_hand(f) for f in g}
        if len(where) > 1:
            notes.append(
                f"frames {_listed([f.number for f in g])} are one recording at locations {', '.join(where)}: only one "
                "can be right"
            )
        elif len(readings) > 1:
            notes.append(
                f"frames {_listed([f.number for f in g])} are one recording with different joint readings or poses: "
                "only one of them can be right; check the image column of frames.csv, or the frame column of points.csv"
            )
    return tuple(notes)


def _listed(numbers: Sequence[int]) -> str:
    return " = ".join(map(str, numbers))


def _points(f: Frame) -> bytes:
    """What was measured in a frame, to the last digit; empty where nothing was."""
    if not len(f.points) and not len(f.axis):
        return b""
    counts = f.labels_given or not len(f.points)
    axis = "\0".join(f.axis.label).encode() + np.ascontiguousarray(f.axis.yz_mm).tobytes() if counts else b""
    return b"|".join([_sorted(f.points.yz_mm), _sorted(f.points.uv_px), axis])


def _hand(f: Frame) -> bytes:
    """Where a frame's hand was, to the last digit."""
    pose = b"" if f.T_base_hand is None else f.T_base_hand.matrix.tobytes()
    return (b"" if f.joints_rad is None or f.joints_inferred else f.joints_rad.tobytes()) + pose


def _sorted(points: Array) -> bytes:
    rounded = points + 0.0  # no minus zero
    return rounded[np.lexsort(rounded.T)].tobytes()
