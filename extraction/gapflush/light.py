"""What the sections of a stripe tell beyond their points: direction, width and light, as the model of an edge needs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from extraction.stripe import Profile

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_FAR_PX, _NEAR_PX = 3.0, 0.2  # neighbours whose difference gives the scale across sections
_FLAT = 1e-12  # mm: a covariance without extent


@dataclass(frozen=True, eq=False)
class Sections:
    """The sections of a profile's points in the sheet.

    along: shift (N, 2) [mm/px] in (y, z) for a pixel along the direction in which the point was localised, away from
    the sensor; across: for a pixel square to it. view: unit direction (N, 2) from the camera, seen in the sheet.
    sigma_px, width_px: of the point and of the stripe (N,). log_light: logarithm of the section's light (N,).
    """

    along: Array
    across: Array
    view: Array
    sigma_px: Array
    width_px: Array
    log_light: Array

    def take(self, chosen: Indices, turn: Array | None = None) -> Sections:
        """The chosen sections, with their directions in axes that are the rows of ``turn`` (2, 2)."""
        turn = np.eye(2) if turn is None else turn
        along, across, view = (a[chosen] @ turn.T for a in (self.along, self.across, self.view))
        return Sections(along, across, view, self.sigma_px[chosen], self.width_px[chosen], self.log_light[chosen])


def sections_of(profile: Profile) -> Sections | None:
    """The sections of a profile, None where it holds points only, as one of another make does.

    The scales are found from what a profile has: a point's covariance is that of its σ along one image direction, and
    the step to its neighbour gives the other.
    """
    p = profile.peaks
    whole = (p.sigma_px > 0) & (p.width_px > 0) & (p.amplitude_dn > 0)
    if len(profile) < 2 or not whole.all():
        return None
    variance, axes = np.linalg.eigh(profile.cov_yz_mm2)
    along = axes[:, :, 1] * (np.sqrt(np.maximum(variance[:, 1], 0)) / p.sigma_px)[:, None]
    if not np.all(variance[:, 1] > _FLAT**2):
        return None
    along *= np.where(along[:, 1] < 0, -1.0, 1.0)[:, None]
    # the image direction that leads away from the sensor is ± the normal: the sign that keeps the scale steady
    trials = [(s, *_across(profile, s * along)) for s in (1.0, -1.0)]
    sign, across, _ = min(trials, key=lambda trial: trial[2])
    if not np.isfinite(across).all():
        return None
    normal = p.normal.mean(axis=0)
    normal /= max(float(np.linalg.norm(normal)), _FLAT)
    tangent = np.column_stack([p.normal[:, 1], -p.normal[:, 0]])
    view = sign * along * (p.normal @ normal)[:, None] + across * (tangent @ normal)[:, None]
    view *= np.where(view[:, 1] < 0, -1.0, 1.0)[:, None]
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    return Sections(along, across, view, p.sigma_px, p.width_px, np.log(p.amplitude_dn * p.width_px))


def _across(profile: Profile, along: Array) -> tuple[Array, float]:
    """The shift in (y, z) for a pixel square to ``normal`` (N, 2), and how much it changes from point to point."""
    normal = profile.peaks.normal[:-1]
    step_px, step_mm = np.diff(profile.peaks.uv_px, axis=0), np.diff(profile.yz_mm, axis=0)
    square = step_px[:, 0] * normal[:, 1] - step_px[:, 1] * normal[:, 0]
    lengthwise = np.sum(step_px * normal, axis=1)
    usable = np.flatnonzero((np.abs(square) < _FAR_PX) & (np.abs(square) > _NEAR_PX))
    if len(usable) < 2:
        return np.full_like(along, np.nan), np.inf
    scale = (step_mm - along[:-1] * lengthwise[:, None])[usable] / square[usable, None]
    every = np.arange(len(along))
    across = np.column_stack([np.interp(every, usable, scale[:, k]) for k in range(2)])
    return across, float(np.mean(np.abs(np.diff(scale, axis=0))))
