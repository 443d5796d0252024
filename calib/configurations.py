"""Which of an arm's joint solutions a controller's status columns mean."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import numpy as np
from numpy.typing import NDArray

from geometry import Arm, ArmConfiguration, Pose, all_solutions

Array = NDArray[np.float64]

_STARTS = 96  # random ones of the search for all solutions, of which a six-axis arm has eight
_AT_BORDER_RAD = float(np.deg2rad(0.3))  # a reading so near a border may be written as on either side
_QUARTER = np.pi / 2
_TURNING = (0, 3, 5)  # axes that may go round
_WRIST = 5  # link frame at which the last three axes meet, in both DH conventions


def standing(robot: Arm, T_base_hand: Pose, configuration: ArmConfiguration, rng: np.random.Generator) -> Array | None:
    """The joint readings (6,) [rad] of a hand pose in the configuration that the controller wrote.

    None where no solution or more than one agrees with it: then the columns do not decide. Readings count as in the
    robot's file, which must be the controller's own angles and signs.
    """
    if robot.n_joints != 6:
        return None
    found = [
        t
        for q in all_solutions(robot, T_base_hand, rng, _STARTS)
        if (t := _turned(robot, q, configuration)) is not None
    ]
    return found[0] if len(found) == 1 else None


def _turned(robot: Arm, q: Array, c: ArmConfiguration) -> Array | None:
    """A solution, turned by whole turns within the limits so that it agrees with the configuration, or None."""
    if not _shape_agrees(robot, q, c):
        return None
    return next((t for t in _whole_turns(robot, q) if _readings_agree(t, c)), None)


def _whole_turns(robot: Arm, q: Array) -> Iterator[Array]:
    """The solution, and those with axes 1, 4 and 6 a turn further within their limits; the nearest to zero first."""
    table = robot.dh_part()
    choices = []
    for i, (value, low, high) in enumerate(zip(q, table.min_rad, table.max_rad, strict=True)):
        most = 2 * np.pi if i in _TURNING else np.pi  # the others bend; farther round they would be another solution
        turns = [value + k * 2 * np.pi for k in (-2, -1, 0, 1, 2)]
        inside = [t for t in turns if low - _AT_BORDER_RAD <= t <= high + _AT_BORDER_RAD and abs(t) <= most + 1e-9]
        choices.append(sorted(inside or [value], key=lambda t: (round(abs(t), 6), t)))
    for readings in product(*choices):
        yield np.array(readings)


def _readings_agree(q: Array, c: ArmConfiguration) -> bool:
    """KUKA's signs (turn; of axis 5 also status) and ABB's quarter turns."""
    if c.turn is not None and not all(_sign_agrees(v, bool(c.turn >> i & 1)) for i, v in enumerate(q)):
        return False
    if c.turn is None and c.status is not None and not _sign_agrees(q[4], bool(c.status >> 2 & 1)):
        return False
    quarters = () if c.quadrants is None else zip(_TURNING, c.quadrants[:3], strict=True)
    return all(n in _quarters(q[i]) for i, n in quarters)


def _shape_agrees(robot: Arm, q: Array, c: ArmConfiguration) -> bool:
    """Before or behind axis 1 (KUKA's status, FANUC's T and B), FANUC's elbow and wrist."""
    front, up = _posture(robot, q)
    if c.status is not None and front is not None and front == bool(c.status & 1):
        return False
    if c.status is not None and None not in (front, up) and (front == up) != bool(c.status >> 1 & 1):
        return False  # the side to which axis 3 bends, which over the head is the other one
    wanted = {"T": (front, True), "B": (front, False), "U": (up, True), "D": (up, False)}
    if any(is_so is not None and is_so != right for letter, (is_so, right) in wanted.items() if letter in c.letters):
        return False
    return not any(letter in c.letters and not _sign_agrees(q[4], letter == "N") for letter in "NF")


def _posture(robot: Arm, q: Array) -> tuple[bool | None, bool | None]:
    """Whether the wrist stands before axis 1, and the elbow above the line from shoulder to wrist; None at a border."""
    links = robot.link_poses(q)
    first = 1 if robot.dh_part().convention == "standard" else 2
    base, shoulder, elbow, wrist = (links.t[i] for i in (0, first, first + 1, _WRIST))
    out = float((wrist - base) @ links.R[1][:, 0])
    line = wrist - shoulder
    aside = (elbow - shoulder) - line * float((elbow - shoulder) @ line) / max(float(line @ line), 1e-12)
    above = float(aside @ links.R[0][:, 2])
    return _beyond(out), _beyond(above)


def _beyond(value_mm: float) -> bool | None:
    return None if abs(value_mm) < 1.0 else value_mm > 0


def _sign_agrees(value: float, negative: bool) -> bool:
    return abs(value) < _AT_BORDER_RAD or (value < 0) == negative


def _quarters(value: float) -> set[int]:
    """Quarter turns of a reading, rounded down; two at a border."""
    return {int(np.floor((value + d) / _QUARTER)) for d in (-_AT_BORDER_RAD, 0.0, _AT_BORDER_RAD)}
