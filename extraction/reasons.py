"""Why a candidate is no string spot, and why a spot is doubted: each reason with its sentence and deciding setting.

The words are those of `Candidates.reason`, of a point's `flag` and of the files; the window, the pictures of the stages
and the reports say what they mean by `explain`.
"""

from __future__ import annotations

import math
from enum import StrEnum
from typing import NamedTuple

from extraction.config import ExtractionConfig


class Reason(StrEnum):
    """Every reason, in the order in which they are looked for."""

    # refused by its region
    TOO_WIDE = "too_wide"
    TOO_LONG = "too_long"
    PART_OF_BRIGHTER = "part_of_brighter"
    TOO_FAINT = "too_faint"
    IN_THE_NOISE = "in_the_noise"
    OUTSIDE_REGION = "outside_region"
    # refused after the fit
    LOW_SCORE = "low_score"
    NOT_IN_THE_SHEET = "not_in_the_sheet"
    FIT_WANDERED = "fit_wandered"
    FIT_FAILED = "fit_failed"
    PIXEL_SPIKE = "pixel_spike"
    BEYOND_MAX_SPOTS = "beyond_max_spots"
    # kept, with a flag
    PARTLY_HIDDEN = "partly_hidden"
    ODD_SHAPE = "odd_shape"
    CROWDED = "crowded"
    SATURATED = "saturated"


FLAGS = (Reason.PARTLY_HIDDEN, Reason.ODD_SHAPE, Reason.CROWDED, Reason.SATURATED)


class Seen(NamedTuple):
    """The numbers of one candidate. mm_per_px: size of a pixel in the laser plane; score: NaN where none was given."""

    height_dn: float
    noise_dn: float
    length_px: float
    width_px: float
    mm_per_px: float
    score: float = math.nan


class Meaning(NamedTuple):
    """What a reason says: a sentence with the numbers of `Seen`, of the limits and of the settings in braces, and the
    key of the setting that decides, "" where none does.
    """

    sentence: str
    key: str = ""


MEANINGS: dict[Reason, Meaning] = {
    Reason.TOO_WIDE: Meaning(
        "{seen.width_px:.0f} px wide, at most {widest_px:.1f} px are a string's spot here", "detect.max_width_mm"
    ),
    Reason.TOO_LONG: Meaning(
        "{seen.length_px:.0f} px long, at most {longest_px:.1f} px are a string's spot here: a stripe piece or a "
        "reflection",
        "detect.max_length_mm",
    ),
    Reason.PART_OF_BRIGHTER: Meaning(
        "its region runs into that of a brighter peak: one spot, counted there", "detect.region_level"
    ),
    Reason.TOO_FAINT: Meaning(
        "stands {seen.height_dn:.1f} DN above its surroundings, {config.detect.min_height_dn:g} DN are needed",
        "detect.min_height_dn",
    ),
    Reason.IN_THE_NOISE: Meaning(
        "stands {over_noise:.1f} × above the noise around it, {config.detect.threshold:g} × are needed",
        "detect.threshold",
    ),
    Reason.OUTSIDE_REGION: Meaning("lies outside the region that is looked at", "region.keep"),
    Reason.LOW_SCORE: Meaning(
        "score {seen.score:.3f}: below the least score {config.localise.min_score:g}", "localise.min_score"
    ),
    Reason.NOT_IN_THE_SHEET: Meaning(
        "its ray does not meet the laser plane before the sensor, or the lens model has no inverse there"
    ),
    Reason.FIT_WANDERED: Meaning(
        "the fit moved away from the region's centre by more than {config.doubt.max_move_sigma:g} spot widths and "
        "{config.doubt.max_move_px:g} px: no spot of its own",
        "doubt.max_move_sigma",
    ),
    Reason.FIT_FAILED: Meaning(
        "no Gaussian spot could be fitted: the fit did not settle, or left the image", "localise.max_iterations"
    ),
    Reason.PIXEL_SPIKE: Meaning(
        "narrower than {config.localise.min_sigma_px:g} px, than the optics can draw: a hot pixel, not light",
        "localise.min_sigma_px",
    ),
    Reason.BEYOND_MAX_SPOTS: Meaning(
        "not among the {config.localise.max_spots} best spots of the image", "localise.max_spots"
    ),
    Reason.PARTLY_HIDDEN: Meaning(
        "lopsided along its long axis by more than {config.doubt.max_skew_sigma:g} σ: something cuts it",
        "doubt.max_skew_sigma",
    ),
    Reason.ODD_SHAPE: Meaning(
        "departs from a Gaussian by more than {config.doubt.max_misfit:g} × what noise and speckle make: two strings "
        "in one, or half a post",
        "doubt.max_misfit",
    ),
    Reason.CROWDED: Meaning("another candidate lies within four widths"),
    Reason.SATURATED: Meaning("pixels within it are saturated: a lower exposure would tell more"),
}


def explain(reason: str, seen: Seen, config: ExtractionConfig) -> tuple[str, str]:
    """What a reason says of one candidate.

    Parameters
    ----------
    reason
        A `Reason`, or its word.
    seen
        The candidate's own numbers.
    config
        The settings that it was looked at with.

    Returns
    -------
    sentence, key
        One sentence with the candidate's numbers beside the limit, and the key of the setting that decided.

    Raises
    ------
    ValueError
        The word is no `Reason`.
    """
    meaning = MEANINGS[Reason(reason)]
    detect = config.detect
    sentence = meaning.sentence.format(
        seen=seen,
        config=config,
        longest_px=max(detect.min_length_px, detect.max_length_mm / seen.mm_per_px),
        widest_px=max(detect.min_width_px, detect.max_width_mm / seen.mm_per_px),
        over_noise=seen.height_dn / max(seen.noise_dn, 1e-9),
    )
    return sentence, meaning.key
