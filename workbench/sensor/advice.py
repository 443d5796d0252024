"""What is weak in a sensor's calibration, in words, and what to record next."""

from __future__ import annotations

import numpy as np

from calib.sensor import SensorCalibration, SensorSolution

STEEP_DEG, MANY = 15.0, 12  # a board that tells the focal length; views beyond which more gain little
EMPTY_SHARE = 0.08  # of all corners, in a ninth of the image that is as good as empty
MIN_DEPTH_SHARE = 0.15  # of the middle distance, from nearest to farthest stripe


def weak_directions(s: SensorSolution) -> list[str]:
    """The two combinations of parameters that the views tell least of, each by one of its σ."""
    names = s.uncertainty.parameters
    sigma = np.sqrt(np.diag(s.uncertainty.covariance))
    correlation = s.uncertainty.covariance / np.outer(sigma, sigma)
    values, vectors = np.linalg.eigh(correlation)
    out = []
    for value, vector in list(zip(values, vectors.T, strict=True))[::-1][:2]:
        if value < 1.5:
            continue
        order = np.argsort(-np.abs(vector), kind="stable")[:4]
        parts = [f"{_word(names[i])} {np.sign(vector[i]) * sigma[i]:+.2g}" for i in order if abs(vector[i]) > 0.25]
        out.append("moving together: " + ", ".join(parts))
    return out


def next_views(result: SensorCalibration, size_px: tuple[int, int]) -> list[str]:
    """What to record next, most useful first."""
    used = [v for v in result.views if v.used and v.corners_px is not None]
    out = []
    tilts = np.array([v.tilt_deg for v in used])
    if np.sum(tilts > STEEP_DEG) < max(3, len(used) // 3):
        steep = int(np.sum(tilts > STEEP_DEG))
        out.append(f"tilt the board more: {steep} of {len(used)} views stand at {STEEP_DEG:g}° or more")
    corners = np.concatenate([v.corners_px for v in used if v.corners_px is not None])
    where = (np.clip(corners / np.array(size_px), 0, 0.999) * 3).astype(int)
    count = np.zeros((3, 3))
    np.add.at(count, (where[:, 1], where[:, 0]), 1)
    words = [f"{a} {b}" for a in ("top", "middle", "bottom") for b in ("left", "centre", "right")]
    empty = [w for w, n in zip(words, count.ravel() / len(corners), strict=True) if n < EMPTY_SHARE / 3]
    if empty:
        out.append(f"bring corners to the image's {', '.join(empty)}: the lens is extrapolated there")
    if result.depth_mm is not None:
        near, middle, far = result.depth_mm
        if far - near < MIN_DEPTH_SHARE * abs(middle):
            out.append(f"stripes lie between z = {near:.0f} and {far:.0f} mm only: record nearer and farther boards")
    without = [v.name for v in used if v.stripe_mm is None or len(v.stripe_mm) == 0]
    if without:
        out.append(f"no stripe on the board in {', '.join(without)}: let the sheet cross it")
    if len(used) < MANY:
        out.append(f"{len(used)} views: up to {MANY} the σ shrink with every one")
    return out or ["nothing is missing"]


def _word(name: str) -> str:
    return {
        "plane_tilt_y_rad": "plane's turn about y [rad]",
        "plane_tilt_z_rad": "plane's turn about z [rad]",
        "plane_shift_mm": "plane's shift [mm]",
    }.get(name, name)
