"""Strings and wires in a profile: clusters of a few points, as wide as a string and open to either side."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.stripe import Profile
from geometry import SurfacePoints

Array = NDArray[np.float64]

_WIDEST = 4.0  # diameters: a string crosses the sheet at up to 75°, and blur widens it
_JUMP = 3.0  # diameters: a step in depth between neighbours that ends a surface
_GAP_PITCHES = 2.5
_MOST_POINTS = 60  # of a string: a fine profiler on a thick wire


def string_points(profile: Profile, diameter_mm: float) -> SurfacePoints:
    """The strings of a profile as surface points, each the middle of its cluster.

    Parameters
    ----------
    profile
        Of a sensor that gives points.
    diameter_mm
        Of the strings.

    Returns
    -------
    SurfacePoints
        Best first: the score is how nearly a cluster is as wide as a string. What is wider than a string can be (a
        post, a wall) is no cluster of one. σ are those of a mean, with the
        uncertainty of where in its pitch a border falls.
    """
    order = np.argsort(profile.yz_mm[:, 0], kind="stable")
    yz, cov = profile.yz_mm[order], profile.cov_yz_mm2[order]
    light = profile.peaks.amplitude_dn[order]
    if len(yz) == 0:
        return SurfacePoints.empty()
    step = np.diff(yz[:, 0])
    pitch = float(np.median(step[step > 0])) if np.any(step > 0) else 0.0
    # a lone string on an even grid has neighbours far off: the pitch is then the smallest step
    pitch = min(pitch, float(np.percentile(step[step > 0], 20))) if np.any(step > 0) else diameter_mm
    breaks = (step > _GAP_PITCHES * pitch) | (np.abs(np.diff(yz[:, 1])) > _JUMP * diameter_mm)
    groups = np.split(np.arange(len(yz)), np.flatnonzero(breaks) + 1)
    spots = [_spot(yz[g], cov[g], light[g], diameter_mm, pitch) for g in groups]
    kept = sorted((s for s in spots if s is not None), key=lambda s: -s[2])
    n = len(kept)
    if n == 0:
        return SurfacePoints.empty()
    nan2 = np.full((n, 2), np.nan)
    return SurfacePoints(
        uv_px=nan2,
        cov_uv_px2=np.full((n, 2, 2), np.nan),
        yz_mm=np.array([s[0] for s in kept]),
        cov_yz_mm2=np.array([s[1] for s in kept]),
        score=np.array([s[2] for s in kept]),
        flag=("",) * n,
        axis_rad=np.full(n, np.nan),
        sigma_px=nan2,
        amplitude_dn=np.array([s[3] for s in kept]),
    )


def _spot(
    yz: Array, cov: Array, light: Array, diameter_mm: float, pitch: float
) -> tuple[Array, Array, float, float] | None:
    """Mean, covariance, score and light of a cluster; None where it is no string's."""
    width = float(np.ptp(yz[:, 0])) + pitch
    if width > _WIDEST * diameter_mm + 2 * pitch or len(yz) > _MOST_POINTS:
        return None
    n = len(yz)
    mean_cov = cov.mean(axis=0) / n
    # each of two borders falls anywhere within a pitch; their mean is the cluster's place
    mean_cov[0, 0] += pitch**2 / 24
    score = float(np.exp(-0.5 * (max(abs(width - diameter_mm) - pitch, 0.0) / diameter_mm) ** 2))
    return yz.mean(axis=0), mean_cov, max(score, 0.01), float(light.mean())
