"""Why a candidate was refused, in words with its own numbers and the parameter that decided."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from extraction import ExtractionConfig


@dataclass(frozen=True)
class Seen:
    """The numbers of one candidate. ``mm_per_px``: size of a pixel in the laser plane."""

    height_dn: float
    noise_dn: float
    length_px: float
    width_px: float
    mm_per_px: float
    score: float  # NaN where no spot was fitted


@dataclass(frozen=True)
class Refusal:
    """One kind of refusal: its sentence, and the key of the parameter that decides (or none)."""

    say: Callable[[Seen, ExtractionConfig], str]
    parameter: str = ""


def _too_long(s: Seen, c: ExtractionConfig) -> str:
    limit = max(c.detect.min_length_px, c.detect.max_length_mm / s.mm_per_px)
    return f"{s.length_px:.0f} px long, at most {limit:.1f} px are a string's spot here: a stripe piece or a reflection"


def _too_wide(s: Seen, c: ExtractionConfig) -> str:
    limit = max(c.detect.min_width_px, c.detect.max_width_mm / s.mm_per_px)
    return f"{s.width_px:.0f} px wide, at most {limit:.1f} px are a string's spot here"


REFUSALS: dict[str, Refusal] = {
    "too_long": Refusal(_too_long, "detect.max_length_mm"),
    "too_wide": Refusal(_too_wide, "detect.max_width_mm"),
    "too_faint": Refusal(
        lambda s, c: f"stands {s.height_dn:.1f} DN above its surroundings, {c.detect.min_height_dn:g} DN are needed",
        "detect.min_height_dn",
    ),
    "in_the_noise": Refusal(
        lambda s, c: (
            f"stands {s.height_dn / max(s.noise_dn, 1e-9):.1f} × above the noise around it, "
            f"{c.detect.threshold:g} × are needed"
        ),
        "detect.threshold",
    ),
    "part_of_brighter": Refusal(
        lambda _s, _c: "its region runs into that of a brighter peak: one spot, counted there", "detect.region_level"
    ),
    "fit_failed": Refusal(
        lambda _s, _c: "no Gaussian spot could be fitted: the fit did not settle, or left the image",
        "localise.max_iterations",
    ),
    "pixel_spike": Refusal(lambda _s, _c: "narrower than the optics can draw: a hot pixel, not light"),
    "fit_wandered": Refusal(
        lambda _s, _c: "the fit moved away from the peak by more than 4 px: no spot of its own", "localise.window_sigma"
    ),
    "low_score": Refusal(
        lambda s, c: (
            f"score {s.score:.3f}: below the least score {c.localise.min_score:g}"
            if s.score < c.localise.min_score
            else f"not among the {c.localise.max_spots} best spots, or outside the laser plane's measured part"
        ),
        "localise.min_score",
    ),
}


def explain(reason: str, seen: Seen, config: ExtractionConfig) -> tuple[str, str]:
    """The sentence for a refusal and the deciding parameter's key; a reason not known here speaks for itself."""
    refusal = REFUSALS.get(reason)
    if refusal is None:
        return reason.replace("_", " "), ""
    return refusal.say(seen, config), refusal.parameter
