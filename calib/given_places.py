"""Places of the target given in cell.toml, held against what the frames say of them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from geometry import Pose, Target, log_so3, target_at

_FAR_MM, _FAR_DEG = 30.0, 10.0  # ten σ of a place that was measured by hand: another unit or direction


def given_place_notes(
    given: Mapping[str, Pose], found: Mapping[str, Pose], target: Target | Mapping[str, Target]
) -> tuple[str, ...]:
    """A sentence for every location whose given T_base_jig is plainly not where its frames see the target."""
    out = []
    for name, place in given.items():
        if name not in found:
            continue
        alike = (found[name], *(found[name] @ s.pose for s in target_at(target, name).symmetries))
        apart = [place.inverse() @ T for T in alike]
        mm, deg = min((float(np.linalg.norm(a.t)), float(np.rad2deg(np.linalg.norm(log_so3(a.R))))) for a in apart)
        if mm > _FAR_MM or deg > _FAR_DEG:
            out.append(
                f"[locations.{name}] T_base_jig is {mm:.0f} mm and {deg:.0f}° from where its frames see the jig, "
                "and was not used: check its units, its direction (base from jig) and the location's name"
            )
    return tuple(out)
