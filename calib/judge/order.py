"""Rows of readings in another order than the images: which reading goes with which image, found by motions alone.

Images of one place and the readings that they were taken at move alike pair by pair (`screws`), and hardly any others
do: a chance pair agrees in some 0.4 % of cases, so that three images fix their readings and four leave no doubt.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from calib.judge.screws import ADVANCE_MM, ANGLE_RAD, LEAST_TURN_RAD, ScrewViews, disagreement, screw, share
from geometry import Frame, Pose, stack_poses
from jig_cad import Jig

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

# benchmarks/calib_degenerate.py: shuffled, reversed and text-sorted rows are named, sound and otherwise spoilt never
MOST_FRAMES = 60  # a table of all pairs of pairs: 13 MB
FITS, GAINED = 0.9, 0.2  # share of the pairs of frames that move alike in the order found, and more than as they stand
FEWEST = 4  # members of a place that must find their partners
SKIPPED = 0.25  # of a place's members that may find none: their own pose is wrong
FIRST = 6  # members that are placed by search, the others by these
SHOWN = 6  # frames whose partner is told


def reordered(v: ScrewViews, frames: tuple[Frame, ...], jig: Jig) -> str:
    """Which frames' readings stand in which other frames' rows; "" where no other order makes motions agree.

    frames: all rows of the file, in its order. Names of places go with the readings or with the images: both are tried.
    """
    if len(frames) > MOST_FRAMES:
        return ""
    index = {f.number: i for i, f in enumerate(frames)}
    mine = np.array([index[f.number] for f in v.frames], dtype=np.intp)
    hands = stack_poses([f.at for f in frames])
    given = share(v, hands[mine])
    if _worst_place(v, hands[mine]) >= FITS - GAINED:  # rows of one place alone may be exchanged
        return ""
    alike = _alike(v, hands, jig)  # (V, V, F, F): images i and k with rows j and l
    rows_of_images = _partners(list(v.names), lambda i, k, j, n: bool(alike[i, k, j, n]), len(frames))
    images_of_rows = _partners([f.location for f in frames], lambda j, n, i, k: bool(alike[i, k, j, n]), len(v.frames))
    by_rows = {i: j for j, i in images_of_rows.items()}
    found = max((rows_of_images, by_rows), key=len)
    if len(found) < max(FEWEST, (1 - SKIPPED) * len(v.frames)) or all(mine[i] == j for i, j in found.items()):
        return ""
    known = sorted(found)
    pairs = [(a, b) for k, a in enumerate(known) for b in known[k + 1 :]]
    places = v.names if found is rows_of_images else {i: frames[found[i]].location for i in known}
    same = [alike[a, b, found[a], found[b]] for a, b in pairs if places[a] == places[b]]
    if not same or np.mean(same) < FITS:
        return ""
    return (
        f"{_words({int(mine[i]): j for i, j in found.items()}, frames)} (hand and jig move alike in "
        f"{np.mean(same):.0%} of the pairs of frames instead of {given:.0%} if each image has its own row)"
    )


def _worst_place(v: ScrewViews, hands: Pose) -> float:
    """Share of the pairs that agree at the place where fewest do."""
    agree = disagreement(v, hands).min(axis=0) < 1.0
    names = np.array(v.names)[v.pairs[:, 0]]
    return min(float(np.mean(agree[names == name])) for name in dict.fromkeys(names.tolist()))


def _alike(v: ScrewViews, hands: Pose, jig: Jig) -> Mask:
    """Which pairs of images (V, V) and rows (F, F) move alike, whichever way labels are turned; or hardly at all."""
    jigs = stack_poses([f.candidates[0] for f in v.frames])
    turns = (Pose.identity(), *(s.pose for s in jig.symmetries))
    moved = _between(hands.inverse())
    out = np.zeros((len(jigs), len(jigs), *moved.shape[:2]), dtype=bool)
    for i, seen in enumerate(zip(*(_between(jigs, turn) for turn in turns), strict=True)):
        for of_jig in seen:
            apart = (of_jig[:, None, None] - moved) / [ANGLE_RAD, ADVANCE_MM]
            out[i] |= np.sum(apart**2, -1) < 1.0
        out[i] |= (seen[0][:, None, None, 0] < LEAST_TURN_RAD) & (moved[..., 0] < 2 * LEAST_TURN_RAD)
    return out


def _between(poses: Pose, turn: Pose | None = None) -> Array:
    """Screws (N, N, 2) of the motions T_k · turn · T_i⁻¹ between all poses (N), by i and k."""
    n = len(poses)
    first, second = np.repeat(np.arange(n), n), np.tile(np.arange(n), n)
    turned = poses if turn is None else poses @ turn
    return screw(turned[second] @ poses[first].inverse()).reshape(n, n, 2)


def _partners(names: Sequence[str], agree: Callable[[int, int, int, int], bool], n: int) -> dict[int, int]:
    """For the members of every place the partner (of ``n``) such that the members' motions are the partners'."""
    out: dict[int, int] = {}
    for name in dict.fromkeys(names):
        group = [i for i, other in enumerate(names) if other == name]
        free = [j for j in range(n) if j not in set(out.values())]
        most = int(SKIPPED * len(group[:FIRST]))
        best = _search(group[:FIRST], {}, free, agree, most)
        for i in group[FIRST:]:
            fits = (
                [j for j in free if j not in best.values() and all(agree(i, k, j, best[k]) for k in best)]
                if best
                else []
            )
            best |= {i: fits[0]} if len(fits) == 1 else {}
        out |= best if len(best) >= min(FEWEST, len(group)) else {}
    return out


def _search(
    left: list[int], done: dict[int, int], free: list[int], agree: Callable[[int, int, int, int], bool], skips: int
) -> dict[int, int]:
    """The largest set of members whose partners agree among themselves, at most ``skips`` of them without one."""
    if not left:
        return done
    first, rest = left[0], left[1:]
    best: dict[int, int] = {}
    for j in free:
        if j in done.values() or not all(agree(first, k, j, done[k]) for k in done):
            continue
        found = _search(rest, done | {first: j}, free, agree, skips)
        best = found if len(found) > len(best) else best
        if len(best) == len(done) + len(left):
            return best
    if skips:
        found = _search(rest, done, free, agree, skips - 1)
        best = found if len(found) > len(best) else best
    return best


def _words(found: dict[int, int], frames: tuple[Frame, ...]) -> str:
    """What order the rows are in: by name where it is a usual one. found: rows of readings by rows of images."""
    n = len(frames)
    usual = {
        "the other way round, last first": list(range(n))[::-1],
        "sorted as text (0, 1, 10, 11 … 2, 20 …)": sorted(range(n), key=str),
        "sorted as text from 1 on (1, 10, 11 … 2, 20 …)": sorted(range(n), key=lambda i: str(i + 1)),
    }
    for words, order in usual.items():
        by_name = dict(enumerate(order))
        if all(by_name[i] == j for i, j in found.items()) or all(by_name[j] == i for i, j in found.items()):
            return (
                f"frames.csv joins images and joint readings (or poses) in different orders: one of them stands {words}"
            )
    wrong = [(i, j) for i, j in sorted(found.items()) if i != j]
    told = ", ".join(f"{frames[i].number} with {frames[j].number}" for i, j in wrong[:SHOWN])
    more = f" and so on, {len(wrong)} in all" if len(wrong) > SHOWN else ""
    return (
        "images and joint readings (or poses) of frames.csv are not each other's rows: the image of frame "
        f"{told.replace(' with ', ' goes with the readings of frame ', 1)}{more}"
    )
