"""What the numbers of `[score]` and `[doubt]` decide: each halved and doubled, on rendered cells.

Frames of the cells of extraction_cells.py: posts, a wall behind, speckle, a thread of random gloss each. Strings
of which at least 0.9 is seen count. "found": a spot lies within 8 px of the string's image. "first": strings whose
score is above that of every spot that is no string. "others": spots a frame that are no string; labels drop them later.
Run: python benchmarks/extraction_score.py [cells, default 4] [first seed, default 1]
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import cv2
import numpy as np
from extraction_cells import drawn_cell

from extraction import ExtractionConfig, extract
from geometry import SurfacePoints
from workbench.campaign import render_frame
from workbench.compare import GATE_PX, VISIBLE

TABLES = ("score", "doubt")
FACTORS = (0.5, 2.0)
SHARES = ("saturated", "least_likeness", "trusted")  # at most 1


def variations() -> Iterator[tuple[str, ExtractionConfig]]:
    """The defaults, and each number halved and doubled where the model allows it."""
    plain = ExtractionConfig()
    yield "defaults", plain
    for table in TABLES:
        section = getattr(plain, table)
        for name, value in section.model_dump().items():
            for factor in FACTORS:
                changed = min(value * factor, 1.0) if name in SHARES else value * factor
                changed = max(round(changed), 1) if isinstance(value, int) else changed
                config = ExtractionConfig.model_validate({table: {name: changed}})
                yield f"{table}.{name} {value:g} → {changed:g}", config


def counted(points: SurfacePoints, images: np.ndarray) -> np.ndarray:
    """Strings, found, first, flagged, and spots that are no string, of one frame with string images (N, 2)."""
    distance = np.linalg.norm(points.uv_px[:, None] - images, axis=2)
    other = distance.min(axis=1, initial=np.inf) > GATE_PX
    best = points.score[other].max(initial=0.0)
    found = first = flagged = 0
    for column in distance.T:
        if len(column) and column.min() <= GATE_PX:
            k = int(column.argmin())
            found, first, flagged = found + 1, first + (points.score[k] > best), flagged + (points.flag[k] != "")
    return np.array([len(images), found, first, flagged, other.sum()])


def main() -> None:
    """Print a row for each variation."""
    cv2.setNumThreads(1)
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 4
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    frames = []
    for k in range(seed, seed + cells):
        emulated, _ = drawn_cell(k, hide=False)
        for c in emulated.configurations:
            frame = render_frame(emulated, c, np.random.SeedSequence(k))
            seen = [s.image_px for s in frame.truth.strings if s.visible_fraction >= VISIBLE]
            frames.append((frame.image, np.array(seen, dtype=float).reshape(-1, 2), emulated.cell.sensor))
    print(f"{len(frames)} frames            strings    found    first  flagged   others a frame")
    for name, config in variations():
        n, found, first, flagged, others = sum(counted(extract(im, s, config), uv) for im, uv, s in frames)
        shares = [100 * x / n for x in (found, first, flagged)]
        print(f"{name:34s} {n:6d} {shares[0]:7.2f} % {shares[1]:6.2f} % {shares[2]:6.2f} % {others / len(frames):8.2f}")


if __name__ == "__main__":
    main()
