"""Everything that extraction saw on its way from the image to the points, for overlays and the process window."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.config import ExtractionConfig
from extraction.image import Image
from extraction.reasons import Reason
from extraction.spots.detect import Candidates, Image32, PreparedImage, filled
from extraction.spots.detect.blur import BLOCK_PX
from geometry import Sensor, SurfacePoints

FLOODED_SHARE = 0.5  # of clipped pixels, above which the image is said to be saturated


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


def why_empty(prepared: PreparedImage, candidates: Candidates, sensor: Sensor) -> str:
    """One sentence on why an image gave no spot."""
    camera = sensor.require_camera()
    image = prepared.image
    if image.min() == image.max():
        return f"the image is blank: every pixel holds grey level {int(image.min())}"
    if np.mean(image >= camera.saturation_dn) > FLOODED_SHARE:
        return f"more than half of the image is saturated ({camera.saturation_dn}): lower the exposure"
    if not len(candidates) and filled(prepared):
        return FILLED_SENTENCE
    if not len(candidates):
        return "nothing stands above the noise: no laser in the image, or it is too dark"
    counts = {reason: candidates.reason.count(reason) for reason in dict.fromkeys(candidates.reason)}
    listed = ", ".join(f"{number} {reason}" for reason, number in sorted(counts.items(), key=lambda c: -c[1]))
    return f"none of {len(candidates)} candidates is a string spot: {listed}"


FILLED_SENTENCE = (
    f"the image is full of light at distances about or below the {BLOCK_PX} px over which background and noise are "
    "measured: spots nearer to each other than some 12 px all over the image are taken for noise, so that some or all "
    "are lost"
)


def left_out(prepared: PreparedImage, candidates: Candidates, config: ExtractionConfig) -> Iterator[str]:
    """A sentence for each limit of number that left something out, with the setting that holds it; and where dots are
    too near to each other to be found.
    """
    if filled(prepared):
        yield FILLED_SENTENCE
    elif prepared.too_fine:
        yield FILLED_SENTENCE.replace("the image is", "a part of the image is").replace("all over the image", "there")
    beyond, spots = candidates.beyond, config.localise.max_spots
    if beyond:
        most = config.detect.max_candidates
        yield (
            f"{most + beyond} peaks stand above the noise and the {most} brightest were looked at, {beyond} left "
            "out: max_candidates of [detect] may be raised, or threshold"
        )
    cut = candidates.reason.count(Reason.BEYOND_MAX_SPOTS)
    if cut:
        yield (
            f"{spots + cut} spots were found and the {spots} best kept, {cut} left out: max_spots of [localise] "
            "may be raised"
        )
