"""Shapes of the candidates' regions, measured by scikit-image: what a person wants to see of a refused candidate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.spots.stages import Stages

PROPERTIES = (
    "area", "centroid", "axis_major_length", "axis_minor_length", "orientation", "eccentricity", "solidity",
    "perimeter", "intensity_max", "intensity_mean",
)  # fmt: skip


def region_shapes(stages: Stages) -> dict[str, NDArray[np.generic]]:
    """Columns of one length: `candidate` (index), `reason`, and scikit-image's PROPERTIES of the candidate's region.

    The region is what lies above `region_level` of the candidate's height; candidates that were refused before a region
    was grown have none. centroid-0 is the row, centroid-1 the column; orientation is from the rows' axis [rad].
    """
    from skimage.measure import regionprops_table  # costs half a second to import, and only looking needs it

    owner = stages.candidates.owner.astype(np.int32)
    table: dict[str, NDArray[np.generic]] = regionprops_table(  # type: ignore[no-untyped-call]
        owner, intensity_image=stages.raw, properties=("label", *PROPERTIES)
    )
    candidate = np.asarray(table.pop("label"), dtype=np.intp) - 1
    reason = np.array([stages.candidates.reason[k] for k in candidate], dtype=np.str_)
    return {"candidate": candidate, "reason": reason, **table}
