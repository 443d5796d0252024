"""Most frames lost is no answer: what those that had to be left out have in common, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from calib.config import CalibConfig
from calib.copies import COPY
from calib.judge.screws import Views, disagreement, largest_group, numbers_of, share, views_of
from calib.label import label_frame
from calib.result import Verdict
from geometry import Frame, Sensor, Target, stack_poses
from jig_cad import Jig

Targets = Target | Mapping[str, Target]

# benchmarks/calib_degenerate.py: rows shifted from any frame on are named, sound cells never
_FITS = 0.9  # share of the pairs of frames that move alike once the rows are shifted back
_GAINED = 0.2  # and more than as they stand
_SHIFTS = (1, -1, 2, -2)  # rows: a trigger too many or too few, once or twice
_EQUAL = 1e-9
_MOST_FRAMES = 120  # each is labelled anew, alone; of a longer recording only what is in common is said
_LEAST_ROWS = 3  # shifted ones: fewer are single frames' faults
_GROUPED = 0.8  # of one location's frames that fall into groups which agree within themselves
_LEAST_GROUP = 3
_CONTRADICTED = ("not_converged", "outliers")
_WORDS = {
    "image_unreadable": "images unreadable",
    "no_spots": "no string found in the image",
    "too_few_spots": "too few strings found in the image",
    "not_labelled": "no pose of the target explains the points together with the other frames",
    "robot_out_of_range": "joint readings beyond the limits of robot.toml",
    "outlier": "contradicted by the others",
    "no_profile": "no profile",
    "no_target": "the target was not found in the profile",
}


def frames_contradict(
    frames: Sequence[Frame], target: Targets, sensor: Sensor, verdict: Verdict, config: CalibConfig
) -> Verdict | None:
    """The verdict frames_contradict where more than ``max_lost_share`` of the frames had to be left out, else None.

    frames: as answered. The share is of those that calibrate, or of all. Copies count with their twin. A set that had
    too few frames from the start keeps its verdict. Data that contradict one another without any frame being left out
    get it where the rows are shifted or one name stands for several places.
    """
    every = tuple(f for f in frames if f.reason != COPY)
    asked = [f for f in every if f.role == "calibrate"]
    if len(asked) - len({f.location for f in asked}) < 2:
        return _only_copies(frames, verdict)
    counted = next((g for g in (asked, every) if _lost(g) > config.max_lost_share * len(g)), None)
    if counted is None and verdict.code not in _CONTRADICTED:
        return None
    cause = _cause(every, target, sensor, config)
    if counted is None:
        return Verdict("frames_contradict", f"{cause}. In all, {verdict.text}") if cause else None
    cause = cause or "; ".join(_in_common(counted))
    what = "calibrate frames" if counted is asked else "frames"
    return Verdict(
        "frames_contradict",
        f"{_lost(counted)} of {len(counted)} {what} had to be left out (limit {config.max_lost_share:.0%}), "
        f"so that what is left is no answer: {cause}. In all, {verdict.text}",
    )


def _only_copies(frames: Sequence[Frame], verdict: Verdict) -> Verdict | None:
    """Too few poses where they were enough by number: the robot did not move between them."""
    copies = sum(f.reason == COPY for f in frames if f.role == "calibrate")
    if verdict.code != "too_few_poses" or not copies:
        return None
    words = (
        f"{copies} calibrate frames repeat others to the last digit: move the robot between the frames of a location"
    )
    return Verdict("poses_not_distinct", f"{words}. In all, {verdict.text}")


def _lost(frames: Sequence[Frame]) -> int:
    return sum(f.reason is not None for f in frames)


def _in_common(asked: Sequence[Frame]) -> Iterator[str]:
    """What the lost frames share: their reason, their place, their part of the sequence."""
    lost = [f for f in asked if f.reason is not None]
    counts = Counter(str(f.reason) for f in lost)
    yield ", ".join(f"{n} {k} ({_WORDS.get(k, 'left out')})" for k, n in counts.most_common())
    where = {f.location for f in lost}
    whole = [n for n in where if all(f.reason is not None for f in asked if f.location == n)]
    if len(where) == 1 and len({f.location for f in asked}) > 1:
        yield f"all lie in one location, {next(iter(where))}"
    elif whole and len(whole) < len({f.location for f in asked}):
        yield f"no frame is left of location {', '.join(sorted(whole))}"
    numbers = [f.number for f in asked]
    first, last = lost[0].number, lost[-1].number
    run = [n for n in numbers if first <= n <= last]
    if len(run) == len(lost) < len(numbers):
        yield f"all from frame {first} on" if last == numbers[-1] else f"all from frame {first} to frame {last}"


def _cause(frames: tuple[Frame, ...], target: Targets, sensor: Sensor, config: CalibConfig) -> str:
    """Rows that are shifted, or locations that bear one name; "" where the frames' own poses show neither.

    The poses are found anew, each frame alone: the chain that refused a frame is what is in doubt.
    """
    if not isinstance(target, Jig) or len(frames) > _MOST_FRAMES:
        return ""
    posed = tuple(g for f in frames if (g := _alone(f, target, sensor, config)) is not None)
    if len(posed) < 2 * _LEAST_GROUP:
        return ""
    v = views_of(posed, target)
    if len(v.pairs) < _LEAST_GROUP:
        return ""
    return _shifted(v, frames) or _one_name(v)


def _alone(f: Frame, jig: Jig, sensor: Sensor, config: CalibConfig) -> Frame | None:
    """The frame with the poses that its own points give, None where they give none."""
    if len(f.candidates):
        return f
    if f.labels_given or not len(f.points):
        return None
    found = label_frame(f.points, jig, sensor, None, config)
    return None if found.T_sensor_jig is None else replace(f, candidates=stack_poses([found.T_sensor_jig]))


def _shifted(v: Views, frames: tuple[Frame, ...]) -> str:
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


def _one_name(v: Views) -> str:
    """Whether frames under one location's name fall into groups that each move as one: several places, one name."""
    contrary = disagreement(v, stack_poses([f.at for f in v.frames])).min(axis=0) >= 1.0
    for name in dict.fromkeys(v.names):
        left = [i for i, n in enumerate(v.names) if n == name]
        total, groups = len(left), []
        while len(left) >= _LEAST_GROUP:
            group = largest_group(v, contrary, left)
            if len(group) < _LEAST_GROUP:
                break
            groups.append(group)
            left = [i for i in left if i not in group]
        if len(groups) > 1 and sum(map(len, groups)) >= _GROUPED * total:
            parts = "; ".join(numbers_of(v, g) for g in groups)
            only = len(set(v.names)) == 1
            says = (
                f"all lie in one location: the column says {name} throughout" if only else f"location {name} is several"
            )
            return f"{says}, but the target stood still only within each of these: {parts}; name each place"
    return ""
