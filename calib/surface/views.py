"""Sets of views from which a surface does not tell the SCP, each by its name, with the pose that would help."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.surface.describe import section_depths, section_share
from geometry import Frame, Pose, Surface, Target, log_so3, stack_poses, target_at
from jig_cad import Plane, Sphere

Array = NDArray[np.float64]

# what is less is noise of the second order: the solution itself moves these angles by about as much
_ALIKE_DEG = 2.0  # tilts nearer than this are one
_FLAT = 0.03  # share of the tilts' spread that stands out of one circle, where all lie on one
_FEWEST_TILTS = 4
_SQUARE_DEG = 3.0  # a border crossed at less than this off the right angle
_MIDDLE = 0.1  # of the radius, rms: a section cut nearer the middle is smaller by half a percent
_FARTHEST = 0.15  # of the radius: what the open shift adds to one of them where all are cut through the middle
_STILL_DEG = 3.0  # rotations between frames that are a pure translation
_ONE_AXIS = 0.03  # second singular value of the rotations over the first
_PARALLEL = 0.05  # sine of the angle between a ridge and the axis of all turns


@dataclass(frozen=True)
class Degenerate:
    """Why a set of views leaves something open, and what to add. certain: also where its σ seem to say otherwise."""

    text: str
    certain: bool = False


def degenerate(
    frames: Sequence[Frame],
    target: Target | Mapping[str, Target],
    T_hand_sensor: Pose | None,
    places: Mapping[str, Pose],
) -> Degenerate | None:
    """The name of what is wrong with the views of surfaces, None where nothing that has a name is.

    frames: used ones with their ``hand``. T_hand_sensor, places: where they are known.
    """
    kinds = [target_at(target, f.location) for f in frames]
    if not frames or not all(isinstance(t, Surface) for t in kinds):
        return None
    return (
        _translation(frames, kinds)
        or _one_axis(frames, kinds, places)
        or _middle(frames, kinds, T_hand_sensor, places)
        or _square(frames, kinds, T_hand_sensor, places)
        or _tilts(frames, kinds, places)
    )


OPEN_CONDITION = (
    300.0  # of the SCP, scaled: sound views of surfaces stay below 40, exact degeneracy with noise above 1000
)


def general_advice(target: Target | Mapping[str, Target], frames: Sequence[Frame]) -> str:
    """What to add where the views of surfaces leave something open that has no name."""
    kinds = [target_at(target, f.location) for f in frames]
    if all(isinstance(t, Plane) for t in kinds):
        return (
            "the tilts of the sensor against the plane are not in general position (two amounts about two axes are "
            "not): add poses tilted by other amounts about other axes, or planes turned otherwise"
        )
    return "add poses turned by 20° or more about two axes, that see the target at other places of the field of view"


def _turns(frames: Sequence[Frame]) -> Array:
    """Rotation vectors (P, 3), hand axes, between all frames of a location."""
    out = [np.zeros((0, 3))]
    for name in dict.fromkeys(f.location for f in frames):
        R = np.stack([f.at.R for f in frames if f.location == name])
        i, j = np.triu_indices(len(R), 1)
        out.append(log_so3(np.swapaxes(R[i], -1, -2) @ R[j]) if len(i) else np.zeros((0, 3)))
    return np.concatenate(out)


def _what(kinds: Sequence[Target]) -> str:
    names = dict.fromkeys(t.kind for t in kinds if isinstance(t, Surface))
    return " and ".join(names)


def _translation(frames: Sequence[Frame], kinds: Sequence[Target]) -> Degenerate | None:
    turns = np.linalg.norm(_turns(frames), axis=1)
    if not len(turns) or np.max(turns) > np.deg2rad(_STILL_DEG):
        return None
    planes = all(isinstance(t, Plane) for t in kinds) and len({f.location for f in frames}) < 3
    told = "and not even the rotation follows from a plane" if planes else "which tells the sensor's rotation alone"
    return Degenerate(
        f"the hand was shifted and hardly turned between the frames of a location (by {np.rad2deg(turns.max()):.2g}° "
        f"at most), {told}: add poses that turn the sensor by 20° or more about two different axes"
    )


def _one_axis(frames: Sequence[Frame], kinds: Sequence[Target], places: Mapping[str, Pose]) -> Degenerate | None:
    turns = _turns(frames)
    if len(turns) < 2:
        return None
    _, spread, axes = np.linalg.svd(turns, full_matrices=False)
    if len(spread) > 1 and spread[1] > _ONE_AXIS * spread[0]:
        return None
    text = "the hand turned about one axis only between the frames of a location"
    ridges = [
        frames[i].at.R.T @ places[frames[i].location].R[:, 0]
        for i, t in enumerate(kinds)
        if isinstance(t, Surface) and t.runs_along_x and frames[i].location in places
    ]
    if ridges and all(np.linalg.norm(np.cross(axes[0], r)) < _PARALLEL for r in ridges):
        text = f"all turns of the hand are about the {_what(kinds)}'s own line, along which nothing shows"
    return Degenerate(
        f"{text}, so that shifts along that axis stay open: add poses turned by 20° or more about an axis at right "
        "angles to it"
    )


def _middle(
    frames: Sequence[Frame], kinds: Sequence[Target], T: Pose | None, places: Mapping[str, Pose]
) -> Degenerate | None:
    if T is None or not all(isinstance(t, Sphere) for t in kinds):
        return None
    share = []
    for f, t in zip(frames, kinds, strict=True):
        if f.location in places and isinstance(t, Sphere):
            depth = section_depths([f], stack_poses([f.at @ T]), places[f.location])[0]
            share.append(abs(float(depth)) / (t.diameter_mm / 2))
    found = float(np.sqrt(np.mean(np.square(share)))) if max(share, default=np.inf) < _FARTHEST else np.inf
    if found > _MIDDLE:  # the shift that is open moves all depths; the sections' own radii do not hang on it
        radius = {t.diameter_mm / 2 for t in kinds if isinstance(t, Sphere)}
        seen = section_share(frames, radius.pop()) if len(radius) == 1 else None
        found = np.inf if seen is None else seen
    if found > _MIDDLE:
        return None
    return Degenerate(
        f"every frame cuts the ball through its middle (some {found:.0%} of its radius beside it), where a "
        "shift of the sensor across its sheet does not show: add poses whose sheet cuts the ball half a radius beside "
        "its middle, to both sides",
        certain=True,
    )


def _square(
    frames: Sequence[Frame], kinds: Sequence[Target], T: Pose | None, places: Mapping[str, Pose]
) -> Degenerate | None:
    if T is None or not all(isinstance(t, Surface) and t.runs_along_x for t in kinds):
        return None
    off = []
    for f in frames:
        if f.location in places:
            along = (f.at @ T).R.T @ places[f.location].R[:, 0]
            off.append(float(np.rad2deg(np.arccos(min(1.0, abs(float(along[0])))))))
    if not off or max(off) > _SQUARE_DEG:
        return None
    return Degenerate(
        f"every frame crosses the {_what(kinds)}'s line square (within {max(off):.1f}°), where a shift of the sensor "
        "along it does not show: add poses whose sheet crosses the line 20° or more off the right angle, to both sides",
        certain=True,
    )


def _tilts(frames: Sequence[Frame], kinds: Sequence[Target], places: Mapping[str, Pose]) -> Degenerate | None:
    """Planes seen at too few tilts, or at tilts that are not in general position."""
    if not all(isinstance(t, Plane) for t in kinds) or not all(f.location in places for f in frames):
        return None
    normals = np.array([places[f.location].R[:, 2] for f in frames])
    seen = np.array([f.at.R.T @ n for f, n in zip(frames, normals, strict=True)])  # in the hand
    seen = seen * np.where(seen @ seen[0] < 0, -1.0, 1.0)[:, None]
    base = normals * np.where(normals @ normals[0] < 0, -1.0, 1.0)[:, None]
    orientations, tilts = _distinct(base), _distinct(seen)
    if len(orientations) > 2:
        return None
    named = f"{len(orientations)} plane{'s' * (len(orientations) > 1)}"
    add = "add poses that tilt the sensor by other amounts about other axes, or a plane turned otherwise"
    if len(tilts) < _FEWEST_TILTS:
        return Degenerate(
            f"{named} seen at {len(tilts)} different tilt{'s' * (len(tilts) > 1)} of the sensor, and four or more in "
            f"general position are needed (shifts and turns about the normal add nothing): {add}",
            certain=True,
        )
    if len(orientations) > 1:
        return None
    if np.linalg.matrix_rank(tilts, tol=_FLAT) < 3:
        return Degenerate(f"one plane seen at tilts about one axis only: {add}", certain=True)
    spread = np.linalg.svd(tilts - tilts.mean(axis=0), compute_uv=False)
    if spread[-1] < _FLAT * spread[0]:
        return Degenerate(
            f"one plane seen at tilts of one amount, or of two amounts about two axes: {add}", certain=True
        )
    return None


def _distinct(directions: Array) -> Array:
    """Directions (N, 3) that differ by more than a tilt's worth, the first of each."""
    out: list[Array] = []
    for d in directions:
        if all(d @ other < np.cos(np.deg2rad(_ALIKE_DEG)) for other in out):
            out.append(d)
    return np.array(out)
