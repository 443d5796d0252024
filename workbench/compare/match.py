"""Labelled points of a frame against its truth: found, missed, false, mislabelled, and errors in px and mm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

VISIBLE = 0.9  # docs/formats.md: "visible" in every figure means at least this fraction of the lit patch
GATE_PX = 8.0  # a point further than this from every string's image shows no string


class StringTruthLike(Protocol):
    """One string as the emulator or a truth.json knows it."""

    @property
    def label(self) -> str:
        """The string's name."""

    @property
    def axis_mm(self) -> ArrayLike | None:
        """Axis point (y, z) [mm]."""

    @property
    def image_px(self) -> ArrayLike | None:
        """Ideal image centroid (u, v)."""

    @property
    def visible_fraction(self) -> float:
        """Part of the lit patch that is seen."""


@dataclass(frozen=True, eq=False)
class FrameScore:
    """Counts of one frame, and the errors (found minus true) of its rightly labelled, visible points.

    point: index of the point of each error row (K,). error_mm: axis point (y, z) (K, 2). error_px: spot (u, v) (K, 2).
    """

    visible: int
    found: int
    false: int
    mislabelled: int
    point: NDArray[np.intp]
    error_mm: Array
    error_px: Array


def score_frame(truth: Sequence[StringTruthLike], label: Sequence[str], uv_px: Array, yz_mm: Array) -> FrameScore:
    """Score the labelled points (N,) with spots (N, 2) [px] and axis points (N, 2) [mm] against the frame's strings.

    A point belongs to the string whose image is nearest, within GATE_PX. A string seen in part, below VISIBLE, may be
    found or missing; its errors do not count.
    """
    shown = [s for s in truth if s.image_px is not None and np.all(np.isfinite(np.asarray(s.image_px, dtype=float)))]
    images = np.array([s.image_px for s in shown], dtype=float).reshape(-1, 2)
    visible = {s.label for s in shown if s.visible_fraction >= VISIBLE}
    points: list[int] = []
    mm: list[Array] = []
    px: list[Array] = []
    false = wrong = 0
    for i, name in enumerate(label):
        distance = np.linalg.norm(images - uv_px[i], axis=1)
        if len(distance) == 0 or distance.min() > GATE_PX:
            false += 1
            continue
        string = shown[int(np.argmin(distance))]
        if string.label != name:
            wrong += 1
        elif name in visible:
            points.append(i)
            mm.append(yz_mm[i] - np.asarray(string.axis_mm, dtype=float))
            px.append(uv_px[i] - np.asarray(string.image_px, dtype=float))
    return FrameScore(
        len(visible),
        len(points),
        false,
        wrong,
        np.array(points, dtype=np.intp),
        np.array(mm).reshape(-1, 2),
        np.array(px).reshape(-1, 2),
    )
