"""Most frames lost is no answer: what those that had to be left out have in common, in words."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence

from calib.config import CalibConfig
from calib.copies import COPY
from calib.result import Verdict
from geometry import Frame, Target
from jig_cad import Jig

Targets = Target | Mapping[str, Target]

_CONTRADICTED = ("not_converged", "outliers")
_UNSEEN = ("image_unreadable", "no_profile", "no_target")  # more poses would not help
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
    frames: Sequence[Frame], target: Targets, verdict: Verdict, config: CalibConfig, cause: Callable[[bool], str]
) -> Verdict | None:
    """The verdict frames_contradict where more than ``max_lost_share`` of the frames had to be left out, else None.

    frames: as answered. cause: finds what they contradict one another for, "" where nothing shows; without lost frames
    (False) only what is wrong with their rows and places. The share is of those that calibrate, or of all. Copies count
    with their twin. A set that had too few frames from the start keeps its verdict. Data that contradict one another
    without any frame being left out get it where the rows are shifted or one name stands for several places.
    """
    every = tuple(f for f in frames if f.reason != COPY)
    asked = [f for f in every if f.role == "calibrate"]
    if len(asked) - len({f.location for f in asked}) < 2:
        return _only_copies(frames, verdict)
    counted = next((g for g in (asked, every) if _lost(g) > config.max_lost_share * len(g)), None)
    if counted is None and verdict.code not in _CONTRADICTED:
        return None
    found = cause(counted is not None) if isinstance(target, Jig) else ""
    if counted is None:
        return Verdict("frames_contradict", f"{found}. In all, {verdict.text}") if found else None
    found = found or "; ".join(_in_common(counted))
    what = "calibrate frames" if counted is asked else "frames"
    unseen = all(f.reason in _UNSEEN for f in counted if f.reason is not None) and verdict.code == "too_few_poses"
    rest = "Each left-out frame's own sentence says what is in its place" if unseen else f"In all, {verdict.text}"
    return Verdict(
        "frames_contradict",
        f"{_lost(counted)} of {len(counted)} {what} had to be left out (limit {config.max_lost_share:.0%}), "
        f"so that what is left is no answer: {found}. {rest}",
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
