"""A jig of another size, or exchanged labels: found by the frames' own points, without robot and sensor pose."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from calib.pose import fit_pose
from geometry import AxisPoints, Frame, NoAnswerError
from jig_cad import Jig

Array = NDArray[np.float64]

# benchmarks/calib_degenerate.py: how often a wrong size or exchanged labels are named
FRAMES = 6  # looked at, spread over all
LEAST_STRINGS = 5  # fewer leave no residual to speak of
OFF_MM, FITS = 0.1, 0.3  # rms of points that do not fit the jig, and the share of it that a suspicion leaves
UNFIT_MM = 1e3  # stands for points that no pose explains
ALIKE = 1.3  # suspicions whose residuals are this near are told apart by nothing
_EXTENTS = {"side_mm": "width across x in mm", "height_mm": "extent along x in mm"}  # of lines that are no pillar
SIZES = np.geomspace(0.5, 2.0, 29)


def wrong_jig(frames: tuple[Frame, ...], jig: Jig) -> str:
    """A sentence that names a wrong size of the jig or two exchanged labels; "" where the points fit as they are."""
    axes = [f.axis for f in frames if f.role == "calibrate" and len(f.axis) >= LEAST_STRINGS]
    axes = [axes[int(i)] for i in np.unique(np.linspace(0, len(axes) - 1, FRAMES).astype(int))] if axes else []
    if len(axes) < 3:
        return ""
    given = _rms(axes, jig)
    if given < OFF_MM:
        return ""
    tried = list(_labels(axes, jig))
    tried += [] if jig.measured else list(_sizes(axes, jig))
    best = min(rms for rms, _ in tried)
    if not best < FITS * given:
        return ""
    words = ", or ".join(w for rms, w in tried if rms < ALIKE * best)
    before = f"instead of {given:.2g} mm" if given < UNFIT_MM else "and no pose of it as they are"
    return f"the points fit the jig to {best:.2g} mm, {before}, if {words}"


def _rms(axes: list[AxisPoints], jig: Jig) -> float:
    """Median over the frames of the points' rms distance from their strings in the best pose [mm]."""
    return float(np.median([_frame_rms(axis, jig) for axis in axes]))


def _frame_rms(axis: AxisPoints, jig: Jig) -> float:
    try:
        with np.errstate(invalid="ignore"):
            found = fit_pose(axis, jig)
    except NoAnswerError:
        return UNFIT_MM
    return float(np.sqrt(np.mean(found.candidates[0].residuals_mm ** 2)))


def _labels(axes: list[AxisPoints], jig: Jig) -> Iterator[tuple[float, str]]:
    """Two labels exchanged in all frames."""
    for a, b in combinations(jig.strings, 2):
        other = {a: b, b: a}
        changed = [replace(x, label=tuple(other.get(k, k) for k in x.label)) for x in axes]
        yield _rms(changed, jig), f"the labels {a} and {b} are exchanged"


def _sizes(axes: list[AxisPoints], jig: Jig) -> Iterator[tuple[float, str]]:
    """Another side, or another height."""
    from scipy.optimize import minimize_scalar  # a third of a second, and most commands need none of it

    for key in ("side_mm", "height_mm"):
        size = getattr(jig, key)

        def rms(value: float, key: str = key, size: float = size) -> float:
            along, across = (value / size, 1.0) if key == "height_mm" else (1.0, value / size)
            return _rms(axes, replace(jig, anchors_mm=jig.nominal_anchors_mm * [along, across, across]))

        coarse = min(size * SIZES, key=rms)
        step = SIZES[1] / SIZES[0]
        value = minimize_scalar(rms, bounds=(coarse / step, coarse * step), method="bounded").x
        what = key if jig.pillar is not None else _EXTENTS[key]
        yield rms(value), f"its {what} is about {value:.0f}, not {size:g}"
