"""What every kind of target says of itself."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from geometry.pose import Pose


@dataclass(frozen=True, eq=False)
class Symmetry:
    """A motion that carries a target onto itself: points alone never tell T from T @ pose.

    Parameters
    ----------
    pose : the motion, in the target's axes.
    renaming : by the name of a feature the name of the one that the motion carries it onto.
    """

    pose: Pose
    renaming: Mapping[str, str]

    def relabelled(self, label: str) -> str:
        """The name under T @ pose of a point that is ``label`` under T."""
        return next(name for name, onto in self.renaming.items() if onto == label)
