"""What a recipe measures in one image or profile: a feature, gap and flush, and every value with σ and its lamp."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from extraction import (
    Circle,
    FeatureConfig,
    Line,
    Profile,
    StripePeaks,
    TargetPoints,
    find_target_points,
)
from geometry import NoAnswerError
from workbench.files import Recipe, ToleranceConfig

if TYPE_CHECKING:
    from extraction import GapFlush

Array = NDArray[np.float64]

GOOD, BAD, UNJUDGED = "good", "bad", ""


@dataclass(frozen=True)
class Value:
    """One measured number of a tool.

    key: as in [tolerances]. tool: the recipe's tool that it belongs to. sigma: None where it has none. value: None
    where it could not be measured. lamp: "good" or "bad" by its tolerance, "" where there is none.
    """

    key: str
    tool: str
    value: float | None
    sigma: float | None = None
    unit: str = ""
    digits: int = 3
    lamp: str = UNJUDGED


@dataclass(frozen=True, eq=False)
class MeasuredProfile:
    """What was measured in a profile. gap_text: why there is no gap, "" where there is one or none was asked for."""

    feature: TargetPoints | None = None
    gap: GapFlush | None = None
    gap_text: str = ""


def measure(profile: Profile, recipe: Recipe, field_of_view_mm: Array | None = None) -> MeasuredProfile:
    """What the recipe asks for in a profile.

    Parameters
    ----------
    profile
        Points in {P}.
    recipe
        Its tables measure, feature and gapflush are used.
    field_of_view_mm
        Polygon (N, 2) in {P}; tells a plate's end from the field's.

    Returns
    -------
    MeasuredProfile
        What was asked for; what is missing is said in words.

    """
    asked, feature = recipe.measure, None
    if asked.feature != "none":
        feature = find_feature(profile, asked.feature, asked.diameter_mm, recipe.feature, field_of_view_mm)
    if not asked.gap_and_flush:
        return MeasuredProfile(feature)
    try:
        from extraction import measure_gap_flush  # it loads what fits bends, and most recipes measure none

        return MeasuredProfile(feature, measure_gap_flush(profile, recipe.gapflush))
    except NoAnswerError as error:
        return MeasuredProfile(feature, None, str(error))


def find_feature(
    profile: Profile, kind: str, diameter_mm: float | None, config: FeatureConfig, field_of_view_mm: Array | None
) -> TargetPoints:
    """One feature of a profile."""
    polygon = field_of_view_mm if kind == "edge" else None
    return find_target_points(profile, kind, (diameter_mm,), field_of_view_mm=polygon, config=config)


def profile_values(profile: Profile, measured: MeasuredProfile, recipe: Recipe) -> list[Value]:
    """The values of a stripe in millimetres, of its feature and of its gap, judged."""
    sigma = np.sqrt(np.maximum(np.trace(profile.cov_yz_mm2, axis1=1, axis2=2), 0))
    middle = float(np.median(sigma)) if len(sigma) else None
    values = [Value("points", "stripe", len(profile), digits=0)]
    values += [Value("flagged", "stripe", int((profile.peaks.flag > 0).sum()), digits=0)]
    values += [Value("sigma_mm", "stripe", middle, unit="mm", digits=4)]
    if recipe.measure.feature != "none" and measured.feature is not None:
        values += _feature_values(measured.feature, profile.peaks.sections_per_independent)
    if recipe.measure.gap_and_flush:
        values += _gap_values(measured.gap)
    return judged(values, recipe.tolerances)


def peak_values(peaks: StripePeaks, recipe: Recipe) -> list[Value]:
    """The values of a stripe in pixels, judged."""
    values = [Value("points", "stripe", len(peaks), digits=0)]
    values += [Value("flagged", "stripe", int((peaks.flag > 0).sum()), digits=0)]
    sigma = float(np.median(peaks.sigma_px)) if len(peaks) else None
    values += [Value("sigma_px", "stripe", sigma, unit="px", digits=4)]
    return judged(values, recipe.tolerances)


def judged(values: Sequence[Value], tolerances: ToleranceConfig) -> list[Value]:
    """The values with their lamps."""
    given = tolerances.given

    def lamp(value: Value) -> str:
        if value.key not in given:
            return UNJUDGED
        return GOOD if given[value.key].holds(value.value) else BAD

    return [Value(v.key, v.tool, v.value, v.sigma, v.unit, v.digits, lamp(v)) for v in values]


def value_objects(values: Sequence[Value]) -> dict[str, dict[str, Any]]:
    """The values as a result's JSON: by name, with σ and whether the tolerance holds (null where none is given)."""
    return {
        v.key: {"value": v.value, "sigma": v.sigma, "holds": None if v.lamp == UNJUDGED else v.lamp == GOOD}
        for v in values
    }


def _feature_values(found: TargetPoints, alike: float) -> list[Value]:
    """Centre and radius of an arc, slope of a line, corner, angle of a wedge; alike: points that count as one."""
    scatter = found.scatter_mm if len(found) else None
    last = Value("scatter_mm", "feature", scatter, unit="mm", digits=4)
    if found.kind == "sphere":
        circle = found.curves[0] if found.curves else None
        numbers = _circle(circle, found, alike) if isinstance(circle, Circle) else [(None, None)] * 3
        names = ("centre_y_mm", "centre_z_mm", "radius_mm")
        return [*(Value(n, "feature", v, s, "mm", 4) for n, (v, s) in zip(names, numbers, strict=True)), last]
    if found.kind == "edge":
        at = found.yz_mm[0] if len(found) == 1 else None
        spread = None if at is None else np.sqrt(np.diag(found.cov_yz_mm2[0]))
        pairs = (
            [(None, None)] * 2 if at is None or spread is None else list(zip(at.tolist(), spread.tolist(), strict=True))
        )
        return [
            *(Value(f"corner_{a}_mm", "feature", v, s, "mm", 4) for a, (v, s) in zip("yz", pairs, strict=True)),
            last,
        ]
    lines = [(c, np.flatnonzero(found.feature == k)) for k, c in enumerate(found.curves) if isinstance(c, Line)]
    slopes = [_slope(line, found, at, alike) for line, at in lines]
    if found.kind == "plane":
        value, sigma = slopes[0] if slopes else (None, None)
    elif len(slopes) == 2:
        value, sigma = abs(slopes[0][0] - slopes[1][0]), float(np.hypot(slopes[0][1], slopes[1][1]))
        value = 180.0 - value
    else:
        value, sigma = None, None
    return [Value("angle_deg", "feature", value, sigma, "°", 4), last]


def _circle(circle: Circle, found: TargetPoints, alike: float) -> list[tuple[float | None, float | None]]:
    """Centre and radius with σ, by the points' own covariance."""
    away = circle.normals(found.yz_mm)
    variance = np.einsum("ni,nij,nj->n", away, found.cov_yz_mm2, away)
    rows = np.column_stack([away, np.ones(len(away))]) / np.sqrt(variance)[:, None]
    sigma = np.sqrt(np.diag(np.linalg.inv(rows.T @ rows)) * alike)
    numbers = [*circle.centre_mm.tolist(), circle.radius_mm]
    return list(zip(numbers, sigma.tolist(), strict=True))


def _slope(line: Line, found: TargetPoints, at: NDArray[np.intp], alike: float) -> tuple[float, float]:
    """Angle of a line against y with its σ [deg]."""
    variance = np.einsum("i,nij,j->n", line.normal, found.cov_yz_mm2[at], line.normal)
    along, weight = line.along(found.yz_mm[at]), 1 / variance
    middle = float(np.sum(weight * along) / np.sum(weight))
    spread = float(np.sqrt(alike / np.sum(weight * (along - middle) ** 2)))
    return float(np.rad2deg(np.arctan2(line.direction[1], line.direction[0]))), float(np.rad2deg(spread))


def _gap_values(gap: GapFlush | None) -> list[Value]:
    if gap is None:
        return [Value("gap_mm", "gapflush", None, unit="mm"), Value("flush_mm", "gapflush", None, unit="mm")]
    radii = [
        Value(f"radius_{side}_mm", "gapflush", _known(r), _known(s), "mm")
        for side, r, s in zip(("left", "right"), gap.radius_mm.tolist(), gap.sigma_radius_mm.tolist(), strict=True)
    ]
    both = [
        Value("gap_mm", "gapflush", gap.gap_mm, gap.sigma_gap_mm, "mm"),
        Value("flush_mm", "gapflush", gap.flush_mm, gap.sigma_flush_mm, "mm"),
    ]
    return both + radii


def _known(x: float) -> float | None:
    return x if np.isfinite(x) else None
