"""Stripes by default settings on drawn pictures of every kind: sections right, points false, ends, direction.

"right" is the least over the seeds of the share of true sections with a point within the kind's tolerance; "both" the
share of sections with both of two stripes; "false" points without a flag that are further off, or in a section without
a stripe; "ends" the share of pieces' ends at the exact section, and the largest distance of the others.
Run: python benchmarks/extraction_stripe_kinds.py [seeds]
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

from extraction import detect_stripe
from extraction.stripe.pictures import KINDS, StripePicture, draw


def score(picture: StripePicture) -> dict[str, Any]:
    """The measures of one picture."""
    image = picture.image if picture.image.ndim == 2 else picture.image.max(axis=2)
    peaks = detect_stripe(np.ascontiguousarray(image))
    across, along = (1, 0) if picture.turned else (0, 1)
    section, place = np.round(peaks.uv_px[:, across]).astype(int), peaks.uv_px[:, along]
    off = np.abs(place - picture.truth[section])
    other = np.abs(off - picture.other_px) if picture.other_px else np.full(len(off), np.inf)
    upper, lower = off <= picture.tolerance_px, other <= picture.tolerance_px
    true = np.flatnonzero(np.isfinite(picture.truth))
    right = np.intersect1d(section[upper | lower], true)
    ends = []
    for piece in np.split(true, np.flatnonzero(np.diff(true) > 1) + 1) if len(true) else []:
        own = section[(upper | lower) & (section >= piece[0] - 5) & (section <= piece[-1] + 5)]
        ends += [own.min() - piece[0], own.max() - piece[-1]] if len(own) else [99, 99]
    return {
        "right": 100 * len(right) / len(true) if len(true) else np.nan,
        "both": 100 * len(np.intersect1d(section[upper], section[lower])) / max(len(true), 1),
        "points": len(peaks),
        "false": int(np.sum(~(upper | lower) & (peaks.flag == 0))),
        "flagged": int(np.sum(peaks.flag > 0)),
        "ends": ends,
    }


def main() -> None:
    """Print a line a kind, and the false points of all together."""
    seeds = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    points = false = 0
    worst = 0.0
    for kind in KINDS:
        found = [score(draw(kind, np.random.default_rng(seed))) for seed in range(seeds)]
        points += sum(f["points"] for f in found)
        false += sum(f["false"] for f in found)
        worst = max([worst, *(100 * f["false"] / max(f["points"], 1) for f in found)])
        ends = np.abs([end for f in found for end in f["ends"]])
        text = f"{kind:26s} right {min(f['right'] for f in found):6.2f} %"
        text += f"  both {np.mean([f['both'] for f in found]):5.1f} %" if "pair" in kind else " " * 15
        text += f"  false {sum(f['false'] for f in found):4d}  flagged {np.mean([f['flagged'] for f in found]):5.0f}"
        print(text + (f"  ends {100 * np.mean(ends == 0):5.1f} %, {ends.max()} at most" if len(ends) else ""))
    print(
        f"false without a flag: {100 * false / max(points, 1):.3f} % of {points} points, {worst:.2f} % in one picture"
    )


if __name__ == "__main__":
    main()
