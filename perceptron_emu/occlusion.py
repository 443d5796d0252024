"""What stands between two points: other strings, and solids."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]


def hidden_by_cylinder(
    origins: Array, targets: Array, start: Array, direction: Array, length: float, radius: float
) -> Mask:
    """Whether a cylinder stands between origins (..., 3) and targets (..., 3) [mm]; exact, ends not capped.

    start, direction (3,), length, radius: the cylinder's axis, unit vector, extent and radius [mm].
    """
    ray = targets - origins
    offset = origins - start
    ray_across = ray - (ray @ direction)[..., None] * direction
    off_across = offset - (offset @ direction)[..., None] * direction
    a = np.sum(ray_across**2, -1)
    b = np.sum(ray_across * off_across, -1)
    c = np.sum(off_across**2, -1) - radius**2
    discriminant = b * b - a * c
    root = np.sqrt(np.maximum(discriminant, 0))
    a = np.maximum(a, 1e-300)
    hidden = np.zeros(a.shape, dtype=bool)
    for s in ((-b - root) / a, (-b + root) / a):
        height = (offset + s[..., None] * ray) @ direction
        hidden |= (discriminant > 0) & (s > 0) & (s < 1) & (height >= 0) & (height <= length)
    return hidden
