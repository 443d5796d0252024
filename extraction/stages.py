"""Everything that extraction saw on its way from the image to the points, for overlays and the process window."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.candidates import Candidates
from extraction.preprocess import Image, Image32
from geometry import SurfacePoints


@dataclass(frozen=True, eq=False)
class Stages:
    """The stages of one image.

    raw: grey levels (H, W). background: local background of the blurred image (H, W) [DN]. mask: pixels that stand
    above background and noise (H, W). candidates: every peak looked at, with the reason it was refused ("" = kept).
    points: the spots, and candidate: the candidate of each (N,). reason: why there are no points, "" where there are.
    """

    raw: Image
    background: Image32
    mask: NDArray[np.bool_]
    candidates: Candidates
    points: SurfacePoints
    candidate: NDArray[np.intp]
    reason: str
