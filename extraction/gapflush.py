"""Gap and flush: how far two panels stand apart, and by how much one stands proud of the other."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.gapflush_config import GapFlushConfig
from extraction.gapflush_edge import MIN_ARC_RAD, PanelEdge, fit_edge
from extraction.gapflush_faces import facing_pair, find_faces
from extraction.profile import Profile
from geometry import InputError, NoAnswerError

Array = NDArray[np.float64]

_FEWEST_POINTS = 30
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
    points), short_arc_left, short_arc_right (so little of the bend was seen that its radius extrapolates).
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
    - **radius** of each bend, fitted over at most 65° of arc.

    Covariances follow from those of the points and an allowance of 0.3 of their spacing across (light from beside a
    section moves it on a steep bend), scaled by χ² where the points scatter more than they claim. Raises
    NoAnswerError where there are no two panels with a gap between, InputError for points that are not finite.
    """
    config = config or GapFlushConfig()
    yz, cov = _ordered(profile, config)
    tolerance = max(config.tolerance_mm, 5.0 * float(np.median(np.sqrt(np.trace(cov, axis1=1, axis2=2)))))
    faces = find_faces(yz, tolerance, config)
    cov = cov + np.diag([(_LATERAL * float(np.median(np.diff(yz[:, 0])))) ** 2, 0.0])
    left_face, right_face = facing_pair(yz, faces, tolerance, config)
    left = fit_edge(yz, cov, left_face, 1.0, tolerance, config)
    right = fit_edge(yz, cov, right_face, -1.0, tolerance, config)
    both = np.concatenate([left.parameters, right.parameters])
    measured = _evaluate(left, right, both, config.reference)
    joint = np.zeros((8, 8))
    joint[:4, :4], joint[4:, 4:] = left.covariance, right.covariance
    steps = _STEP * np.eye(8)
    difference = [
        _evaluate(left, right, both + h, config.reference)[:2] - _evaluate(left, right, both - h, config.reference)[:2]
        for h in steps
    ]
    jacobian = np.column_stack(difference) / (2 * _STEP)
    radius, variance = both[[3, 7]], np.diagonal(joint)[[3, 7]]
    if not 0 < measured[0] <= config.max_gap_mm:
        raise NoAnswerError(
            f"the edges overlap or lie too far apart: gap {measured[0]:.3f} mm, at most {config.max_gap_mm:g}"
        )
    return GapFlush(
        gap_mm=float(measured[0]),
        flush_mm=float(measured[1]),
        covariance_mm2=jacobian @ joint @ jacobian.T,
        radius_mm=np.where(radius > 0, radius, np.nan),
        sigma_radius_mm=np.where(radius > 0, np.sqrt(variance), np.nan),
        left=left,
        right=right,
        gap_points=measured[2:6].reshape(2, 2),
        flush_points=measured[6:].reshape(2, 2),
        flag="+".join([*_doubts(left, "left"), *_doubts(right, "right")]),
    )


def _ordered(profile: Profile, config: GapFlushConfig) -> tuple[Array, Array]:
    """Points and covariances ordered by y, without those that stand alone off their neighbours."""
    yz, cov = profile.yz_mm, profile.cov_yz_mm2
    if not (np.isfinite(yz).all() and np.isfinite(cov).all()):
        raise InputError("the profile holds a point or covariance that is not finite: leave such points out")
    order = np.argsort(yz[:, 0], kind="stable")
    yz, cov = yz[order], cov[order]
    apart = np.full(len(yz), np.inf)
    for k in range(1, _NEIGHBOURS + 1):
        step = np.hypot(*(yz[k:] - yz[:-k]).T)
        apart[k:] = np.minimum(apart[k:], step)
        apart[:-k] = np.minimum(apart[:-k], step)
    alone = apart > 0.5 * config.max_step_mm
    yz, cov = yz[~alone], cov[~alone]
    if len(yz) < _FEWEST_POINTS:
        raise NoAnswerError(
            f"the profile has {len(yz)} connected points: at least {_FEWEST_POINTS} are needed for gap and flush"
        )
    return yz, cov


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


def _doubts(edge: PanelEdge, name: str) -> list[str]:
    if edge.parameters[3] == 0:
        return [f"sharp_{name}"]
    return [f"short_arc_{name}"] if edge.arc_rad < MIN_ARC_RAD else []
