"""One picture for every stage of extraction: raw, background, mask, candidates with reasons, spots, labels."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction import ExtractionConfig, Stages, extract_stages
from geometry import AxisPoints, SensorModel
from workbench.formats.images import Image, write_png
from workbench.points_table import FrameTable
from workbench.results.overlay import FLAGGED, LABELLED, brighten, mark, overlay, write

MAX_NAMED = 60  # refused candidates whose reason is written out; a noisy image has thousands


def save_stages(
    folder: Path, image: Image, sensor: SensorModel, table: FrameTable, config: ExtractionConfig | None = None
) -> None:
    """Write the six pictures of one frame into ``folder``/NNN."""
    stages = extract_stages(image, sensor, config)
    unlabelled = FrameTable(table.frame, table.image, stages.points, AxisPoints.empty(), stages.reason or None)
    pictures = {
        "1_raw": brighten(image, sensor),
        "2_background": brighten(stages.background.clip(0, sensor.saturation_dn), sensor),
        "3_mask": stages.mask.astype(np.uint8) * 255,
        "4_candidates": _candidates(image, sensor, stages),
        "5_spots": overlay(image, sensor, unlabelled),
        "6_labels": overlay(image, sensor, table),
    }
    for name, picture in pictures.items():
        write_png(folder / f"{table.frame:03d}" / f"{name}.png", picture, compression=3)


def _candidates(image: Image, sensor: SensorModel, stages: Stages) -> NDArray[Any]:
    """Kept candidates in green, refused ones in amber with their reason."""
    picture = cv2.cvtColor(brighten(image, sensor), cv2.COLOR_GRAY2BGR)
    found = stages.candidates
    for i in range(len(found)):
        u, v = found.peak_uv_px[i]
        kept = not found.reason[i]
        colour = LABELLED if kept else FLAGGED
        mark(picture, (u, v), max(float(found.length_px[i]), 6.0) if np.isfinite(found.length_px[i]) else 6.0, colour)
        if not kept and i < MAX_NAMED:
            write(picture, (int(u) + 10, int(v) - 8), found.reason[i], colour, 0.5)
    refused = sum(bool(r) for r in found.reason)
    title = f"{len(found) - refused} of {len(found)} candidates kept"
    write(picture, (12, 30), title, (240, 240, 240), 0.7)
    return np.asarray(picture)
