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
    "localise.max_spots": Slider(1, 5000, basic=True, log=True, search=False),
    "localise.min_score": Slider(0, 1, basic=True),
    "stripe.direction": Slider(basic=True, search=False),
    "stripe.along_normal": Slider(search=False),
    "stripe.select": Slider(basic=True, search=False),
    "stripe.min_amplitude_dn": Slider(0, 60, basic=True, search=False),
    "stripe.min_snr": Slider(0, 20, basic=True, search=False),
    "stripe.min_width_px": Slider(0.2, 4, search=False),
    "stripe.max_width_px": Slider(1, 40, basic=True, log=True, search=False),
    "stripe.max_chi2_per_dof": Slider(1.5, 100, basic=True, log=True, search=False),
    "stripe.read_noise_dn": Slider(0, 20, search=False),
    "stripe.gain_dn_per_e": Slider(0.001, 1, log=True, search=False),
    "stripe.speckle_contrast": Slider(0, 1, search=False),
    "stripe.min_run": Slider(3, 200, basic=True, log=True, search=False),
    "feature.tolerance_sigma": Slider(1, 20, basic=True, log=True, search=False),
    "feature.min_tolerance_mm": Slider(0.001, 1, basic=True, log=True, search=False),
    "feature.inlier_sigma": Slider(1.5, 10, search=False),
    "feature.min_points": Slider(4, 200, basic=True, log=True, search=False),
    "feature.min_run": Slider(1, 50, search=False),
    "feature.ransac_trials": Slider(10, 20_000, log=True, search=False),
    "feature.ransac_certainty": Slider(0.9, 0.9999999, search=False),
    "feature.ransac_points": Slider(20, 2000, log=True, search=False),
    "feature.min_section": Slider(0.02, 0.95, search=False),
    "feature.max_section": Slider(1.01, 3, search=False),
    "feature.min_arc_deg": Slider(5, 170, search=False),
    "feature.max_radius_mm": Slider(5, 2000, log=True, search=False),
    "feature.rival_share": Slider(0.05, 0.95, search=False),
    "feature.rival_section": Slider(0.05, 0.95, search=False),
    "feature.min_line_mm": Slider(1, 100, basic=True, log=True, search=False),
    "feature.max_bend": Slider(0.001, 0.2, log=True, search=False),
    "feature.min_wedge_deg": Slider(2, 80, search=False),
    "feature.max_ridge_gap_mm": Slider(0.2, 20, log=True, search=False),
    "gapflush.reference": Slider(basic=True, search=False),
    "gapflush.min_face_mm": Slider(0.5, 20, basic=True, log=True, search=False),
    "gapflush.face_length_mm": Slider(1, 40, basic=True, log=True, search=False),
    "gapflush.tolerance_mm": Slider(0.005, 1, basic=True, log=True, search=False),
    "gapflush.max_angle_deg": Slider(5, 85, search=False),
    "gapflush.min_gap_mm": Slider(0.02, 5, log=True, search=False),
    "gapflush.max_gap_mm": Slider(1, 100, basic=True, log=True, search=False),
    "gapflush.max_radius_mm": Slider(0.5, 30, log=True, search=False),
    "gapflush.max_step_mm": Slider(0.05, 5, log=True, search=False),
    "gapflush.max_arc_deg": Slider(20, 89, search=False),
    "gapflush.min_arc_deg": Slider(5, 85, search=False),
    "gapflush.max_chi2_per_dof": Slider(1.1, 50, log=True, search=False),
}
# what a settings file may hold, and what nobody needs to move by hand, or what the page has a tool of its own for
FILE_ONLY = (
    "score", "doubt", "region", "what", "measure", "calib", "tolerances", "stripe.region_px", "gapflush.definition",
    "gapflush.axis", "gapflush.tangent_deg", "gapflush.fixed_radius_mm", "gapflush.gauge_depth_mm",
    "gapflush.gauge_offset_mm",
)  # fmt: skip
