"""A stripe, a profile or a board for the page: points with σ and flags, and what was measured in them."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from extraction import Circle, Line, Profile, StripePeaks, TargetPoints
from workbench.cell import MeasuredProfile, flag_counts

if TYPE_CHECKING:
    from extraction import GapFlush
    from extraction.board import BoardCorners
    from extraction.gapflush import PanelEdge

Array = NDArray[np.float64]

FACE_MM = 8.0  # of a panel's face that is drawn
BRIEF = 80  # points of a stripe that the overview of all images keeps


@dataclass(frozen=True, eq=False)
class ProfileView:
    """What was found of a stripe in one image, or in a profile file.

    peaks: in the image; None where there is no image. profile: in the laser plane; None where that is not known.
    board, board_text: the board of a calibration picture, or why none was found. reason: why there are no points.
    """

    peaks: StripePeaks | None = None
    profile: Profile | None = None
    measured: MeasuredProfile = field(default_factory=MeasuredProfile)
    reason: str = ""
    board: BoardCorners | None = None
    board_text: str = ""

    @property
    def found(self) -> int:
        """How many points there are; of a board without a stripe how many corners."""
        if self.peaks is not None:
            return len(self.peaks)
        if self.board is not None:
            return len(self.board)
        return 0 if self.profile is None else len(self.profile)


def view_json(view: ProfileView) -> dict[str, Any]:
    """The view for the page: columns of points, and what is drawn over them."""
    answer: dict[str, Any] = {"stripe": _stripe(view), "feature": None, "gap": None, "board": _board(view)}
    if view.measured.feature is not None:
        answer["feature"] = _feature(view.measured.feature)
    if view.measured.gap is not None:
        answer["gap"] = _gap(view.measured.gap)
    elif view.measured.gap_text:
        answer["gap"] = {"text": view.measured.gap_text}
    return answer


def brief_stripe(stripe: dict[str, Any]) -> dict[str, Any]:
    """What the overview keeps of a stripe: counts, and every so many of its points."""
    step = max(1, -(-stripe["n"] // BRIEF))
    few = {key: stripe[key][::step] for key in ("u", "v") if stripe[key] is not None}
    return {key: stripe[key] for key in ("n", "flags", "refused")} | few


def _stripe(view: ProfileView) -> dict[str, Any]:
    peaks, profile = view.peaks, view.profile
    n = len(peaks) if peaks is not None else len(profile) if profile is not None else 0
    out: dict[str, Any] = {"n": n, "u": None, "v": None, "y": None, "z": None, "flags": {}, "refused": {}}
    if peaks is not None:
        out["u"], out["v"] = (_column(peaks.uv_px[:, k]) for k in (0, 1))
        out["sigma"], out["width"] = _column(peaks.sigma_px, 4), _column(peaks.width_px)
        out["normal"] = [_column(peaks.normal[:, k], 4) for k in (0, 1)]
        out["peak"], out["chi2"] = _column(peaks.amplitude_dn, 1), _column(peaks.chi2_per_dof, 2)
        out["flags"], out["refused"] = flag_counts(peaks), dict(sorted(peaks.refused.items()))
        out["flag"] = peaks.flag.tolist()
    if profile is not None:
        out["y"], out["z"] = (_column(profile.yz_mm[:, k], 4) for k in (0, 1))
        out["cov"] = [_column(profile.cov_yz_mm2[:, i, j], 9) for i, j in ((0, 0), (0, 1), (1, 1))]
        out.setdefault("flag", profile.peaks.flag.tolist())
    return out


def _column(values: Array, digits: int = 3) -> list[float]:
    column: list[float] = np.round(np.nan_to_num(values.astype(float)), digits).tolist()
    return column


def _board(view: ProfileView) -> dict[str, Any] | None:
    if view.board is None:
        return {"text": view.board_text, "u": [], "v": [], "sigma": []} if view.board_text else None
    sigma = np.sqrt(np.maximum(np.trace(view.board.covariance_px2, axis1=1, axis2=2) / 2, 0))
    u, v = view.board.uv_px.T
    return {"text": "", "u": _column(u), "v": _column(v), "sigma": _column(sigma, 4)}


def _feature(found: TargetPoints) -> dict[str, Any]:
    """The points on it, and its curves: arcs by centre, radius and the two angles between, lines by their ends."""
    return {
        "kind": found.kind,
        "text": found.text,
        "points": found.index[found.index >= 0].tolist(),
        "curves": [_curve(curve, found, k) for k, curve in enumerate(found.curves)],
        "corner": found.yz_mm[0].tolist() if found.kind == "edge" and len(found) == 1 else None,
    }


def _curve(curve: Circle | Line, found: TargetPoints, k: int) -> dict[str, Any]:
    if isinstance(curve, Circle):
        off = found.yz_mm[found.feature == k] - curve.centre_mm
        middle = off.mean(axis=0)
        turn = np.angle((off[:, 0] + 1j * off[:, 1]) * np.conj(middle[0] + 1j * middle[1]))
        start = float(np.arctan2(middle[1], middle[0]))
        ends = [start + float(turn.min()), start + float(turn.max())]
        return {"centre": curve.centre_mm.tolist(), "radius": curve.radius_mm, "angles": ends}
    on = found.yz_mm[found.feature == k]
    if found.kind == "edge":  # its one point is the corner; the stretch begins there
        return {"line": [(curve.origin_mm + s * curve.direction).tolist() for s in (-FACE_MM, FACE_MM)]}
    s = curve.along(on)
    return {"line": [(curve.origin_mm + x * curve.direction).tolist() for x in (float(s.min()), float(s.max()))]}


def _gap(gap: GapFlush) -> dict[str, Any]:
    return {
        "text": "",
        "flag": gap.flag,
        "gap": gap.gap_points.tolist(),
        "flush": gap.flush_points.tolist(),
        "edges": [_edge(edge) for edge in (gap.left, gap.right)],
    }


def _edge(edge: PanelEdge) -> dict[str, Any]:
    p = edge.parameters
    tangent, along = edge.tangent_point(p), edge.face_direction(p)
    face = [(tangent - edge.side * FACE_MM * along).tolist(), tangent.tolist()]
    return {"face": face, "centre": edge.centre(p).tolist(), "radius": float(p[3])}
