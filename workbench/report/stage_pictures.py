"""One picture for every stage of extraction: raw, background, mask, candidates with reasons, spots, labels; regions."""

from __future__ import annotations

import itertools
from collections import Counter
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction import ExtractionConfig, Stages, extract_stages, region_shapes
from geometry import AxisPoints, Frame, Sensor, write_text
from workbench.files import Image, write_png
from workbench.report.overlays import LABELLED, Colour, brighten, mark, overlay, write

SMALLEST_PX, LARGEST_PX = 6.0, 40.0  # circles of candidates
NAME_PX = (130, 18)  # room that a reason's name takes: where another stands, only the circle's colour tells
REASONS: tuple[Colour, ...] = (
    (60, 190, 255), (255, 170, 80), (200, 120, 255), (120, 120, 255), (230, 230, 110), (150, 200, 160), (200, 200, 200),
)  # fmt: skip


def save_stages(
    folder: Path, image: Image, sensor: Sensor, frame: Frame, config: ExtractionConfig | None = None
) -> None:
    """Write the six pictures of one frame and the shapes of its candidates' regions into ``folder``/NNN."""
    stages = extract_stages(image, sensor, config)
    unlabelled = replace(frame, points=stages.points, axis=AxisPoints.empty(), reason=stages.reason or None)
    pictures = {
        "1_raw": brighten(image, sensor),
        "2_background": brighten(stages.background.clip(0, sensor.require_camera().saturation_dn), sensor),
        "3_mask": stages.mask.astype(np.uint8) * 255,
        "4_candidates": _candidates(image, sensor, stages),
        "5_spots": overlay(image, sensor, unlabelled),
        "6_labels": overlay(image, sensor, frame),
    }
    for name, picture in pictures.items():
        write_png(folder / f"{frame.number:03d}" / f"{name}.png", picture, compression=3)
    write_text(folder / f"{frame.number:03d}" / "regions.csv", _regions(stages))


def _regions(stages: Stages) -> str:
    """A row for every candidate that grew a region: its reason, and its shape."""
    columns = region_shapes(stages)
    rows = zip(*columns.values(), strict=True)
    lines = [",".join(f"{x:.6g}" if isinstance(x, np.floating) else str(x) for x in row) for row in rows]
    return "\n".join([",".join(columns), *lines]) + "\n"


def _candidates(image: Image, sensor: Sensor, stages: Stages) -> NDArray[Any]:
    """Kept candidates in green, refused ones in a colour of their reason, which is written where there is room."""
    picture = cv2.cvtColor(brighten(image, sensor), cv2.COLOR_GRAY2BGR)
    found = stages.candidates
    counts = Counter(reason for reason in found.reason if reason)
    colours = dict(zip((reason for reason, _ in counts.most_common()), itertools.cycle(REASONS)))
    named: list[tuple[int, int]] = []
    for i in np.argsort([bool(reason) for reason in found.reason], kind="stable")[::-1]:  # kept ones on top
        u, v = found.peak_uv_px[i]
        reason = found.reason[i]
        size = float(found.length_px[i]) if np.isfinite(found.length_px[i]) else SMALLEST_PX
        mark(picture, (u, v), float(np.clip(size, SMALLEST_PX, LARGEST_PX)), colours.get(reason, LABELLED))
        place = int(u) + 10, int(v) - 8
        if reason and all(abs(place[0] - x) > NAME_PX[0] or abs(place[1] - y) > NAME_PX[1] for x, y in named):
            write(picture, place, reason, colours[reason], 0.5)
            named.append(place)
    kept = len(found) - sum(counts.values())
    write(picture, (12, 30), f"{kept} of {len(found)} candidates kept", LABELLED, 0.7)
    for line, (reason, number) in enumerate(counts.most_common(), start=1):
        write(picture, (12, 30 + 24 * line), f"{number} {reason}", colours[reason], 0.6)
    return np.asarray(picture)
