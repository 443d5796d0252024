"""What the process window and the tuner know of each setting: its useful range, and whether a search may move it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass


@dataclass(frozen=True)
class Slider:
    """The useful range of a setting, narrower than what its model allows.

    basic: shown without unfolding. log: even steps are factors. search: whether the tuner may move it. low, high: None
    where the setting is no number, or its model's own bounds do.
    """

    low: float | None = None
    high: float | None = None
    basic: bool = False
    log: bool = False
    search: bool = True


SLIDERS: Mapping[str, Slider] = {
    "noise.read_noise_dn": Slider(0, 20, search=False),
    "noise.gain_dn_per_e": Slider(0.001, 1, log=True, search=False),
    "noise.full_well_e": Slider(500, 200_000, log=True, search=False),
    "noise.speckle_contrast": Slider(0, 1, search=False),
    "noise.model_error": Slider(0, 0.1),
    "noise.speckle_weight": Slider(0, 1, basic=True),
    "noise.speckle_grain_px": Slider(0.2, 1.7, search=False),
    "detect.blur_sigma_px": Slider(0.5, 4, basic=True),
    "detect.threshold": Slider(3, 40, basic=True, log=True),
    "detect.min_height_dn": Slider(0, 60, basic=True),
    "detect.region_level": Slider(0.1, 0.9),
    "detect.max_length_mm": Slider(0.3, 15, basic=True, log=True),
    "detect.max_width_mm": Slider(0.1, 6, basic=True, log=True),
    "detect.min_length_px": Slider(2, 60, log=True),
    "detect.min_width_px": Slider(1, 40, log=True),
    "detect.max_candidates": Slider(10, 20_000, log=True, search=False),
    "localise.method": Slider(basic=True, search=False),
    "localise.window_sigma": Slider(1, 6),
    "localise.max_half_window_px": Slider(3, 60, search=False),
    "localise.max_iterations": Slider(1, 100, search=False),
    "localise.min_sigma_px": Slider(basic=True, search=False),
    "localise.max_spots": Slider(1, 100, basic=True, search=False),
    "localise.min_score": Slider(0, 1, basic=True),
}
FILE_ONLY = ("score", "doubt")  # tables that a settings file may hold, and that nobody needs to move by hand
