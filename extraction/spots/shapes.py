"""Shapes of the candidates' regions, measured by scikit-image: what a person wants to see of a refused candidate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.spots.stages import Stages

# ours for scikit-image's names
_COLUMNS = {
    "centroid-1": "u_px",
    "centroid-0": "v_px",
    "area": "area_px",
    "axis_major_length": "length_px",
    "axis_minor_length": "width_px",
    "orientation": "axis_rad",
    "eccentricity": "eccentricity",
    "solidity": "solidity",
    "perimeter": "perimeter_px",
    "intensity_mean": "mean_dn",
    "intensity_max": "max_dn",
}


def region_shapes(stages: Stages) -> dict[str, NDArray[np.generic]]:
    """
    Shapes of the lit regions of all candidates, kept and refused.

    A region is what lies above `region_level` of its candidate's height; candidates that were refused before a region
    was grown have none. The pipeline itself measures regions while it floods them; this is for looking, at some
    milliseconds a region.

    Parameters
    ----------
    stages
        What `extract_stages` saw.

    Returns
    -------
    columns
        Arrays of one length, a row for each region: ``candidate`` (index into ``stages.candidates``), ``reason`` of
        its refusal, "" where it was kept; centroid ``u_px``, ``v_px``; ``area_px``; ``length_px`` and ``width_px``, the
        axes of the ellipse of equal second moments; ``axis_rad``, direction of the long one from the columns to the
        rows, in (-π/2, π/2]; ``eccentricity``; ``solidity``, area over that of the convex hull; ``perimeter_px``;
        ``mean_dn`` and ``max_dn``, grey levels.

    """
    from skimage.measure import regionprops_table  # costs a second to import, and only looking needs it

    names = tuple(dict.fromkeys(name.partition("-")[0] for name in _COLUMNS))
    measured = regionprops_table(  # type: ignore[no-untyped-call] # scikit-image has no types
        stages.candidates.owner.astype(np.int32), intensity_image=stages.raw, properties=("label", *names)
    )
    candidate = np.asarray(measured["label"], dtype=np.intp) - 1
    table: dict[str, NDArray[np.generic]] = {
        "candidate": candidate,
        "reason": np.array([str(stages.candidates.reason[k]) for k in candidate], dtype=np.str_),
    }
    table |= {ours: np.asarray(measured[theirs]) for theirs, ours in _COLUMNS.items()}
    turn = np.asarray(measured["orientation"], dtype=float)  # from the rows to the columns
    table["axis_rad"] = np.pi / 2 - np.mod(turn, np.pi)
    return table
