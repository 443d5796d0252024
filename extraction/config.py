"""The settings of extraction with their defaults: string spots, stripes, gap and flush.

What is None is estimated from the image. A description says what a number is; the comment above it where the default
comes from, where that is not the description itself. The ranges that the process window shows are its own matter.
"""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

MAX_GRAIN_PX = 1.7  # a coarser grain is correlated beyond the distances that the error budget tells apart

Direction = Literal["auto", "columns", "rows"]
GapDefinition = Literal["extreme", "tangent", "edge", "fixed_radius", "gauge"]
Selection = Literal["stripe", "strongest", "first", "last", "continuous", "all"]


class _Section(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class SpotNoiseConfig(_Section):
    """The camera's and the speckle's noise; what is None is estimated from the frame itself."""

    read_noise_dn: float | None = Field(default=None, ge=0, description="camera noise without light [DN]")
    gain_dn_per_e: float | None = Field(default=None, ge=0, description="shot noise: grey levels per electron")
    # of industrial chips with pixels of 3 to 5 µm, as their makers' data sheets say
    full_well_e: float = Field(default=10_000.0, gt=0, description="electrons at saturation, where no gain is given")
    speckle_contrast: float | None = Field(
        default=None, ge=0, le=1, description="standard deviation of a pixel's speckle over its signal"
    )
    # strings of 0.1 to 0.5 mm need 0.4 to 1.4 % (benchmarks/extraction_model_error.py)
    model_error: float = Field(
        default=0.01, ge=0, le=0.5, description="a spot's wings depart from the Gaussian by this share of its height"
    )
    # of unpolarised light's speckle of the usual grain, 0.7 px, over a pixel (Goodman 2007, section 4.6)
    speckle_weight: float = Field(default=0.4, ge=0, le=1, description="contrast by which the fit weighs bright pixels")
    speckle_grain_px: float | None = Field(
        default=None, ge=0, le=MAX_GRAIN_PX, description="the speckle's grain on the chip, λF#(1 + m)"
    )


class DetectConfig(_Section):
    """What counts as a spot."""

    # about a string's own width under the nominal optics: the matched filter for white noise
    blur_sigma_px: float = Field(default=1.3, ge=0.3, le=10, description="matched blur [px]")
    # Gaussian noise alone gets there once in 10^12 pixels
    threshold: float = Field(
        default=7.0, gt=0, description="height of a spot over the local noise of the blurred image"
    )
    # dimly lit threads and the texture of plates stay below it
    min_height_dn: float = Field(default=2.0, ge=0, description="height of a blurred spot over its surroundings [DN]")
    region_level: float = Field(
        default=0.4, gt=0.05, lt=0.95, description="share of the height at which the shape is taken"
    )
    # a string of 1 mm at 60° to the normal of a sheet of 1 mm: 1/cos 60° + tan 60° = 3.7 mm
    max_length_mm: float = Field(default=4.0, gt=0, description="longest spot, in the laser plane [mm]")
    # the same string and the blur about it
    max_width_mm: float = Field(
        default=1.6, gt=0, description="widest spot across its long axis, in the laser plane [mm]"
    )
    # floors for coarse pixels: a spot as wide as the blur covers 5 px at `region_level`
    min_length_px: float = Field(default=12.0, gt=0, description="a spot of this length is never too long [px]")
    min_width_px: float = Field(default=7.0, gt=0, description="a spot of this width is never too wide [px]")
    # twice what a lit wall makes (docs/spots.md)
    max_candidates: int = Field(
        default=2000, ge=1, le=30_000, description="brightest peaks that are looked at; more are said"
    )


class LocaliseConfig(_Section):
    """How a spot's position is found."""

    method: Literal["ml", "fast"] = Field(
        default="ml", description="maximum likelihood, or the fast matched blur with a log-parabola"
    )
    # 99 % of the light lies within; more takes in neighbours
    window_sigma: float = Field(default=3.0, gt=0.5, le=6, description="half window in spot widths")
    max_half_window_px: int = Field(default=20, ge=3, le=60, description="largest half window [px]")
    max_iterations: int = Field(default=20, ge=1, le=200, description="steps of a fit before it is given up")
    # a pixel alone has less than 0.3; a sharp lens draws the glint of a polished wire with 0.4 (extraction_pathtraced)
    min_sigma_px: float = Field(default=0.35, ge=0, description="a narrower spot is a hot pixel or a spark")
    # a grid of 30 × 30 dots whole, at a tenth of a millisecond a spot
    max_spots: int = Field(default=1000, ge=1, description="spots kept, best first; more are said")
    min_score: float = Field(default=0.05, ge=0, le=1, description="least score of a spot that is kept")


class ScoreConfig(_Section):
    """How much a spot looks like a lit string: factors that are 1 for the ideal one, multiplied.

    Halved or doubled, one at a time, none loses one of 210 strings in 42 frames of cells with a lit wall; the string's
    score is above that of all else in 92 to 99.5 % (97 % with these), and 0.3 to 0.5 spots a frame are no string
    (benchmarks/extraction_score.py): rough numbers do, labels drop the rest.
    """

    strength: float = Field(default=2.5, gt=0, description="times the threshold at which strength counts 0.63")
    width_px: float = Field(default=4.0, gt=0, description="σ across the spot at which its width counts half [px]")
    length_px: float = Field(default=6.0, gt=0, description="σ along the spot at which its length counts half [px]")
    saturated: float = Field(default=0.5, ge=0, le=1, description="what a spot with clipped pixels counts")
    # strings of one jig differ in width by their distance and focus only
    width_spread: float = Field(default=0.3, gt=0, description="spread of the widths in one image, in logarithms")
    faint_share: float = Field(default=0.1, gt=0, description="share of the typical height that counts half")
    brightest: float = Field(
        default=4.0, gt=0, description="times the median height above which a spot has no more say in what is typical"
    )
    # a spot unlike all others of its image is doubted, not lost
    least_likeness: float = Field(default=0.3, ge=0, le=1, description="what a spot unlike all others counts at least")
    consensus: int = Field(default=3, ge=1, description="spots that make a typical width and height")
    trusted: float = Field(default=0.6, ge=0, le=1, description="spots above it tell of the speckle in a dataset")


class DoubtConfig(_Section):
    """What departs so far from a string's spot that it is refused, or kept with a flag.

    Doubled, one at a time, none changes a spot of 210 whole strings (benchmarks/extraction_score.py).
    """

    max_move_sigma: float = Field(
        default=1.5, ge=0, description="way of the fitted centre from its region's, in spot widths, beside max_move_px"
    )
    # the region's centre is one of whole pixels
    max_move_px: float = Field(default=1.0, ge=0, description="way of the fitted centre beside max_move_sigma [px]")
    # two strings in one, or half a post; half as much would flag 2 % of whole strings (the same)
    max_misfit: float = Field(
        default=4.0, gt=1, description="variance of the residuals over what noise and speckle make of it"
    )
    # a Gaussian value is beyond once in 16,000; half as much would flag 3 % of whole strings (the same)
    max_skew_sigma: float = Field(default=4.0, gt=0, description="asymmetry along the spot over its own σ")


Vertex = tuple[Annotated[float, Field(ge=-1e5, le=1e5)], Annotated[float, Field(ge=-1e5, le=1e5)]]
Polygon = Annotated[tuple[Vertex, ...], Field(min_length=3, max_length=200)]


class RegionConfig(_Section):
    """The part of the image that is looked at: polygons of pixels (u, v)."""

    keep: tuple[Polygon, ...] = Field(
        default=(), max_length=100, description="polygons that are looked at; the whole image where there is none"
    )
    leave_out: tuple[Polygon, ...] = Field(default=(), max_length=100, description="polygons that are not looked at")


class ExtractionConfig(_Section):
    """All settings of the extraction of string spots."""

    noise: SpotNoiseConfig = SpotNoiseConfig()
    detect: DetectConfig = DetectConfig()
    localise: LocaliseConfig = LocaliseConfig()
    score: ScoreConfig = ScoreConfig()
    doubt: DoubtConfig = DoubtConfig()
    region: RegionConfig = RegionConfig()


class StripeConfig(_Section):
    """How a laser stripe is found and localised; lengths in px, grey levels in DN."""

    direction: Direction = Field(
        default="auto",
        description="search along image columns or rows; auto: along the depth's image, else where more light is",
    )
    along_normal: bool = Field(
        default=False, description="localise once more along the stripe's own normal, for steep stripes"
    )
    select: Selection = Field(
        default="stripe",
        description="which of several stripes gives a section's point; stripe: the brightest, of two near ones both",
    )
    min_amplitude_dn: float = Field(default=1.0, ge=0, description="smallest peak above its local background")
    # the stripe as a whole is what is found; a section only has to say something
    min_snr: float = Field(default=2.0, ge=0, description="smallest amplitude of a section over its own σ")
    # no lens draws a line narrower than 0.5
    min_width_px: float = Field(default=0.45, gt=0, description="smallest Gaussian σ of the stripe")
    # 33 px between the flanks; wider are lit faces
    max_width_px: float = Field(default=14.0, gt=0, description="largest Gaussian σ of the stripe")
    max_chi2_per_dof: float = Field(
        default=25.0, gt=1, description="above it the section is not one Gaussian peak: flagged shape"
    )
    region_px: tuple[int, int, int, int] | None = Field(
        default=None, description="u0, v0, u1, v1 of the part of the image looked at, u1 and v1 excluded"
    )
    read_noise_dn: float | None = Field(
        default=None, ge=0, description="noise in the dark; estimated from the frame if absent"
    )
    gain_dn_per_e: float | None = Field(default=None, ge=0, description="grey levels per electron; estimated if absent")
    speckle_contrast: float | None = Field(
        default=None, ge=0, le=1, description="multiplicative noise; estimated if absent"
    )
    # shorter pieces are taken where a stripe goes on in them
    min_run: int = Field(default=20, ge=3, le=1000, description="sections in a row that make a stripe by themselves")

    @model_validator(mode="after")
    def _widths_are_ordered(self) -> StripeConfig:
        if self.min_width_px >= self.max_width_px:
            raise ValueError(f"min_width_px {self.min_width_px:g} must be below max_width_px {self.max_width_px:g}")
        return self


class GapFlushConfig(_Section):
    """How two panels and their edges are found in a profile; lengths in mm.

    The lengths are those of car bodies' panels: faces of 8 mm and more, gaps up to 40 mm, bends of 0.5 to 8 mm.
    """

    reference: Literal["left", "right"] = Field(default="left", description="panel whose face gives the directions")
    definition: GapDefinition = Field(default="extreme", description="between which points gap and flush run")
    axis: Literal["face", "distance"] = Field(
        default="face", description="the gap along the reference face, or straight from point to point"
    )
    tangent_deg: float = Field(
        default=0.0, ge=0, le=90, description="turn from the face at the tangent point; 0: where the bend begins"
    )
    fixed_radius_mm: tuple[float, float] | None = Field(
        default=None, description="known radii of the left and the right bend, not fitted then"
    )
    gauge_depth_mm: float | None = Field(
        default=None, gt=0, description="how deep the gauge's feeler enters below the reference face"
    )
    gauge_offset_mm: float | None = Field(
        default=None, ge=0, description="how far inside the other panel's edge the gauge's pin stands"
    )
    min_face_mm: float = Field(default=3.0, gt=0, description="shortest straight stretch that is a panel's face")
    face_length_mm: float = Field(default=8.0, gt=0, description="length of the face that is used, from its edge")
    tolerance_mm: float = Field(default=0.05, gt=0, description="least distance at which a point is off a face")
    max_angle_deg: float = Field(default=40.0, gt=0, lt=90, description="largest angle between the two faces")
    min_gap_mm: float = Field(default=0.2, gt=0, description="smallest gap, along the profile")
    max_gap_mm: float = Field(default=40.0, gt=0, description="largest gap, along the profile")
    max_radius_mm: float = Field(default=8.0, gt=0, description="largest edge radius")
    max_step_mm: float = Field(default=0.8, gt=0, description="a longer step between neighbours ends a surface")
    # steeper, a section blurs the bend; beyond 90° it may become a flange
    max_arc_deg: float = Field(
        default=65.0, gt=0, lt=90, description="arc of a bend up to which points alone are fitted"
    )
    min_arc_deg: float = Field(default=30.0, gt=0, lt=90, description="seen arc below which a radius is flagged")
    max_chi2_per_dof: float = Field(
        default=4.0, gt=1, description="above it an edge is no line with an arc: flagged misfit"
    )

    @model_validator(mode="after")
    def _definition_is_told(self) -> GapFlushConfig:
        radii = self.fixed_radius_mm
        if radii is not None and not all(0 < r <= self.max_radius_mm for r in radii):
            raise ValueError(
                f"fixed_radius_mm {list(radii)} must lie above 0 and up to max_radius_mm {self.max_radius_mm:g}"
            )
        if self.definition == "fixed_radius" and radii is None:
            raise ValueError('definition "fixed_radius" needs fixed_radius_mm = [left, right]')
        if self.definition == "gauge" and (self.gauge_depth_mm is None or self.gauge_offset_mm is None):
            raise ValueError('definition "gauge" needs gauge_depth_mm and gauge_offset_mm')
        return self


class FeatureConfig(_Section):
    """How a target is found in a profile: arcs, straight stretches, corners and wedges; lengths in mm."""

    # a recording on a real ball scatters by twice what neighbours do, path-traced ones by 1.0 to 1.6
    tolerance_sigma: float = Field(
        default=4.0,
        gt=0,
        description="how far a point may lie off the curve while it is searched, over what neighbours scatter by",
    )
    min_tolerance_mm: float = Field(default=0.02, gt=0, description="the least such distance: finer profiles bend")
    # keeps 98 % and more of the arcs' points of a real set whose flanks have tails
    inlier_sigma: float = Field(
        default=5.0, gt=1, description="points farther off than so many σ of their own scatter are left out"
    )
    min_points: int = Field(default=12, ge=4, description="fewest points of an arc or straight stretch")
    min_run: int = Field(default=5, ge=1, description="fewest neighbours on the curve; fewer cross it by chance")
    # all but one in 10^6 of the curves with a seventh of the points are found by so many samples of three
    ransac_trials: int = Field(default=4000, ge=10, description="samples at most")
    ransac_certainty: float = Field(default=1 - 1e-6, gt=0, lt=1, description="no more samples once this sure")
    ransac_points: int = Field(default=400, ge=20, description="points that the samples are drawn from")
    # the path-traced and real sets have 0.5 to 0.99
    min_section: float = Field(
        default=0.2, gt=0, lt=1, description="smallest radius of a ball's section, over the ball's"
    )
    # a stated diameter that is wrong must be seen as such, not as an empty profile
    max_section: float = Field(default=1.3, gt=1, description="largest radius of a ball's section, over the stated one")
    min_arc_deg: float = Field(default=30.0, gt=0, lt=180, description="shortest arc of a ball")
    max_radius_mm: float = Field(default=500.0, gt=0, description="largest ball where no diameter is stated")
    rival_share: float = Field(
        default=0.4,
        gt=0,
        lt=1,
        description="a second thing of the kind with this share of the first's points is a rival",
    )
    # a stem is a quarter as wide as its ball, or less
    rival_section: float = Field(default=0.3, gt=0, lt=1, description="smallest section, over the ball's, of a rival")
    min_line_mm: float = Field(default=8.0, gt=0, description="shortest straight stretch")
    max_bend: float = Field(default=0.015, gt=0, description="largest bend of a straight stretch, over its length")
    min_wedge_deg: float = Field(
        default=10.0, gt=0, lt=90, description="least turn from one face of a wedge to the other"
    )
    max_ridge_gap_mm: float = Field(
        default=3.0, gt=0, description="how far the faces of a wedge may end before they meet"
    )
