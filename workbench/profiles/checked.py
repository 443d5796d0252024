"""A scan line as points of the sensor's frame: missing ones left out, those that can not be points refused."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from extraction import Profile
from extraction.features import local_scatter
from geometry import InputError, inside_polygon
from geometry.sensor import ProfileOutput
from workbench.profiles.scan_line import ScanLine

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_NEAR_MARK = 2e-5  # share by which a mark of a missing point may be rounded: −999.9998
_APART_MM = 20.0  # a mark stands at least so far from all other points
_SMALL_MM = 1.0  # no sensor of this kind has a field this small; in metres all have
_LEAST_SIGMA_MM = 1e-4  # of points that lie on a line exactly: no sensor is better


@dataclass(frozen=True, eq=False)
class CheckedProfile:
    """Points of one profile in {P}. remarks: a sentence for each kind of point that was refused."""

    profile: Profile
    remarks: tuple[str, ...] = ()


def checked_profile(scan: ScanLine, output: ProfileOutput, path: Path) -> CheckedProfile:
    """The points of a scan line, with covariance.

    Parameters
    ----------
    scan
        As read.
    output
        What sensor.toml says of the sensor: its σ where the file states none, its field of view.
    path
        For sentences.

    Returns
    -------
    CheckedProfile
        In the file's order; σ that nobody states are what neighbouring points scatter by.

    Raises
    ------
    InputError
        Where most points lie outside the field of view, or all so near zero that they are metres.

    """
    there = scan.present
    yz = np.column_stack([scan.y_mm, scan.z_mm])[there]
    if len(yz) == 0:
        return CheckedProfile(_profile(scan, there, yz, output))
    if len(yz) >= 10 and np.max(np.abs(yz)) < _SMALL_MM:
        raise InputError(
            f"{path}: no coordinate is above {np.max(np.abs(yz)):.3g} mm, as if in metres: a profile's numbers are mm"
        )
    polygon = output.field_of_view_mm if output.field_of_view_mm is not None else _box(scan)
    outside = _marks(yz) if polygon is None else ~inside_polygon(yz, polygon)
    remarks: tuple[str, ...] = ()
    if np.any(outside):
        y, z = yz[np.flatnonzero(outside)[0]]
        count = f"{np.count_nonzero(outside)} of {len(yz)} points"
        example = f"such as (y, z) = ({y:.7g}, {z:.7g}) mm"
        if polygon is None:
            remarks = (f"{path}: {count} are marks of missing points, {example}, and are left out",)
        elif 2 * np.count_nonzero(outside) > len(yz):
            raise InputError(
                f"{path}: {count} lie outside the field of view, {example}: check field_of_view_mm, pitch_mm, start_mm "
                "and z_towards_sensor of sensor.toml, and the units"
            )
        else:
            remarks = (f"{path}: {count} lie outside the field of view, {example}, and are left out",)
        there = there.copy()
        there[np.flatnonzero(there)[outside]] = False
        yz = yz[~outside]
    return CheckedProfile(_profile(scan, there, yz, output), remarks)


def _profile(scan: ScanLine, there: Mask, yz: Array, output: ProfileOutput) -> Profile:
    covariance = np.zeros((len(yz), 2, 2))
    unknown = max(local_scatter(yz[np.argsort(yz[:, 0], kind="stable")]), _LEAST_SIGMA_MM) if len(yz) else 0.0
    for k, (given, stated) in enumerate(((scan.sigma_y_mm, output.sigma_y_mm), (scan.sigma_z_mm, output.sigma_z_mm))):
        sigma = np.full(len(yz), stated if stated is not None else unknown if given is None else np.nan)
        sigma = sigma if given is None else np.where(given[there] > 0, given[there], np.nan_to_num(sigma, nan=unknown))
        covariance[:, k, k] = sigma**2
    return Profile.of_points(yz, covariance, None if scan.intensity is None else scan.intensity[there])


def _box(scan: ScanLine) -> Array | None:
    """The range that the file states, as a polygon; its ends belong to it."""
    if scan.range_mm is None:
        return None
    (y0, y1), (z0, z1) = scan.range_mm + np.array([-1e-3, 1e-3])
    return np.array([[y0, z0], [y1, z0], [y1, z1], [y0, z1]])


def _marks(yz: Array) -> Mask:
    """Points that a mark of a missing value made: a power of ten below zero, far from all others."""
    out = np.zeros(len(yz), dtype=bool)
    for values in yz.T:
        size = np.where(values < -99, -values, 1.5)
        near = (size > 2) & (np.abs(size / 10.0 ** np.round(np.log10(size)) - 1) < _NEAR_MARK)
        rest = values[~near]
        if np.any(near) and len(rest):
            apart = np.abs(values - np.median(rest)) > _APART_MM + 2 * np.ptp(rest)
            out |= near & apart
    return out
