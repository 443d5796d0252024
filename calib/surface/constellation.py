"""Which of several balls each section is of: by sizes and distances in a frame, else by all frames of a place together.

A section of radius r tells a ball's centre in its sheet and, of radius R, √(R² - r²) beside it on one side or the
other. Equal balls are told apart by where they stand: three sections, each with a ball and a side, give a place of the
balls' frame; of all such places the one is taken that explains most sections. An SCP by its drawing suffices for that,
as long as balls stand farther apart than it is wrong.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, islice, permutations, product

import numpy as np
from numpy.typing import NDArray

from calib.figures import pose_distance
from geometry import Frame, Pose, stack_poses
from jig_cad import Balls, frame_with_x

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_SLACK = 0.01  # share of a radius by which a section's radius may be wrong: what a fit to a short arc leaves open
_CAP_MM = 25.0  # of a section's misfit: an SCP by its drawing is wrong by less at the balls
_OTHER_MM, _REACH_MM = 30.0, 50.0  # places nearer than this, 50 mm from the middle of the balls, are one
_AT_ONCE = 500  # places compared with all sections
_TRIPLES = 24  # of sections that places are made from, evenly over all
_MOST_PLACES = 4000  # made of these
_SAME = 1e-6


@dataclass(frozen=True, eq=False)
class FrameCircle:
    """A circle in one frame's sheet, with the name that its points bear: centre (2,) and radius [mm]."""

    label: str
    centre: Array
    radius: float


def sections_of(f: Frame) -> list[FrameCircle]:
    """The circles through a condensed frame's nodes, three to each."""
    labels = np.array(f.axis.label)
    out = []
    for label in dict.fromkeys(f.axis.label):
        yz = f.axis.yz_mm[labels == label]
        if len(yz) != 3:
            continue
        u, v = yz[1] - yz[0], yz[2] - yz[0]
        area = 2 * (u[0] * v[1] - u[1] * v[0])
        if abs(area) < 1e-9:
            continue
        away = np.array([v[1] * (u @ u) - u[1] * (v @ v), u[0] * (v @ v) - v[0] * (u @ u)]) / area
        out.append(FrameCircle(label, yz[0] + away, float(np.hypot(*away))))
    return out


def possible(sections: Sequence[FrameCircle], target: Balls) -> list[tuple[int, ...]]:
    """The balls (by number) that the sections of one frame can be of, by their sizes and distances alone."""
    radii = target.diameters_mm / 2
    apart = np.linalg.norm(target.centres_mm[:, None] - target.centres_mm, axis=-1)
    slack = _SLACK * float(np.max(radii))
    out = []
    for chosen in permutations(range(len(radii)), len(sections)):
        if any(s.radius > radii[k] + slack for k, s in zip(chosen, sections, strict=True)):
            continue
        depth = [np.sqrt(max(radii[k] ** 2 - s.radius**2, 0.0)) for k, s in zip(chosen, sections, strict=True)]
        pairs = combinations(range(len(sections)), 2)
        if all(_can_stand(sections[i], sections[j], depth[i], depth[j], apart[chosen[i], chosen[j]], slack)
               for i, j in pairs):  # fmt: skip
            out.append(chosen)
    return out


def _can_stand(a: FrameCircle, b: FrameCircle, depth_a: float, depth_b: float, apart: float, slack: float) -> bool:
    """Whether balls can be so far apart whose sections and depths beside the sheet these are; either side each."""
    across = float(np.hypot(*(a.centre - b.centre)))
    # a depth hangs steeply on a section's radius near the ball's middle
    soft = sum(float(np.sqrt(2 * s.radius * slack + slack**2)) for s in (a, b))
    least = max(abs(depth_a - depth_b) - soft, 0.0)
    most = depth_a + depth_b + soft
    return bool(np.hypot(across, least) - slack <= apart <= np.hypot(across, most) + slack)


def told_alone(f: Frame, target: Balls) -> Mapping[str, str] | None:
    """New names by the ones that a frame's points bear, where sizes and distances leave one choice; else None."""
    sections = sections_of(f)
    fits = possible(sections, target)
    if len(fits) != 1 or not sections:
        return None
    return {s.label: target.names[k] for s, k in zip(sections, fits[0], strict=True)}


def balls_places(group: Sequence[Frame], target: Balls, T_hand_sensor: Pose, count: int = 1) -> list[Pose]:
    """T_base_target of one location by an SCP: the places that explain most sections, at most ``count``, best first.

    An SCP that is wrong by what a drawing is may leave several that are about as good: a plate of balls seen from the
    other side. They differ by more than _OTHER_MM.
    """
    every = [(k, s) for k, f in enumerate(group) for s in sections_of(f)]
    if not every:
        return []
    sensors = stack_poses([f.at @ T_hand_sensor for f in group])
    frame = np.array([k for k, _ in every], dtype=np.intp)
    centre, radius = np.array([s.centre for _, s in every]), np.array([s.radius for _, s in every])
    made = list(islice(_places(sensors, frame, centre, radius, target), _MOST_PLACES))
    if not made:
        return []
    places = stack_poses(made)
    cost = np.concatenate([
        np.sum(np.min(_misfits(places[k : k + _AT_ONCE], sensors[frame], centre, radius, target), axis=2), axis=1)
        for k in range(0, len(places), _AT_ONCE)
    ])  # fmt: skip
    out: list[Pose] = []
    for k in np.argsort(np.round(cost / _SAME), kind="stable"):
        here = places[int(k)]
        if all(float(pose_distance(here, other, _REACH_MM)) > _OTHER_MM for other in out):
            out.append(here)
        if len(out) == count:
            break
    return out


def renamed_by_place(group: Sequence[Frame], target: Balls, T_hand_sensor: Pose, place: Pose) -> list[Frame]:
    """Condensed frames of one location with their points named after the balls that a place and an SCP put there."""
    out = []
    for f in group:
        sections = sections_of(f)
        if f.labels_given or not sections:
            out.append(f)
            continue
        sensor = stack_poses([f.at @ T_hand_sensor] * len(sections))
        centre, radius = np.array([s.centre for s in sections]), np.array([s.radius for s in sections])
        misfit = _misfits(stack_poses([place]), sensor, centre, radius, target)[0]
        choices = possible(sections, target) or list(permutations(range(len(target.names)), len(sections)))
        total = [round(float(sum(misfit[i, k] for i, k in enumerate(c))) / _SAME) for c in choices]
        best = choices[int(np.argmin(total))]
        out.append(with_names(f, {s.label: target.names[k] for s, k in zip(sections, best, strict=True)}))
    return out


def with_names(f: Frame, names: Mapping[str, str]) -> Frame:
    """The frame with other names of its points' features."""
    return replace(f, axis=replace(f.axis, label=tuple(names.get(n, n) for n in f.axis.label)))


def _places(sensors: Pose, frame: Index, centre: Array, radius: Array, target: Balls) -> Iterator[Pose]:
    """Places of the balls' frame that some three sections allow (two, of balls on one line)."""
    count = 2 if target.on_a_line else 3
    radii = target.diameters_mm / 2
    slack = _SLACK * float(np.max(radii))
    groups = list(combinations(range(len(frame)), count))
    chosen = np.unique(np.linspace(0, len(groups) - 1, min(_TRIPLES, len(groups))).astype(int))
    own = np.linalg.norm(target.centres_mm[:, None] - target.centres_mm, axis=-1)
    for g in chosen:
        members = groups[int(g)]
        for balls in permutations(range(len(radii)), count):
            if any(radius[s] > radii[k] + slack for s, k in zip(members, balls, strict=True)):
                continue
            depth = [np.sqrt(max(radii[k] ** 2 - radius[s] ** 2, 0.0)) for s, k in zip(members, balls, strict=True)]
            for side in product((-1.0, 1.0), repeat=count):
                there = np.array([
                    sensors[int(frame[s])] @ np.array([sign * d, *centre[s]])
                    for s, sign, d in zip(members, side, depth, strict=True)
                ])  # fmt: skip
                if all(
                    abs(np.linalg.norm(there[i] - there[j]) - own[balls[i], balls[j]]) < _CAP_MM
                    for i, j in combinations(range(count), 2)
                ):
                    place = _onto(target.centres_mm[list(balls)], there)
                    if place is not None:
                        yield place


def _onto(own: Array, there: Array) -> Pose | None:
    """The motion that carries points (N, 3) onto others; of two the turn about their line is open."""
    if len(own) == 2:
        x = (there[1] - there[0]) * np.sign((own[1] - own[0])[0])
        R = frame_with_x(x / np.linalg.norm(x))
        return Pose(R, there.mean(axis=0) - R @ own.mean(axis=0))
    a, b = own - own.mean(axis=0), there - there.mean(axis=0)
    U, spread, Vt = np.linalg.svd(b.T @ a)
    if spread[1] < 1e-3 * spread[0]:
        return None
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ Vt)]) @ Vt
    return Pose(R, there.mean(axis=0) - R @ own.mean(axis=0))


def _misfits(places: Pose, sensors: Pose, centre: Array, radius: Array, target: Balls) -> Array:
    """By place (P): how far [mm²] each section (S) is from the one that each ball (K) would have, capped (P, S, K)."""
    radii = target.diameters_mm / 2
    back = sensors.inverse()
    balls = np.einsum("pij,kj->pki", places.R, target.centres_mm) + places.t[:, None]
    seen = np.einsum("sij,pkj->pski", back.R, balls) + back.t[:, None]
    beside = np.abs(seen[..., 0])
    section = np.sqrt(np.maximum(radii**2 - beside**2, 0.0))
    off = np.sum((seen[..., 1:] - centre[:, None]) ** 2, axis=-1) + (section - radius[:, None]) ** 2
    off += np.maximum(beside - radii, 0.0) ** 2  # cut by nothing
    return np.asarray(np.minimum(off, _CAP_MM**2))
