"""Gap and flush: how far two panels stand apart, and by how much one stands proud of the other."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from extraction.config import GapDefinition, GapFlushConfig
from extraction.gapflush.definitions import Lengths, asked_definitions, lengths, mastered
from extraction.gapflush.edge import PanelEdge, fit_edge
from extraction.gapflush.faces import facing_pair, find_faces
from extraction.gapflush.light import sections_of
from extraction.gapflush.pair import fit_pair
from extraction.stripe import Profile
from geometry import InputError, NoAnswerError

Array = NDArray[np.float64]

_FEWEST_POINTS = 30  # two faces of ten points and a gap between
_NEIGHBOURS = 4  # on each side; a point far from all of them stands alone
_LATERAL = 0.3  # of the point spacing: a section sees light from beside it, which matters where a bend is steep


@dataclass(frozen=True, eq=False)
class GapFlush:
    """The answer of `measure_gap_flush`, lengths in mm.

    gap_mm, flush_mm: by ``definition``, see there, with covariance_mm2 (2, 2). definitions: by every one, as far as
    the settings tell what it needs and the panels have such points. radius_mm, sigma_radius_mm: of the left and the
    right edge (2,), NaN for a sharp edge. left, right: the fitted panels. gap_points: the two points (2, 2) between
    which the gap is measured; flush_points: the other panel's point and its foot on the reference face (2, 2).
    flag: "" or reasons for doubt, joined by "+": sharp_left, sharp_right (no bend seen, the gap is that of the last
    points), short_arc_left, short_arc_right (so little of the bend was seen that its radius extrapolates),
    misfit_left, misfit_right (the edge is no line with an arc, or its light is not that of a bend).
    blur_px: of the image along the stripe as found from the stripe's widths; None where the profile holds points only,
    and what the blur does to a bend could not be taken out.
    """

    gap_mm: float
    flush_mm: float
    covariance_mm2: Array
    radius_mm: Array
    sigma_radius_mm: Array
    left: PanelEdge
    right: PanelEdge
    gap_points: Array
    flush_points: Array
    flag: str
    definition: GapDefinition
    definitions: Mapping[GapDefinition, Lengths]
    blur_px: float | None = None

    @property
    def sigma_gap_mm(self) -> float:
        """Standard deviation of the gap."""
        return float(np.sqrt(self.covariance_mm2[0, 0]))

    @property
    def sigma_flush_mm(self) -> float:
        """Standard deviation of the flush."""
        return float(np.sqrt(self.covariance_mm2[1, 1]))

    def against(self, master: GapFlush, true_mm: tuple[float, float], uncertainty_mm: float = 0.0) -> GapFlush:
        """This measurement, corrected by what the same sensor measures on a master, by the chosen definition.

        Parameters
        ----------
        master
            What was measured on it, by the same definition.
        true_mm
            The master's gap and flush by its certificate.
        uncertainty_mm
            Of both, expanded (k = 2).

        Returns
        -------
        GapFlush
            Its σ takes the two measurements' errors as independent: what they share cancels, so it is an upper bound.

        Raises
        ------
        InputError
            Where the master was measured by another definition.
        """
        if master.definition != self.definition:
            raise InputError(f'the master was measured by "{master.definition}", the panels by "{self.definition}"')
        by = mastered(self.definitions[self.definition], master.definitions[self.definition], true_mm, uncertainty_mm)
        return replace(
            self,
            gap_mm=by.gap_mm,
            flush_mm=by.flush_mm,
            covariance_mm2=by.covariance_mm2,
            definitions={**self.definitions, self.definition: by},
        )


def measure_gap_flush(profile: Profile, config: GapFlushConfig | None = None) -> GapFlush:
    """Gap, flush and edge radii of the two panels of a profile.

    Each panel is a straight face that bends away from the sensor along a circle tangent to it. With x the direction of
    the reference panel's face (left by default), from left to right, and n its normal, towards the sensor:

    - **gap**: distance along x between the bends' points that reach furthest into the gap (the left one's largest, the
      right one's smallest x; a sharp edge's end). It is that of a feeler gauge held along the reference face.
    - **flush**: distance along n from the reference face, extended, to the other panel's tangent point, where its face
      ends and its bend begins; positive where the other panel stands proud, towards the sensor.

    These are the definition "extreme"; `definitions` has the others, of which `definition` chooses one.

    - **radius** of each bend, fitted over at most `max_arc_deg` of arc where the profile holds points alone.

    Parameters
    ----------
    profile
        Points (y, z) in {P} [mm] with covariance; with peaks, what the blur does to a bend is taken out.
    config
        Settings; the defaults where None.

    Returns
    -------
    answer
        Gap and flush with their covariance, radii, the fitted panels, reasons for doubt. Covariances follow from those
        of the points and an allowance of 0.3 of their spacing across (light from beside a section moves it on a steep
        bend), scaled by χ² where the points scatter more than they claim.

    Raises
    ------
    NoAnswerError
        Where there are no two panels with a gap between.
    InputError
        For points that are not finite.

    References
    ----------
    docs/gapflush.md has the definition's picture, and what it reaches.
    """
    config = config or GapFlushConfig()
    profile = _ordered(profile.with_tails(), config)
    left, right, joint, blur = _edges(profile, config)
    found: dict[GapDefinition, Lengths] = {}
    for name in asked_definitions(config):
        edges = left, right, joint
        if name == "fixed_radius":
            edges = _edges(profile, config, config.fixed_radius_mm)[:3]
        by = lengths(name, *edges, config)
        if by is not None:
            found[name] = by
        if name == config.definition:
            left, right, joint = edges
    chosen = found.get(config.definition)
    if chosen is None:
        raise NoAnswerError(
            f'no gap by the definition "{config.definition}": the feeler does not reach both bends at a '
            f"depth of {config.gauge_depth_mm:g} mm"
        )
    if not 0 < chosen.gap_mm <= config.max_gap_mm:
        raise NoAnswerError(
            f"the edges overlap or lie too far apart: gap {chosen.gap_mm:.3f} mm, at most {config.max_gap_mm:g}"
        )
    round_ = np.array([_is_round(left), _is_round(right)])
    radii = np.array([left.parameters[3], right.parameters[3]])
    return GapFlush(
        gap_mm=chosen.gap_mm,
        flush_mm=chosen.flush_mm,
        covariance_mm2=chosen.covariance_mm2,
        radius_mm=np.where(round_, radii, np.nan),
        sigma_radius_mm=np.where(round_, np.sqrt(np.diagonal(joint)[[3, 7]]), np.nan),
        left=left,
        right=right,
        gap_points=chosen.gap_points,
        flush_points=chosen.flush_points,
        flag="+".join([*_doubts(left, "left", config), *_doubts(right, "right", config)]),
        definition=config.definition,
        definitions=found,
        blur_px=blur,
    )


def _edges(
    profile: Profile, config: GapFlushConfig, fixed: tuple[float, float] | None = None
) -> tuple[PanelEdge, PanelEdge, Array, float | None]:
    """Both edges, their joint covariance (8, 8), the blur: from points alone, then from all that the sections tell.

    fixed: radii that are known.
    """
    known = fixed or (None, None)
    yz, cov = profile.yz_mm, profile.cov_yz_mm2
    tolerance = max(config.tolerance_mm, 5.0 * float(np.median(np.sqrt(np.trace(cov, axis1=1, axis2=2)))))
    faces = find_faces(yz, tolerance, config)
    cov = cov + np.diag([(_LATERAL * float(np.median(np.diff(yz[:, 0])))) ** 2, 0.0])
    left_face, right_face = facing_pair(yz, faces, tolerance, config)
    between = yz[left_face.last : right_face.first + 1]
    split = left_face.last + int(np.argmax(np.hypot(*np.diff(between, axis=0).T)))
    left, left_bend = fit_edge(yz, cov, left_face, 1.0, tolerance, config, split, known[0])
    right, right_bend = fit_edge(yz, cov, right_face, -1.0, tolerance, config, split + 1, known[1])
    sections = sections_of(profile)
    if sections is not None:
        pair = fit_pair(yz, sections, left, right, (left_bend, right_bend), config, fixed)
        return pair.left, pair.right, pair.covariance, pair.blur_px
    joint = np.zeros((8, 8))
    joint[:4, :4], joint[4:, 4:] = left.covariance, right.covariance
    return left, right, joint, None


def _ordered(profile: Profile, config: GapFlushConfig) -> Profile:
    """The points ordered by y, without those that stand alone off their neighbours."""
    if not (np.isfinite(profile.yz_mm).all() and np.isfinite(profile.cov_yz_mm2).all()):
        raise InputError("the profile holds a point or covariance that is not finite: leave such points out")
    profile = profile[np.argsort(profile.yz_mm[:, 0], kind="stable")]
    yz = profile.yz_mm
    apart = np.full(len(yz), np.inf)
    for k in range(1, _NEIGHBOURS + 1):
        step = np.hypot(*(yz[k:] - yz[:-k]).T)
        apart[k:] = np.minimum(apart[k:], step)
        apart[:-k] = np.minimum(apart[:-k], step)
    profile = profile[apart <= 0.5 * config.max_step_mm]
    if len(profile) < _FEWEST_POINTS:
        raise NoAnswerError(
            f"the profile has {len(profile)} connected points: at least {_FEWEST_POINTS} are needed for gap and flush"
        )
    return profile


def _is_round(edge: PanelEdge) -> bool:
    """Whether the edge's radius can be told from none."""
    return bool(edge.parameters[3] > 2 * np.sqrt(edge.covariance[3, 3]))


def _doubts(edge: PanelEdge, name: str, config: GapFlushConfig) -> list[str]:
    if not _is_round(edge):
        return [f"sharp_{name}"]
    out = [f"short_arc_{name}"] if edge.arc_rad < np.deg2rad(config.min_arc_deg) else []
    return [*out, f"misfit_{name}"] if edge.chi2_per_dof > config.max_chi2_per_dof else out
