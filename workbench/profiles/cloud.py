"""Points of a cloud as profiles: which of its columns is lateral, which the travel, which z."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from geometry import InputError
from workbench.profiles.scan_line import ScanLine

Array = NDArray[np.float64]

_FEWEST_A_PROFILE = 3


def profiles_of_cloud(
    xyz: Array, path: Path, intensity: Array | None = None, profile: Array | None = None
) -> tuple[ScanLine, ...]:
    """Profiles of points (N, 3); NaN is missing.

    Our own files have x = 0, makers' have y = 0 or the travel: of x and y the one with few values tells the profiles
    apart, and the other is lateral.

    Raises
    ------
    InputError
        Where neither is: a surface that was not measured line by line is no profile.

    """
    if len(xyz) == 0:
        raise InputError(f"{path}: holds no points")
    if profile is not None:
        constant = [k for k in (0, 1) if len(np.unique(xyz[np.isfinite(xyz[:, k]), k])) <= 1]
        travel, key = (constant[0] if constant else 1), profile
    else:
        counts = [len(np.unique(xyz[np.isfinite(xyz[:, k]), k])) for k in (0, 1)]
        travel = 0 if counts[0] <= counts[1] else 1
        if counts[travel] > 1 and counts[travel] * _FEWEST_A_PROFILE > len(xyz):
            raise InputError(
                f"{path}: a cloud of {len(xyz)} points with {counts[0]} different x and {counts[1]} different y is no "
                "profile and no stack of profiles: one of the two must be constant along a profile"
            )
        key = xyz[:, travel]
    lateral = 1 - travel
    groups = np.unique(key[np.isfinite(key)])
    if len(groups) == 0:
        groups, key = np.zeros(1), np.zeros(len(xyz))
    several = len(groups) > 1
    out = []
    for k, value in enumerate(groups):
        at = np.flatnonzero(key == value)
        number = (int(value) if profile is not None else k) if several else None
        light = None if intensity is None else intensity[at]
        out.append(ScanLine(xyz[at, lateral], xyz[at, 2], light, number=number))
    return tuple(out)
