"""The triangular pillar: the paper's names of its anchors and strings, where they are, and its half turn."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from geometry import Pose, Symmetry

Array = NDArray[np.float64]
Index = NDArray[np.intp]

ANCHORS = ("Ab", "At", "Bb", "Bt", "Cb", "Ct")  # b: bottom plate, t: top plate
STRINGS = {
    "A": ("Ab", "At"),
    "B": ("Bb", "Bt"),
    "C": ("Cb", "Ct"),
    "B'": ("At", "Bb"),
    "C'": ("Ab", "Ct"),
    "D'": ("Bb", "Ct"),
}
DEFAULT_STRINGS = ("A", "B", "C", "B'", "C'")
UPRIGHT = ("A", "B", "C")

_HALF_TURN = {"A": "A", "B": "C", "C": "B", "B'": "C'", "C'": "B'", "D'": "D'"}
_SAME_MM = 1e-6  # anchors of other names that stand this near to a pillar's are the pillar's


@dataclass(frozen=True, eq=False)
class Pillar:
    """What makes a set of strings a regular triangular pillar.

    side_mm, height_mm: as drawn. strings: by the paper's name, A … D', the name that the jig gives the string.
    """

    side_mm: float
    height_mm: float
    strings: Mapping[str, str]

    def role(self, label: str) -> str:
        """The paper's name of the jig's string ``label``."""
        return next(role for role, name in self.strings.items() if name == label)


def nominal_anchors(side_mm: float, height_mm: float) -> Array:
    """The anchors of a regular pillar.

    Parameters
    ----------
    side_mm, height_mm : float
        Of the triangle between its anchors, and of its strings.

    Returns
    -------
    (6, 3) array
        [mm] in {J}, in the order of ANCHORS.
    """
    depth, half = np.sqrt(3) / 2 * side_mm, side_mm / 2
    bottom = np.array([[0, 0, 0], [0, -half, depth], [0, half, depth]])
    top = bottom + np.array([height_mm, 0, 0])
    return np.stack([bottom, top], 1).reshape(6, 3)


def half_turn(pillar: Pillar) -> tuple[Symmetry, ...]:
    """The map (x, y, z) → (h - x, -y, z), which carries the pillar onto itself; none where a string has no partner."""
    names = pillar.strings
    if any(_HALF_TURN[role] not in names for role in names):
        return ()
    turn = Pose(np.diag([-1.0, -1.0, 1.0]), np.array([pillar.height_mm, 0.0, 0.0]))
    return (Symmetry(turn, {name: names[_HALF_TURN[role]] for role, name in names.items()}),)


def pillar_of(anchors_mm: Array, strings: Sequence[str], start: Index, end: Index) -> Pillar | None:
    """The pillar that lines between anchors (A, 3) are, whatever their names: in {J}, exactly as drawn; else None."""
    side, height = float(np.ptp(anchors_mm[:, 1])), float(np.max(anchors_mm[:, 0]))
    apart = np.linalg.norm(anchors_mm[:, None] - nominal_anchors(side, height), axis=-1)
    place = np.argmin(apart, axis=1)
    if not (side > 0 and height > 0) or np.any(np.min(apart, axis=1) > _SAME_MM):
        return None
    roles = {frozenset(ends): role for role, ends in STRINGS.items()}
    found = [roles.get(frozenset((ANCHORS[place[a]], ANCHORS[place[b]]))) for a, b in zip(start, end, strict=True)]
    if None in found or len(set(found)) < len(found):
        return None
    named = {str(role): name for role, name in zip(found, strings, strict=True)}
    return Pillar(side, height, named) if set(UPRIGHT) & set(named) else None
