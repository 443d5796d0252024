"""Labels among clutter on synthetic frames with truth: found, mislabelled, false, and the time a frame takes.

Run: python benchmarks/calib_labelling.py [frames]. Spots are synthetic (no images): random sensors, jigs of five and
six strings and lines at random, tilts 2-35°, any roll, up to 20 clutter spots, some in rows like pieces of a stripe.
Lines at random need a grid of planes of their own for each jig, some 0.05 s, which is in their time.
"""

from __future__ import annotations

import sys
import time
from collections import Counter

import numpy as np

from calib.config import CalibConfig
from calib.label.frame import label_frame
from calib.synthetic.views import LabelledTruth, SpotNoise, disturbed, observe_spots, random_view
from geometry import AxisPoints
from jig_cad import Jig

# what hides and clutters, whether a guess of the pose is given, how many lines at random stand in place of a pillar
CASES = {
    "all strings, no guess": (SpotNoise(clutter=20), False, 0),
    "all strings, heavy clutter, no guess": (SpotNoise(clutter=34), False, 0),
    "all strings, guess 4 mm and 1.5°": (SpotNoise(clutter=20), True, 0),
    "one hidden, guess": (SpotNoise(clutter=20, hidden=1), True, 0),
    "two hidden, guess": (SpotNoise(clutter=20, hidden=2), True, 0),
    "one hidden, no guess": (SpotNoise(clutter=8, hidden=1), False, 0),
    "one cut short, no guess": (SpotNoise(clutter=8, cut=1), False, 0),
    "one cut short, guess": (SpotNoise(clutter=8, cut=1), True, 0),
    "five lines, no guess": (SpotNoise(clutter=20), False, 5),
    "five lines, two hidden, guess": (SpotNoise(clutter=20, hidden=2), True, 5),
    "six lines, one hidden, no guess": (SpotNoise(clutter=8, hidden=1), False, 6),
}


def main(frames: int) -> None:
    """One line a case."""
    for name, (noise, guess, lines) in CASES.items():
        run(name, noise, guess, lines, frames)


def run(name: str, most: SpotNoise, guess: bool, lines: int, frames: int) -> None:
    """Label ``frames`` frames with up to the given clutter and count."""
    rng = np.random.default_rng(12)
    tally: Counter[str] = Counter()
    clock = 0.0
    for _ in range(frames):
        view = random_view(rng, lines=lines)
        noise = SpotNoise(most.sigma_yz_mm, int(rng.integers(0, most.clutter + 1)), most.hidden, most.cut)
        truth = observe_spots(view, noise, rng)
        start = disturbed(view.T_sensor_jig, view.jig, 4.0, 1.5, rng) if guess else None
        begin = time.process_time()
        frame = label_frame(truth.points, view.jig, view.sensor, start, CalibConfig())
        clock += time.process_time() - begin
        tally += min(
            (
                judge(frame.axis, truth, view.jig, turned)
                for turned in ((False, True) if view.jig.symmetries and not guess else (False,))
            ),
            key=_bad,
        )
        tally["visible"] += sum(label != "" for label in truth.label)
        tally["unlabelled frames"] += frame.reason is not None
        tally["flagged"] += sum(f != "" for f in frame.axis.flag)
    share = {k: 100 * tally[k] / max(tally["visible"], 1) for k in ("right", "wrong", "false")}
    print(
        f"{name}: {frames} frames, right {share['right']:.2f} %, mislabelled {share['wrong']:.3f} %, false "
        f"{share['false']:.3f} %, flagged {tally['flagged']}, no answer in {tally['unlabelled frames']} frames, "
        f"{1e3 * clock / frames:.1f} CPU-ms a frame"
    )


def judge(axis: AxisPoints, truth: LabelledTruth, jig: Jig, turned: bool) -> Counter[str]:
    """Labels that are right, wrong (another string's) or false (clutter's)."""
    out: Counter[str] = Counter()
    for label, spot in zip(axis.label, axis.spot, strict=True):
        true = truth.label[spot]
        true = jig.symmetries[0].relabelled(true) if turned and true else true
        out["right" if true == label else "wrong" if true else "false"] += 1
    return out


def _bad(tally: Counter[str]) -> int:
    return tally["wrong"] + tally["false"]


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1000)
