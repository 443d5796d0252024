"""Profiles on disk: CSV with covariance and PLY points, written whole or not at all; CSV read back."""

from __future__ import annotations

import csv
import os
import tempfile
from pathlib import Path

import numpy as np

from extraction.profile import Profile, StripePeaks, flag_bits, flag_names
from geometry import InputError

COLUMNS = (
    "section,u_px,v_px,sigma_px,normal_u,normal_v,amplitude_dn,width_px,background_dn,chi2_per_dof,"
    "y_mm,z_mm,sigma_y_mm,sigma_z_mm,cov_yz_mm2,flag"
)


def write_profile_csv(profile: Profile, path: str | Path) -> None:
    """One row a point; (y, z) in {P}, σ and covariance in mm."""
    p, cov = profile.peaks, profile.cov_yz_mm2
    sigma = np.sqrt(np.maximum(np.diagonal(cov, axis1=1, axis2=2), 0))
    more = (profile.yz_mm, sigma, cov[:, 0, 1])
    numbers = np.column_stack(
        [p.uv_px, p.sigma_px, p.normal, p.amplitude_dn, p.width_px, p.background_dn, p.chi2_per_dof, *more]
    )
    lines = [COLUMNS]
    for section, row, flag in zip(p.section, numbers, p.flag, strict=True):
        lines.append(f"{section},{','.join(f'{x:.9g}' for x in row)},{flag_names(int(flag))}")
    write_atomically(path, "\n".join(lines) + "\n")


def write_profile_ply(profile: Profile, path: str | Path) -> None:
    """The points as an ASCII PLY cloud (x = 0, y, z) in {P} [mm] with their grey levels as intensity."""
    header = [
        "ply",
        "format ascii 1.0",
        "comment laser stripe, sensor frame, mm",
        f"element vertex {len(profile)}",
        *(f"property double {name}" for name in "xyz"),
        "property float intensity",
        "end_header",
    ]
    rows = [f"0 {y:.9g} {z:.9g} {a:.6g}" for (y, z), a in zip(profile.yz_mm, profile.peaks.amplitude_dn, strict=True)]
    write_atomically(path, "\n".join([*header, *rows]) + "\n")


def read_profile_csv(path: str | Path) -> Profile:
    """The profile that `write_profile_csv` wrote; InputError names the file and line that can not be used."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: not a readable profile: {error}") from None
    lines = text.splitlines()
    if not lines or lines[0].strip() != COLUMNS:
        raise InputError(f"{path}, line 1: the columns of a profile must be {COLUMNS}")
    table, flags = np.empty((len(lines) - 1, 15)), np.zeros(len(lines) - 1, dtype=np.uint8)
    for i, row in enumerate(csv.reader(lines[1:])):
        try:
            table[i], flags[i] = [float(x) for x in row[:15]], flag_bits(row[15])
        except (ValueError, IndexError) as error:
            raise InputError(f"{path}, line {i + 2}: 15 numbers and a flag are needed: {error}") from None
    if not np.isfinite(table).all():
        bad = int(np.flatnonzero(~np.isfinite(table).all(axis=1))[0])
        raise InputError(f"{path}, line {bad + 2}: holds a number that is not finite")
    peaks = StripePeaks(
        section=table[:, 0].astype(np.int32),
        uv_px=table[:, 1:3],
        normal=table[:, 4:6],
        sigma_px=table[:, 3],
        amplitude_dn=table[:, 6],
        width_px=table[:, 7],
        background_dn=table[:, 8],
        chi2_per_dof=table[:, 9],
        flag=flags,
    )
    cov = np.empty((len(table), 2, 2))
    cov[:, 0, 0], cov[:, 1, 1], cov[:, 0, 1] = table[:, 12] ** 2, table[:, 13] ** 2, table[:, 14]
    cov[:, 1, 0] = table[:, 14]
    return Profile(peaks, table[:, 10:12], cov)


def write_atomically(path: str | Path, text: str) -> None:
    """Write beside the target, then rename over it: a reader sees the old file or the new one."""
    target = Path(path)
    try:
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    except OSError as error:
        raise InputError(f"{target} can not be written: {error.strerror or error}") from None
    try:
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            file.write(text)
        Path(name).chmod(0o644)
        Path(name).replace(target)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise InputError(f"{target} can not be written: {error.strerror or error}") from None
