"""Profiles on disk: CSV with covariance and PLY points, written whole or not at all; CSV read back."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from extraction.stripe.profile import TAIL, Profile, StripePeaks, flag_bits, flag_names
from geometry import InputError, read_text, write_text
from geometry.errors import did_you_mean

Array = NDArray[np.float64]

COLUMNS = (
    "section,u_px,v_px,sigma_px,normal_u,normal_v,amplitude_dn,width_px,background_dn,chi2_per_dof,"
    "y_mm,z_mm,sigma_y_mm,sigma_z_mm,cov_yz_mm2,flag"
)
SENSOR_COLUMNS = (
    "sigma_sensor_y_mm,sigma_sensor_z_mm,cov_sensor_yz_mm2"  # behind them, where the sensor's file states σ
)
PIXEL_COLUMNS = "section,u_px,v_px,sigma_px,flag"
_LEAST_SCATTER_MM = 1e-4  # of points that lie on a line exactly: no sensor is better


def write_profile_csv(profile: Profile, path: str | Path) -> None:
    """Write a profile as CSV, one row a point.

    Parameters
    ----------
    profile
        Points (y, z) in {P}.
    path
        Where to; the file appears whole or not at all. Columns: COLUMNS; σ and covariance in mm and mm². Where the
        uncertainty of the sensor's own calibration is known, its part stands beside them: SENSOR_COLUMNS.

    Raises
    ------
    InputError
        Where it can not be written.
    """
    write_text(path, profile_text(profile))


def profile_text(profile: Profile) -> str:
    """A profile as the text of a CSV, one row a point, then those of its tails, flagged ``tail``.

    Parameters
    ----------
    profile
        Points (y, z) in {P}.

    Returns
    -------
    text
        Columns: COLUMNS, and SENSOR_COLUMNS where the sensor's own uncertainty is known.
    """
    lines = [COLUMNS if profile.sensor_cov_yz_mm2 is None else f"{COLUMNS},{SENSOR_COLUMNS}", *_rows(profile)]
    if profile.tails is not None:
        peaks = profile.tails.peaks
        lines += _rows(replace(profile.tails, peaks=replace(peaks, flag=peaks.flag | np.uint8(TAIL))))
    return "\n".join(lines) + "\n"


def _rows(profile: Profile) -> list[str]:
    p, own = profile.peaks, profile.sensor_cov_yz_mm2
    random = _sigma_columns(profile.cov_yz_mm2)
    numbers = np.column_stack(
        [p.uv_px, p.sigma_px, p.normal, p.amplitude_dn, p.width_px, p.background_dn, p.chi2_per_dof, profile.yz_mm]
    )
    common = np.zeros((len(p), 0)) if own is None else _sigma_columns(own)
    lines = []
    for section, row, flag, more in zip(p.section, np.hstack([numbers, random]), p.flag, common, strict=True):
        shown = [f"{x:.9g}" for x in row]
        lines.append(",".join([str(section), *shown, flag_names(int(flag)), *(f"{x:.9g}" for x in more)]))
    return lines


def _sigma_columns(covariance: Array) -> Array:
    """σ of y, σ of z and their covariance (N, 3)."""
    sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0))
    return np.column_stack([sigma, covariance[:, 0, 1]])


def write_peaks_csv(peaks: StripePeaks, path: str | Path) -> None:
    """Write a stripe's peaks as CSV, one row a point, in pixels: what there is without a sensor.

    Parameters
    ----------
    peaks
        Of `detect_stripe`.
    path
        Where to; the file appears whole or not at all. Columns: PIXEL_COLUMNS.

    Raises
    ------
    InputError
        Where it can not be written.
    """
    write_text(path, peaks_text(peaks))


def peaks_text(peaks: StripePeaks) -> str:
    """A stripe's peaks as the text of a CSV, one row a point, in pixels.

    Parameters
    ----------
    peaks
        Of `detect_stripe`.

    Returns
    -------
    text
        Columns: PIXEL_COLUMNS.
    """
    lines = [PIXEL_COLUMNS]
    for section, (u, v), sigma, flag in zip(peaks.section, peaks.uv_px, peaks.sigma_px, peaks.flag, strict=True):
        lines.append(f"{section},{u:.9g},{v:.9g},{sigma:.9g},{flag_names(int(flag))}")
    return "\n".join(lines) + "\n"


def write_profile_ply(profile: Profile, path: str | Path) -> None:
    """Write a profile as an ASCII PLY cloud.

    Parameters
    ----------
    profile
        Points (y, z) in {P}; written as (0, y, z) [mm] with the grey level as intensity, and their σ [mm]; where the
        uncertainty of the sensor's own calibration is known, its part as sigma_sensor_y and sigma_sensor_z.
    path
        Where to; the file appears whole or not at all.

    Raises
    ------
    InputError
        Where it can not be written.
    """
    own = profile.sensor_cov_yz_mm2
    sigmas = [_sigma_columns(c)[:, :2] for c in (profile.cov_yz_mm2, own) if c is not None]
    more = [] if own is None else ["sigma_sensor_y", "sigma_sensor_z"]
    header = [
        "ply",
        "format ascii 1.0",
        "comment laser stripe, sensor frame, mm",
        f"element vertex {len(profile)}",
        *(f"property double {name}" for name in "xyz"),
        "property float intensity",
        *(f"property float {name}" for name in ("sigma_y", "sigma_z", *more)),
        "end_header",
    ]
    numbers = np.column_stack([profile.yz_mm, profile.peaks.amplitude_dn, *sigmas])
    rows = ["0 " + " ".join(f"{x:.9g}" for x in row) for row in numbers]
    write_text(path, "\n".join([*header, *rows]) + "\n")


def read_profile_csv(path: str | Path) -> Profile:
    """Read what `write_profile_csv` wrote, or points of any other make.

    Parameters
    ----------
    path
        A CSV with the columns y_mm and z_mm; of COLUMNS all others may be missing.

    Returns
    -------
    profile
        Without columns of σ, it is what neighbouring points scatter by; without those of peaks they have zero σ and
        width.

    Raises
    ------
    InputError
        With file, line and column of what can not be used.
    """
    rows = csv.reader(read_text(path).splitlines())
    columns = [name.strip() for name in next(rows, [])]
    known = [*COLUMNS.split(","), *SENSOR_COLUMNS.split(",")]
    for name in columns:
        if name not in known or columns.count(name) > 1:
            hint = did_you_mean(name, known)
            raise InputError(f"{path}, line 1: column {name!r} is unknown or given twice{hint}; known are {COLUMNS}")
    if not {"y_mm", "z_mm"} <= set(columns):
        raise InputError(f"{path}, line 1: a profile needs the columns y_mm and z_mm; known are {COLUMNS}")
    table: dict[str, list[float]] = {name: [] for name in columns}
    for line, row in enumerate(rows, start=2):
        if len(row) != len(columns):
            raise InputError(f"{path}, line {line}: {len(row)} values for {len(columns)} columns")
        for name, value in zip(columns, row, strict=True):
            table[name].append(_value(name, value, f"{path}, line {line}, column {name}"))
    return _profile({name: np.array(values, dtype=float) for name, values in table.items()})


def _value(name: str, text: str, where: str) -> float:
    try:
        value = float(flag_bits(text)) if name == "flag" else float(text)
    except ValueError as error:
        what = str(error) if name == "flag" else f'"{text}" is not a number'
        raise InputError(f"{where}: {what[:120]}") from None
    if not np.isfinite(value):
        raise InputError(f"{where}: {text[:40]} is not finite")
    return value


def _profile(table: dict[str, Array]) -> Profile:
    """A profile from the columns that there are."""
    n = len(table["y_mm"])

    def column(name: str, default: float = 0.0) -> Array:
        return table.get(name, np.full(n, default))

    yz = np.column_stack([table["y_mm"], table["z_mm"]])
    peaks = StripePeaks(
        section=column("section").astype(np.int32) if "section" in table else np.arange(n, dtype=np.int32),
        uv_px=np.column_stack([column("u_px"), column("v_px")]),
        normal=np.column_stack([column("normal_u"), column("normal_v", 1.0)]),
        sigma_px=column("sigma_px"),
        amplitude_dn=column("amplitude_dn"),
        width_px=column("width_px"),
        background_dn=column("background_dn"),
        chi2_per_dof=column("chi2_per_dof"),
        flag=column("flag").astype(np.uint8),
    )
    sigma_z = table["sigma_z_mm"] if "sigma_z_mm" in table else np.full(n, _scatter_mm(yz))
    cov = _covariances(column("sigma_y_mm"), sigma_z, column("cov_yz_mm2"))
    y, z, yz_cov = (column(name) for name in SENSOR_COLUMNS.split(","))
    own = _covariances(y, z, yz_cov) if np.any(y + z) else None
    whole, beyond = Profile(peaks, yz, cov, own), (peaks.flag & TAIL) > 0
    if not beyond.any():
        return whole
    tails = whole[beyond]
    tails = replace(tails, peaks=replace(tails.peaks, flag=tails.peaks.flag & np.uint8(0xFF ^ TAIL)))
    return replace(whole[~beyond], tails=tails)


def _covariances(sigma_y: Array, sigma_z: Array, across: Array) -> Array:
    """Matrices (N, 2, 2) of σ and covariance."""
    return np.stack([np.stack([sigma_y**2, across], -1), np.stack([across, sigma_z**2], -1)], 1)


def _scatter_mm(yz: Array) -> float:
    """Robust σ of z from second differences along y, blind to the profile's course."""
    if len(yz) < 3:
        return _LEAST_SCATTER_MM
    second = np.diff(yz[np.argsort(yz[:, 0], kind="stable"), 1], 2)
    return max(float(1.4826 * np.median(np.abs(second)) / np.sqrt(6)), _LEAST_SCATTER_MM)
