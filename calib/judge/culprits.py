"""What spoils data that do not fit together: frames, joint columns or a row of the robot's table, found by motions.

Each suspicion is tried alone, without any solution: it is named where motions that disagree come to agree by it.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import suppress
from dataclasses import replace
from itertools import combinations, product

import numpy as np
from numpy.typing import NDArray

from calib.judge.screws import ScrewViews, disagreement, holds, jig_screws, largest_group, numbers_of, share, views_of
from geometry import Arm, DhRobot, Frame, InputError, Pose, Robot, stack_poses
from geometry.robot import DH_ROWS
from geometry.ties import first_least
from jig_cad import Jig

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

# benchmarks/calib_degenerate.py: how often the very cause is named, and that sound sets name none
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
NEARNESS_TIE = 1e-9  # of values that bring motions equally near, the first
EQUAL = 0.03  # suspicions this near in their share are told apart by nothing


def culprit(labelled: tuple[Frame, ...], jig: Jig, robot: Robot | None) -> str:
    """A sentence that names what most likely spoils the calibrate frames; "" where their motions name nothing."""
    used = tuple(s for s in labelled if s.role == "calibrate" and s.usable)[:MOST_FRAMES]
    v = views_of(used, jig)
    if len(v.pairs) < LEAST_PAIRS:
        return ""
    apart = disagreement(v, stack_poses([s.at for s in used]))
    agree = apart.min(axis=0) < 1.0
    return (
        (disturbed_joints(v, robot, float(agree.mean())) if agree.mean() < SOUND else "")
        or _frames(v, apart.min(axis=0), jig)
        or (_turned(v, (apart[0] >= 1.0) & agree, jig) if agree.mean() >= SOUND else "")
    )


def strangers(labelled: tuple[Frame, ...], jig: Jig, gone: Collection[int]) -> str:
    """A sentence on the frames ``gone`` (their numbers) that were left out, where they move as none of their location.

    "" where there is nothing to be said of them.
    """
    used = tuple(s for s in labelled if s.role == "calibrate" and s.usable)[:MOST_FRAMES]
    v = views_of(used, jig)
    if len(v.pairs) < LEAST_PAIRS:
        return ""
    apart = disagreement(v, stack_poses([s.at for s in used])).min(axis=0)
    named = {i for i, f in enumerate(v.frames) if f.number in gone}
    off = np.array([bool({int(i), int(j)} & named) for i, j in v.pairs])
    return _frames(v, np.where(off, apart, 0.0), jig)


def _turned(v: ScrewViews, only: Mask, jig: Jig) -> str:
    """The frames whose labels are those of the turned jig against most others of their location.

    only: which pairs (P,) agree with one frame's labels turned by a symmetry, and not as labelled.
    """
    turned: list[int] = []
    for name in dict.fromkeys(v.names):
        group = [i for i, n in enumerate(v.names) if n == name]
        against = {i: [j for j in group if holds(v, only, i, j)] for i in group}
        turned += against[min(group, key=lambda i: len(against[i]))]
    if not turned:
        return ""
    return (
        f"the labels of {numbers_of(v, turned)} are those of the jig turned by half against the other frames of "
        f"{'its' if len(turned) == 1 else 'their'} location: exchange {_exchanged(jig)} there"
    )


def _exchanged(jig: Jig) -> str:
    """Which names the jig's turn exchanges: "B and C, B' and C'"."""
    renaming = jig.symmetries[0].renaming if jig.symmetries else {}
    pairs = {frozenset(pair): pair for pair in renaming.items() if pair[0] != pair[1]}
    return ", ".join(f"{a} and {b}" for a, b in pairs.values())


def _frames(v: ScrewViews, apart: Array, jig: Jig) -> str:
    """The frames that do not move as the others of their location; "" where no location has a sound majority."""
    sound: dict[str, list[int]] = {}
    strange: dict[str, list[int]] = {}
    for name in dict.fromkeys(v.names):
        group = [i for i, n in enumerate(v.names) if n == name]
        kept = largest_group(v, apart >= 1.0, group)
        rest = [i for i in group if i not in kept]
        halves = len(kept) > 2 and len(largest_group(v, apart >= 1.0, rest)) == len(rest) > 2
        if len(group) > 2 and len(kept) < max(3.0, MAJORITY * len(group)) and not halves:
            return ""
        between = np.isin(v.pairs, kept).any(axis=1) & np.isin(v.pairs, rest).any(axis=1)
        if rest and not np.median(apart[between]) >= GROSS:
            return ""  # all motions are somewhat off: not these frames' fault
        sound[name] = kept
        strange |= {name: rest} if rest else {}
    return "; ".join(_stranger(v, name, rest, sound, strange, jig) for name, rest in strange.items())


def _stranger(
    v: ScrewViews, name: str, rest: list[int], sound: dict[str, list[int]], strange: dict[str, list[int]], jig: Jig
) -> str:
    """What is said of the frames ``rest`` of a location: whose they are, where that shows."""
    does, it = ("does", "its") if len(rest) == 1 else ("do", "their")
    text = f"{numbers_of(v, rest)} {does} not move as the other frames of location {name} {does}"
    for other, kept in sound.items():
        if other != name and kept and _fits(v, rest, kept, jig):
            return f"{text} but as those of location {other}: {it} location is misnamed"
    for other, group in strange.items():
        if other != name and _fits(v, rest, group, jig):
            return f"{text} but as {numbers_of(v, group)} of location {other}: {it} location is misnamed"
    if len(rest) > 2:
        return f"{text} but as one another: the jig was moved, or two locations bear one name"
    return f"{text}: check {it} location, joint readings and image"


def _fits(v: ScrewViews, rest: list[int], kept: list[int], jig: Jig) -> bool:
    """Whether the frames ``rest`` move as the frames ``kept`` of another location."""
    used = tuple(v.frames[i] for i in (*kept, *rest))
    pairs = np.array([(i, len(kept) + j) for i in range(len(kept)) for j in range(len(rest))], dtype=np.intp)
    across = ScrewViews(used, v.names, pairs, jig_screws(used, pairs, jig), None)
    return share(across, stack_poses([s.at for s in used])) >= AGREED


def disturbed_joints(v: ScrewViews, robot: Robot | None, given: float) -> str:
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


def _other_units(v: ScrewViews, robot: Arm) -> Iterator[tuple[float, str]]:
    """Radians for degrees, and readings of a neighbouring row."""
    q = np.asarray(v.joints)
    yield share(v, robot.pose(np.rad2deg(q))), "the joint columns hold radians, not degrees"
    yield share(v, robot.pose(np.deg2rad(q))), "the joint columns hold degrees, not radians"
    for step, words in ((1, "row before"), (-1, "row after")):
        yield share(v, robot.pose(np.roll(q, step, axis=0))), f"each frame has the joint readings of the {words}"
    yield from _other_tables(v, robot.dh_part(), q)


def _other_tables(v: ScrewViews, arm: DhRobot, q: Array) -> Iterator[tuple[float, str]]:
    """The whole table in another unit, or by the other convention."""
    other = "modified" if arm.convention == "standard" else "standard"
    for changed, words in (
        ({"d": arm.d * 1e3, "a": arm.a * 1e3}, "d_mm and a_mm of robot.toml hold metres"),
        ({"d": arm.d * 25.4, "a": arm.a * 25.4}, "d_mm and a_mm of robot.toml hold inches"),
        (
            {"theta_offset": np.rad2deg(arm.theta_offset), "alpha": np.rad2deg(arm.alpha)},
            "theta_offset_deg and alpha_deg of robot.toml hold radians",
        ),
        ({"convention": other}, f'the table of robot.toml is convention = "{other}"'),
    ):
        with suppress(InputError):  # no arm is so large
            yield share(v, replace(arm, **changed).pose(q)), words


def _other_columns(v: ScrewViews, robot: Arm) -> Iterator[tuple[float, str]]:
    """One joint of the other sign, or two columns exchanged."""
    q = np.asarray(v.joints)
    for k in range(q.shape[1]):
        turned = q.copy()
        turned[:, k] *= -1.0
        yield share(v, robot.pose(turned)), f"joint {k + 1} counts the other way round (its sign)"
    for i, j in combinations(range(q.shape[1]), 2):
        other = q.copy()
        other[:, [i, j]] = q[:, [j, i]]
        yield share(v, robot.pose(other)), f"the columns of joints {i + 1} and {j + 1} are exchanged"


def _other_rows(v: ScrewViews, robot: Arm) -> Iterator[tuple[float, str]]:
    """One number of the robot's table of another value: the best over a grid, then over a finer one."""
    q, arm = np.asarray(v.joints), robot.dh_part()
    hands, twists = arm.pose(q), arm.table_jacobian(q)
    for row, joint in product(ROWS, range(robot.n_joints)):
        grid = ANGLES_RAD if row.unit == "rad" else LENGTHS_MM
        twist = twists[row.group][..., joint]  # (F, 6): a number of the table turns or shifts about an axis that stays
        coarse = _best(v, hands, twist, grid)
        value = _best(v, hands, twist, coarse + (grid[1] - grid[0]) * FINER)
        change = f"{np.rad2deg(value):+.0f}°" if row.unit == "rad" else f"{value:+.0f} mm"
        yield (
            share(v, hands @ Pose.exp(value * twist)),
            f"{SYMBOLS[row.group]} of joint {joint + 1} in the robot's table is changed by about {change}",
        )


def _best(v: ScrewViews, hands: Pose, twist: Array, values: Array) -> float:
    """The value (V,) with which hand's and jig's motions are nearest: the mean of nearnesses in (0, 1]."""
    apart = disagreement(v, hands @ Pose.exp(values[:, None, None] * twist)).min(axis=-2)  # (V, P)
    return float(values[first_least(-np.mean(1.0 / (1.0 + apart**2), axis=-1), NEARNESS_TIE)])
