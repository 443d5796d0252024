"""Gap and flush: how far two panels stand apart, and by how much one stands proud of the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.config import GapFlushConfig
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
_STEP = 1e-6  # of the numeric derivative, mm or rad


@dataclass(frozen=True, eq=False)
class GapFlush:
    """The answer of `measure_gap_flush`, lengths in mm.

    gap_mm, flush_mm: see there, with covariance_mm2 (2, 2). radius_mm, sigma_radius_mm: of the left and the right
    edge (2,), NaN for a sharp edge. left, right: the fitted panels. gap_points: the two points (2, 2) between which
    the gap is measured; flush_points: the other panel's tangent point and its foot on the reference face (2, 2).
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
    blur_px: float | None = None

    @property
    def sigma_gap_mm(self) -> float:
        """Standard deviation of the gap."""
        return float(np.sqrt(self.covariance_mm2[0, 0]))

    @property
    def sigma_flush_mm(self) -> float:
        """Standard deviation of the flush."""
        return float(np.sqrt(self.covariance_mm2[1, 1]))


def measure_gap_flush(profile: Profile, config: GapFlushConfig | None = None) -> GapFlush:
    """Gap, flush and edge radii of the two panels of a profile.

    Each panel is a straight face that bends away from the sensor along a circle tangent to it. With x the direction of
    the reference panel's face (left by default), from left to right, and n its normal, towards the sensor:

    - **gap**: distance along x between the bends' points that reach furthest into the gap (the left one's largest, the
      right one's smallest x; a sharp edge's end). It is that of a feeler gauge held along the reference face.
    - **flush**: distance along n from the reference face, extended, to the other panel's tangent point, where its face
      ends and its bend begins; positive where the other panel stands proud, towards the sensor.
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
    profile = _ordered(profile, config)
    left, right, joint, blur = _edges(profile, config)
    both = np.concatenate([left.parameters, right.parameters])
    measured = _evaluate(left, right, both, config.reference)
    if not 0 < measured[0] <= config.max_gap_mm:
        raise NoAnswerError(
            f"the edges overlap or lie too far apart: gap {measured[0]:.3f} mm, at most {config.max_gap_mm:g}"
        )
    jacobian = np.column_stack(
        [
            _evaluate(left, right, both + h, config.reference)[:2]
            - _evaluate(left, right, both - h, config.reference)[:2]
            for h in _STEP * np.eye(8)
        ]
    ) / (2 * _STEP)
    round_ = np.array([_is_round(left), _is_round(right)])
    return GapFlush(
        gap_mm=float(measured[0]),
        flush_mm=float(measured[1]),
        covariance_mm2=jacobian @ joint @ jacobian.T,
        radius_mm=np.where(round_, both[[3, 7]], np.nan),
        sigma_radius_mm=np.where(round_, np.sqrt(np.diagonal(joint)[[3, 7]]), np.nan),
        left=left,
        right=right,
        gap_points=measured[2:6].reshape(2, 2),
        flush_points=measured[6:].reshape(2, 2),
        flag="+".join([*_doubts(left, "left", config), *_doubts(right, "right", config)]),
        blur_px=blur,
    )


def _edges(profile: Profile, config: GapFlushConfig) -> tuple[PanelEdge, PanelEdge, Array, float | None]:
    """Both edges, their joint covariance (8, 8), the blur: from points alone, then from all that the sections tell."""
    yz, cov = profile.yz_mm, profile.cov_yz_mm2
    tolerance = max(config.tolerance_mm, 5.0 * float(np.median(np.sqrt(np.trace(cov, axis1=1, axis2=2)))))
    faces = find_faces(yz, tolerance, config)
    cov = cov + np.diag([(_LATERAL * float(np.median(np.diff(yz[:, 0])))) ** 2, 0.0])
    left_face, right_face = facing_pair(yz, faces, tolerance, config)
    between = yz[left_face.last : right_face.first + 1]
    split = left_face.last + int(np.argmax(np.hypot(*np.diff(between, axis=0).T)))
    left, left_bend = fit_edge(yz, cov, left_face, 1.0, tolerance, config, split)
    right, right_bend = fit_edge(yz, cov, right_face, -1.0, tolerance, config, split + 1)
    sections = sections_of(profile)
    if sections is not None:
        pair = fit_pair(yz, sections, left, right, (left_bend, right_bend), config)
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


def _evaluate(left: PanelEdge, right: PanelEdge, both: Array, reference: str) -> Array:
    """Gap, flush, then the two gap points and the two flush points, flat (10,)."""
    p, q = both[:4], both[4:]
    here, other = (left, right) if reference == "left" else (right, left)
    a, b = (p, q) if reference == "left" else (q, p)
    x = here.face_direction(a)
    n = np.array([x[1], -x[0]])  # towards the sensor
    ends = np.array([left.extreme_point(p, x), right.extreme_point(q, -x)])
    tangent, base = other.tangent_point(b), here.tangent_point(a)
    flush = (tangent - base) @ n
    foot = tangent - flush * n
    return np.concatenate([[(ends[1] - ends[0]) @ x, flush], ends.ravel(), tangent, foot])


def _is_round(edge: PanelEdge) -> bool:
    """Whether the edge's radius can be told from none."""
    return bool(edge.parameters[3] > 2 * np.sqrt(edge.covariance[3, 3]))


def _doubts(edge: PanelEdge, name: str, config: GapFlushConfig) -> list[str]:
    if not _is_round(edge):
        return [f"sharp_{name}"]
    out = [f"short_arc_{name}"] if edge.arc_rad < np.deg2rad(config.min_arc_deg) else []
    return [*out, f"misfit_{name}"] if edge.chi2_per_dof > config.max_chi2_per_dof else out
