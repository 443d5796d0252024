"""Which file spoils frames that no pose explains together, found from each frame's own pose of the jig.

The chain that refused the frames is what is in doubt: every frame is labelled anew, alone, and hand's and jig's motions
are compared. Where they agree, what is left to be wrong is the sensor's place by its drawing, and the motions tell it
in closed form.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle import hand_eye_start
from calib.config import CalibConfig
from calib.figures import agreeing_pose, pose_distance
from calib.judge.culprits import LEAST_PAIRS, disturbed_joints
from calib.judge.culprits_jig import LEAST_STRINGS, wrong_jig
from calib.judge.order import reordered
from calib.judge.screws import ScrewViews, disagreement, largest_group, numbers_of, share, views_of
from calib.label import label_frame
from geometry import Frame, Pose, Robot, Sensor, SurfacePoints, stack_poses
from jig_cad import STRINGS, Jig

Array = NDArray[np.float64]

# benchmarks/calib_degenerate.py: rows shifted from any frame on are named, sound cells never
_FITS = 0.9  # share of the pairs of frames that move alike once the rows are shifted back
_GAINED = 0.2  # and more than as they stand
_SHIFTS = (1, -1, 2, -2)  # rows: a trigger too many or too few, once or twice
_EQUAL = 1e-9
_MOST_FRAMES = 120  # each is labelled anew, alone; of a longer recording only what is in common is said
_LEAST_ROWS = 3  # shifted ones: fewer are single frames' faults
_GROUPED = 0.8  # of one location's frames that fall into groups which agree within themselves
_LEAST_GROUP = 3
_POSED = 0.5  # share of the frames with points enough that must have a pose of their own
_MOVES_ALIKE = 0.8  # share of the pairs by which the motions agree
_SIDES = np.geomspace(0.5, 2.0, 29)  # of the stated one
_UNIT_SHARE, _SIDE_SHARE = 2e-3, 1e-2  # σ of a spot by the jig's extent: of another unit or side it is only labelled
_LOOKED_AT = 6  # frames labelled by other sizes
_UNITS = {1e3: "metres", 25.4: "inches", 10.0: "centimetres", 1e-3: "micrometres"}  # how many mm one of these is
_PLACE_MM = 20.0  # how well frames of one location agree on its place by the sensor's place that the motions tell
_ELSEWHERE_MM, _ELSEWHERE_DEG = 60.0, 12.0  # of a drawing: more than labelling forgives
_HALF_TURN_DEG, _QUARTER_DEG, _AXIS_SHARE, _OBLIQUE = 155.0, 20.0, 0.9, 0.6


def cause_of(
    frames: tuple[Frame, ...],
    jig: Jig,
    robot: Robot | None,
    sensor: Sensor,
    design: Pose | None,
    config: CalibConfig,
    *,
    lost: bool = True,
) -> str:
    """A sentence that names the file, the column or the frames at fault; "" where the frames' own poses show none.

    lost: whether frames had to be left out; else only shifted rows and names of several places are looked for.
    """
    if len(frames) > _MOST_FRAMES:
        return ""
    rich = [f for f in frames if len(f.candidates) or len(f.points) >= LEAST_STRINGS]
    posed = tuple(g for f in rich if (g := _alone(f, jig, sensor, config)) is not None)
    if len(posed) < max(2 * _LEAST_GROUP, _POSED * len(rich)):
        return _another_jig(rich, jig, sensor, config) if lost else ""
    v = views_of(posed, jig)
    if len(v.pairs) < _LEAST_GROUP:
        return ""
    named = _shifted(v, frames) or _one_name(v) or reordered(v, frames, jig)
    if named or not lost:
        return named
    given = share(v, stack_poses([f.at for f in v.frames]))
    return (
        _pose_units(v, given)
        or (disturbed_joints(v, robot, given) if len(v.pairs) >= LEAST_PAIRS else "")
        or (_drawing(v, jig, design) if given >= _MOVES_ALIKE else "")
    )


def with_own_poses(labelled: tuple[Frame, ...], jig: Jig, sensor: Sensor, config: CalibConfig) -> tuple[Frame, ...]:
    """The frames, those that no pose explained together with the others with that of their own points."""
    return tuple(
        replace(g, reason=None)
        if f.reason == "not_labelled" and (g := _alone(f, jig, sensor, config)) is not None
        else f
        for f in labelled
    )


def _alone(f: Frame, jig: Jig, sensor: Sensor, config: CalibConfig) -> Frame | None:
    """The frame with the poses that its own points give, None where they give none."""
    if len(f.candidates):
        return f
    if f.labels_given or not len(f.points):
        return None
    found = label_frame(f.points, jig, sensor, None, config)
    if found.T_sensor_jig is None:
        return None
    return replace(f, candidates=stack_poses([found.T_sensor_jig]), axis=found.axis)


def _another_jig(frames: list[Frame], jig: Jig, sensor: Sensor, config: CalibConfig) -> str:
    """A jig in another unit than millimetres, or of another size; "" where neither gives the frames poses."""
    tried = [f for f in frames if not f.labels_given and len(f.points) >= LEAST_STRINGS][:_LOOKED_AT]
    if len(tried) < _LEAST_GROUP:
        return ""
    extent = float(np.max(np.ptp(jig.anchors_mm, axis=0)))

    def posed(times: float, share: float, other: Jig) -> tuple[Frame, ...]:
        changed = (replace(f, points=_times(f.points, times, share * extent)) for f in tried)
        return tuple(g for f in changed if (g := _alone(f, other, sensor, config)) is not None)

    enough, spots, fits = _POSED * len(tried), _lengths(tried), "the points fit the jig if"
    for times, unit in _UNITS.items():
        if len(posed(times, _UNIT_SHARE, jig)) >= enough:
            return f"{fits} {spots} are {unit}, or {_sizes(jig)} is {times:g} times too large"
        if len(posed(1 / times, _UNIT_SHARE, jig)) >= enough:
            return f"{fits} {_sizes(jig)} is in {unit}, or {spots} are {times:g} times too large"
    if jig.pillar is None or jig.measured or set(jig.strings) - set(STRINGS):
        return ""
    best: tuple[Frame, ...] = ()
    for times in _SIDES:
        side = jig.side_mm * times
        other = Jig.nominal(side, jig.height_mm, jig.string_diameter_mm, jig.tolerance_mm, strings=jig.strings)
        found = posed(1.0, _SIDE_SHARE, other)
        best = found if len(found) > len(best) else best
    return wrong_jig(best, jig) if len(best) >= enough else ""


def _lengths(frames: list[Frame]) -> str:
    """Where the lengths of spots come from: a file of points, or the camera's place by which images were measured."""
    given = any(np.any(~np.isfinite(f.points.amplitude_dn)) for f in frames)
    return "y_mm, z_mm of points.csv" if given else "translation_mm of [camera.pose] in sensor.toml, hence all spots,"


def _sizes(jig: Jig) -> str:
    """Where the jig's size stands."""
    return "side_mm with height_mm of jig.toml" if jig.pillar is not None else "[anchors_mm] of the jig"


def _times(points: SurfacePoints, factor: float, sigma_mm: float) -> SurfacePoints:
    """The points as if their file's unit were another, each known by ``sigma_mm``."""
    sigma = np.broadcast_to(sigma_mm**2 * np.eye(2), points.cov_yz_mm2.shape)
    return replace(points, yz_mm=points.yz_mm * factor, cov_yz_mm2=sigma)


def _pose_units(v: ScrewViews, given: float) -> str:
    """Hand poses in another unit than millimetres."""
    if any(f.T_base_hand is None for f in v.frames) or given >= _FITS:
        return ""
    hands = stack_poses([f.at for f in v.frames])
    for times, unit in _UNITS.items():
        fits = share(v, Pose(hands.R, hands.t * times))
        if fits > max(_FITS, given + _GAINED):
            return (
                f"hand and jig move alike in {fits:.0%} of the pairs of frames instead of {given:.0%} if x_mm, y_mm, "
                f"z_mm of frames.csv hold {unit}: give millimetres"
            )
    return ""


def _drawing(v: ScrewViews, jig: Jig, design: Pose | None) -> str:
    """The sensor's place that the motions tell, where the drawing's is another; "" where they tell none."""
    if design is None:
        return ""
    own, known = _labelled_alike(v, jig)
    hands = stack_poses([f.at for f in v.frames])[known]
    names = [v.names[int(i)] for i in known]
    location = np.array([names.index(n) for n in names], dtype=np.intp)
    X = hand_eye_start(hands, own, location)
    if X is None:
        return ""
    places = hands @ X @ own
    apart = [pose_distance(places[np.flatnonzero(location == k)], _middle(places, location, k)) for k in set(location)]
    if float(np.median(np.concatenate(apart))) > _PLACE_MM:
        return ""
    off = (X.inverse() @ design).log()
    angle = float(np.rad2deg(np.linalg.norm(off[3:])))
    shift = float(np.linalg.norm(X.t - design.t))
    if angle < _ELSEWHERE_DEG and shift < _ELSEWHERE_MM:
        return ""
    degrees, mm = X.fixed_xyz_deg, X.t
    says = (
        "[scp_initial] of cell.toml is not where the sensor is: the motions of hand and jig agree, and by them "
        f"rotation_deg is about [{degrees[0]:z.0f}, {degrees[1]:z.0f}, {degrees[2]:z.0f}] and translation_mm about "
        f"[{mm[0]:z.0f}, {mm[1]:z.0f}, {mm[2]:z.0f}]"
    )
    return f"{says}; {_turn_words(off[3:], angle)}" if angle >= _ELSEWHERE_DEG else f"{says}; it is {shift:.0f} mm off"


def _middle(places: Pose, location: NDArray[np.intp], k: int) -> Pose:
    """Where the frames of a location agree that it is."""
    return agreeing_pose([places[i : i + 1] for i in np.flatnonzero(location == k)])[0]


def _turn_words(axis: Array, angle_deg: float) -> str:
    """How the drawing is turned: a roll of 180° by name."""
    unit = axis / np.linalg.norm(axis)
    about = int(np.argmax(np.abs(unit)))
    where = f"about {'xyz'[about]} of the sensor" if abs(unit[about]) > _AXIS_SHARE else "about an oblique axis"
    if angle_deg > _HALF_TURN_DEG:
        swapped = abs(unit[1]) > _OBLIQUE < abs(unit[2])
        cause = "the sensor is mounted the other way round (a roll of 180°)"
        cause = "y and z of the points are exchanged, or the drawing's axes are" if swapped else cause
        return f"it is half a turn off, {angle_deg:.0f}° {where}: {cause}"
    quarter = f", a quarter turn {where}" if abs(angle_deg - 90.0) < _QUARTER_DEG else f" {where}"
    return f"it is turned by {angle_deg:.0f}°{quarter}: check the order and the axes of its rotations (R = Rz·Ry·Rx)"


def _labelled_alike(v: ScrewViews, jig: Jig) -> tuple[Pose, NDArray[np.intp]]:
    """Poses of the jig with one choice of its symmetries a location, and which frames (K,) of the views have one."""
    turns = (Pose.identity(), *(s.pose for s in jig.symmetries))
    apart = disagreement(v, stack_poses([f.at for f in v.frames]))
    own: dict[int, Pose] = {}
    for name in dict.fromkeys(v.names):
        group = [i for i, n in enumerate(v.names) if n == name]
        good = {
            (int(i), int(j)): int(np.argmin(apart[:, k]))
            for k, (i, j) in enumerate(v.pairs)
            if v.names[int(i)] == name and apart[:, k].min() < 1.0
        }
        first = max(group, key=lambda i: sum(i in pair for pair in good))
        own[first] = v.frames[first].candidates[0]
        for (i, j), turn in good.items():
            if first == i:
                own[j] = v.frames[j].candidates[0] @ turns[turn]
            elif first == j:
                own[i] = v.frames[i].candidates[0] @ turns[turn].inverse()
    known = np.array(sorted(own), dtype=np.intp)
    return stack_poses([own[int(i)] for i in known]), known


def _shifted(v: ScrewViews, frames: tuple[Frame, ...]) -> str:
    """Which rows have the reading of a neighbouring row, where shifting them back makes all motions agree.

    Where a row was lost, the reading of the frame there is nowhere in the file: its pairs do not count. Where one was
    doubled, two starts are equally good: the later one is where the readings begin to be wrong.
    """
    index = {f.number: i for i, f in enumerate(frames)}
    mine = np.array([index[f.number] for f in v.frames])
    hands, rows = stack_poses([f.at for f in frames]), np.arange(len(frames))
    given = share(v, hands[mine])
    best, words = max(_FITS, given + _GAINED), ""
    for step in _SHIFTS:
        for start in range(len(frames) - _LEAST_ROWS):
            shifted = rows >= start
            true = rows + step * shifted
            known = (true < len(frames)) & (true >= np.where(shifted, start, 0))
            fits = share(v, hands[np.clip(true, 0, len(frames) - 1)[mine]], known[mine])
            if fits > best - _EQUAL and (fits > best + _EQUAL or step > 0):
                best, words = max(fits, best), _shift_words(frames[start].number, start == 0, step)
    alike = f"hand and jig move alike in {best:.0%} of the pairs of frames instead of {given:.0%}"
    return f"{words} ({alike} if they are shifted back)" if words else ""


def _shift_words(first: int, everywhere: bool, step: int) -> str:
    """Which rows, and whose readings they have."""
    where = "" if everywhere else f"from frame {first} on "
    count, rows = ("one", "the row") if abs(step) == 1 else ("two", "two rows")
    whose, cause = ("before", "too many") if step > 0 else ("after", "too few")
    return (
        f"{where}each row is {count} late: its joint readings or pose are those of {rows} {whose}; "
        f"frames.csv has {count} reading{'' if count == 'one' else 's'} {cause} there"
    )


def _one_name(v: ScrewViews) -> str:
    """Whether frames under one location's name fall into groups that each move as one: several places, one name.

    Where that is all that is wrong, the frames of every group and of every other location move alike.
    """
    contrary = disagreement(v, stack_poses([f.at for f in v.frames])).min(axis=0) >= 1.0
    group_of, words = np.full(len(v.names), -1), ""
    for name in dict.fromkeys(v.names):
        members = left = [i for i, n in enumerate(v.names) if n == name]
        groups = []
        while len(left) >= _LEAST_GROUP:
            group = largest_group(v, contrary, left)
            if len(group) < _LEAST_GROUP:
                break
            groups.append(group)
            left = [i for i in left if i not in group]
        if len(groups) < 2 or sum(map(len, groups)) < _GROUPED * len(members):
            group_of[members] = group_of.max() + 1
            continue
        for group in groups:
            group_of[group] = group_of.max() + 1
        words = words or _several(v, name, groups, left)
    first, second = group_of[v.pairs].T
    within = (first == second) & (first >= 0)
    return words if words and float(np.mean(~contrary[within])) > _FITS else ""


def _several(v: ScrewViews, name: str, groups: list[list[int]], left: list[int]) -> str:
    """That a location is several, and which frames belong together."""
    parts = "; ".join(numbers_of(v, g) for g in groups)
    if left:
        parts += f" ({numbers_of(v, left)} fit{'s' if len(left) == 1 else ''} none of them)"
    only = len(set(v.names)) == 1
    says = f"all lie in one location: the column says {name} throughout" if only else f"location {name} is several"
    return f"{says}, but the target stood still only within each of these: {parts}; name each place"
