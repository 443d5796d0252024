"""What spoils data that do not fit together: frames, joint columns or a row of the robot's table, found by motions.

Whatever the sensor centre position is, the hand's motion between two frames of a location and the jig's motion that the
sensor sees turn by the same angle and advance by the same length along their axes (A X = X B: Chen's invariants of a
screw). So each suspicion can be tried alone, without any solution: it is named where motions that disagree come to
agree by it.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from geometry import Arm, DhRobot, Frame, Pose, Robot, log_so3, stack_poses
from geometry.robot import DH_ROWS, DhRow
from jig_cad import Jig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# benchmarks/calib_degenerate.py: how often the very cause is named, and that sound sets name none
ANGLE_RAD, ADVANCE_MM = float(np.deg2rad(1.5)), 5.0  # a nominal arm's and a single jig pose's own errors
LEAST_TURN_RAD = float(np.deg2rad(5.0))  # a smaller motion has no axis to speak of
MOST_FRAMES, LEAST_PAIRS = 60, 6
AGREED, GAINED = 0.8, 0.25  # share of the pairs that a suspicion brings to agree, and more than without it
GROSS = 4.0  # times what a motion may be off by: a frame that is not what it is said to be
SOUND = 0.9  # share of a location's pairs by which its motions agree
MAJORITY = 0.55  # of a location's frames, that the others are judged by
LENGTHS_MM = np.linspace(-400.0, 400.0, 101)
ANGLES_RAD = np.deg2rad(np.linspace(-180.0, 175.0, 72))
FINER = np.linspace(-1.0, 1.0, 9)  # of a step of these
SYMBOLS = {"theta": "θ", "d": "d", "a": "a", "alpha": "α"}
ROWS = tuple(row for row in DH_ROWS if row.group in SYMBOLS)  # β is 0 in every maker's table
EQUAL = 0.03  # suspicions this near in their share are told apart by nothing


@dataclass(frozen=True, eq=False)
class _Views:
    """Frames, the names of their locations, pairs (P, 2) that share one, and the jig's screw between them."""

    frames: tuple[Frame, ...]
    names: tuple[str, ...]
    pairs: NDArray[np.intp]
    screws: Array  # (1 + K, P, 2): angle and advance, as labelled and with one frame's labels turned
    joints: Array | None


def culprit(labelled: tuple[Frame, ...], jig: Jig, robot: Robot | None) -> str:
    """A sentence that names what most likely spoils the calibrate frames; "" where their motions name nothing."""
    used = tuple(s for s in labelled if s.role == "calibrate" and s.usable)[:MOST_FRAMES]
    v = _views(used, jig)
    if len(v.pairs) < LEAST_PAIRS:
        return ""
    apart = _apart(v, stack_poses([s.at for s in used]))
    agree = apart.min(axis=0) < 1.0
    return (
        (_joints(v, robot, float(agree.mean())) if agree.mean() < SOUND else "")
        or _frames(v, apart.min(axis=0), jig)
        or (_turned(v, (apart[0] >= 1.0) & agree, jig) if agree.mean() >= SOUND else "")
    )


def _views(used: tuple[Frame, ...], jig: Jig) -> _Views:
    names = tuple(s.location for s in used)
    index = [(i, j) for i, j in combinations(range(len(used)), 2) if names[i] == names[j]]
    pairs = np.array(index, dtype=np.intp).reshape(-1, 2)
    joints = [s.joints_rad for s in used]
    known = None if any(q is None for q in joints) or not joints else np.array(joints)
    if not len(pairs):
        return _Views(used, names, pairs, np.zeros((2, 0, 2)), known)
    screws = _jig_screws(used, pairs, jig)
    far = screws[0, :, 0] > LEAST_TURN_RAD
    return _Views(used, names, pairs[far], screws[:, far], known)


def _jig_screws(used: tuple[Frame, ...], pairs: NDArray[np.intp], jig: Jig) -> Array:
    """Angle and advance (1 + K, P, 2) of the jig's motions in the sensor: as labelled, turned by each symmetry."""
    jigs = stack_poses([s.candidates[0] for s in used])
    first, second = jigs[pairs[:, 0]], jigs[pairs[:, 1]]
    turns = (Pose.identity(), *(s.pose for s in jig.symmetries))
    return np.stack([_screw(second @ turn @ first.inverse()) for turn in turns])


def _screw(motion: Pose) -> Array:
    """Angle [rad] and advance along the axis [mm] of the motions (..., 2)."""
    w = log_so3(motion.R)
    angle = np.linalg.norm(w, axis=-1)
    return np.stack([angle, np.sum(w * motion.t, axis=-1) / np.maximum(angle, 1e-9)], axis=-1)


def _apart(v: _Views, hands: Pose) -> Array:
    """How far hand's and jig's screws are apart, over what they may be (1 + K, P): as labelled, turned."""
    screw = _screw(hands[v.pairs[:, 1]].inverse() @ hands[v.pairs[:, 0]])
    return np.asarray(np.linalg.norm((v.screws - screw) / [ANGLE_RAD, ADVANCE_MM], axis=-1))


def _share(v: _Views, hands: Pose) -> float:
    """Share of the pairs that agree, whichever way their labels are turned."""
    return float(np.mean(_apart(v, hands).min(axis=0) < 1.0))


def _turned(v: _Views, only: Mask, jig: Jig) -> str:
    """The frames whose labels are those of the turned jig against most others of their location.

    only: which pairs (P,) agree with one frame's labels turned by a symmetry, and not as labelled.
    """
    turned: list[int] = []
    for name in dict.fromkeys(v.names):
        group = [i for i, n in enumerate(v.names) if n == name]
        against = {i: [j for j in group if _holds(v, only, i, j)] for i in group}
        turned += against[min(group, key=lambda i: len(against[i]))]
    if not turned:
        return ""
    return (
        f"the labels of {_numbers(v, turned)} are those of the jig turned by half against the other frames of "
        f"{'its' if len(turned) == 1 else 'their'} location: exchange {_exchanged(jig)} there"
    )


def _exchanged(jig: Jig) -> str:
    """Which names the jig's turn exchanges: "B and C, B' and C'"."""
    renaming = jig.symmetries[0].renaming if jig.symmetries else {}
    pairs = {frozenset(pair): pair for pair in renaming.items() if pair[0] != pair[1]}
    return ", ".join(f"{a} and {b}" for a, b in pairs.values())


def _holds(v: _Views, which: Mask, i: int, j: int) -> bool:
    """Whether the pair of frames i and j is one of ``which`` (P,)."""
    return bool(np.any(which & (v.pairs[:, 0] == min(i, j)) & (v.pairs[:, 1] == max(i, j))))


def _numbers(v: _Views, index: list[int]) -> str:
    numbers = [str(v.frames[i].number) for i in sorted(index)]
    return f"frame {numbers[0]}" if len(numbers) == 1 else f"frames {', '.join(numbers)}"


def _frames(v: _Views, apart: Array, jig: Jig) -> str:
    """The frames that do not move as the others of their location; "" where no location has a sound majority."""
    sound: dict[str, list[int]] = {}
    strange: dict[str, list[int]] = {}
    for name in dict.fromkeys(v.names):
        group = [i for i, n in enumerate(v.names) if n == name]
        kept = _largest_group(v, apart >= 1.0, group)
        rest = [i for i in group if i not in kept]
        halves = len(kept) > 2 and len(_largest_group(v, apart >= 1.0, rest)) == len(rest) > 2
        if len(group) > 2 and len(kept) < max(3.0, MAJORITY * len(group)) and not halves:
            return ""
        between = np.isin(v.pairs, kept).any(axis=1) & np.isin(v.pairs, rest).any(axis=1)
        if rest and not np.median(apart[between]) >= GROSS:
            return ""  # all motions are somewhat off: not these frames' fault
        sound[name] = kept
        strange |= {name: rest} if rest else {}
    return "; ".join(_stranger(v, name, rest, sound, strange, jig) for name, rest in strange.items())


def _largest_group(v: _Views, contrary: Mask, group: list[int]) -> list[int]:
    """The frames about the one that contradicts fewest, of which each contradicts few of the others.

    contrary: which pairs (P,) disagree; frames that hardly turned against each other are no pair and tell nothing.
    """
    if not group:
        return []
    alike = {i: {j for j in group if not _holds(v, contrary, i, j)} for i in group}
    kept = alike[max(group, key=lambda i: len(alike[i]))]
    return sorted(i for i in kept if len(alike[i] & kept) > 0.6 * len(kept))


def _stranger(
    v: _Views, name: str, rest: list[int], sound: dict[str, list[int]], strange: dict[str, list[int]], jig: Jig
) -> str:
    """What is said of the frames ``rest`` of a location: whose they are, where that shows."""
    does, it = ("does", "its") if len(rest) == 1 else ("do", "their")
    text = f"{_numbers(v, rest)} {does} not move as the other frames of location {name} {does}"
    for other, kept in sound.items():
        if other != name and kept and _fits(v, rest, kept, jig):
            return f"{text} but as those of location {other}: {it} location is misnamed"
    for other, group in strange.items():
        if other != name and _fits(v, rest, group, jig):
            return f"{text} but as {_numbers(v, group)} of location {other}: {it} location is misnamed"
    if len(rest) > 2:
        return f"{text} but as one another: the jig was moved, or two locations bear one name"
    return f"{text}: check {it} location, joint readings and image"


def _fits(v: _Views, rest: list[int], kept: list[int], jig: Jig) -> bool:
    """Whether the frames ``rest`` move as the frames ``kept`` of another location."""
    used = tuple(v.frames[i] for i in (*kept, *rest))
    pairs = np.array([(i, len(kept) + j) for i in range(len(kept)) for j in range(len(rest))], dtype=np.intp)
    across = _Views(used, v.names, pairs, _jig_screws(used, pairs, jig), None)
    return _share(across, stack_poses([s.at for s in used])) >= AGREED


def _joints(v: _Views, robot: Robot | None, given: float) -> str:
    """What in the joint columns or in the robot's table makes the motions agree; "" where nothing does."""
    if not isinstance(robot, Arm) or v.joints is None:
        return ""
    for kind in (_other_units, _other_columns, _other_rows):
        tried = [(share, words) for share, words in kind(v, robot) if share >= max(AGREED, given + GAINED)]
        if tried:
            best = max(share for share, _ in tried)
            words = [w for share, w in sorted(tried, key=lambda t: -t[0]) if share >= best - EQUAL][:3]
            return (
                f"hand and jig move alike in {best:.0%} of the pairs of frames instead of {given:.0%} if "
                f"{', or '.join(words)}"
            )
    return ""


def _other_units(v: _Views, robot: Arm) -> Iterator[tuple[float, str]]:
    """Radians for degrees, and readings of a neighbouring row."""
    q = np.asarray(v.joints)
    yield _share(v, robot.pose(np.rad2deg(q))), "the joint columns hold radians, not degrees"
    yield _share(v, robot.pose(np.deg2rad(q))), "the joint columns hold degrees, not radians"
    for step, words in ((1, "row before"), (-1, "row after")):
        yield _share(v, robot.pose(np.roll(q, step, axis=0))), f"each frame has the joint readings of the {words}"


def _other_columns(v: _Views, robot: Arm) -> Iterator[tuple[float, str]]:
    """One joint of the other sign, or two columns exchanged."""
    q = np.asarray(v.joints)
    for k in range(q.shape[1]):
        turned = q.copy()
        turned[:, k] *= -1.0
        yield _share(v, robot.pose(turned)), f"joint {k + 1} counts the other way round (its sign)"
    for i, j in combinations(range(q.shape[1]), 2):
        other = q.copy()
        other[:, [i, j]] = q[:, [j, i]]
        yield _share(v, robot.pose(other)), f"the columns of joints {i + 1} and {j + 1} are exchanged"


def _other_rows(v: _Views, robot: Arm) -> Iterator[tuple[float, str]]:
    """One number of the robot's table of another value: the best over a grid, then over a finer one."""
    for row, joint in product(ROWS, range(robot.n_joints)):
        grid = ANGLES_RAD if row.unit == "rad" else LENGTHS_MM
        step = grid[1] - grid[0]
        coarse = max(grid, key=lambda value: _closeness(v, robot, row, joint, value))
        value = max(coarse + step * FINER, key=lambda value: _closeness(v, robot, row, joint, value))
        change = f"{np.rad2deg(value):+.0f}°" if row.unit == "rad" else f"{value:+.0f} mm"
        yield (
            _share(v, _changed(robot, row, joint, value).pose(np.asarray(v.joints))),
            f"{SYMBOLS[row.group]} of joint {joint + 1} in the robot's table is changed by about {change}",
        )


def _changed(robot: Arm, row: DhRow, joint: int, value: float) -> DhRobot:
    change = np.zeros(robot.n_joints)
    change[joint] = value
    return robot.dh_part().with_changes(**{row.group: change})


def _closeness(v: _Views, robot: Arm, row: DhRow, joint: int, value: float) -> float:
    """Mean nearness in (0, 1] of hand's and jig's motions with the number changed."""
    apart = _apart(v, _changed(robot, row, joint, value).pose(np.asarray(v.joints))).min(axis=0)
    return float(np.mean(1.0 / (1.0 + apart**2)))
