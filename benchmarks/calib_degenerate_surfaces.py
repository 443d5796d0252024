"""Views of surfaces that do not tell the SCP: is each refused by its name, with what to add, and does a plan cure it?

    python benchmarks/calib_degenerate_surfaces.py [CELLS] [FIRST SEED] [KIND …] [--cured N]

Arms as built, joints that repeat to 0.003°, profiles with noise; with and without a drawing in turn. The first cell of
a kind has 9 frames at each of its places, the others 5 to 14 at one to three of them (of planes as many as the kind
names), every third by the controller's hand poses in place of joint readings. refused: no SCP and no σ; named: the
words name the cause; advice: they say which poses to add. cured: of N cells a kind, those from which a trustworthy
answer follows, its squared error below 1 in 10,000 of its own covariance, once the 6 configurations that `plan`
proposes beside them have been measured, too; it knows the drawing and the places where the target stands.
"""

from __future__ import annotations

import argparse
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from calib import CalibConfig, CalibrationResult, calibrate
from calib.hands import placed
from calib.printed import nees
from calib.synthetic.surfaces import ProfileNoise, SurfaceCell, observe_surface
from calib.synthetic.telling_nothing import SPOILT, Spoilt, spoilt_cell
from geometry import Pose
from workbench.files import Cell
from workbench.plan import next_views

ADDED = 6
GATE = float(chi2.isf(1e-4, 6))
POINTS = 60


def varied(spoilt: Spoilt, seed: int, ordinary: bool) -> SurfaceCell:
    """A cell of the kind, its numbers of frames and places drawn where it is not the ordinary one."""
    if ordinary:
        return spoilt_cell(spoilt, np.random.default_rng(seed))
    draw = np.random.default_rng([seed, 2])
    places = int(draw.integers(1, 4))
    return spoilt_cell(spoilt, np.random.default_rng(seed), int(draw.integers(5, 15)), places)


def answer(cell: SurfaceCell, seed: int, design: bool, by_hand: bool = False) -> CalibrationResult:
    """What is said of the cell's views, seen with noise; by_hand: the frames give the controller's hand poses alone."""
    seen = observe_surface(cell, np.random.default_rng([seed, 1]), ProfileNoise(), POINTS, labelled=False)
    start = seen.design if design else None
    frames = seen.frames
    if by_hand:
        hands = cell.robot.pose(np.array([f.joints_rad for f in frames]))
        frames = tuple(replace(f, joints_rad=None, T_base_hand=hands[i]) for i, f in enumerate(frames))
    return calibrate(frames, cell.target, cell.robot, seen.sensor, start, config=CalibConfig())


def with_plan(cell: SurfaceCell, seed: int) -> SurfaceCell:
    """The cell with the views proposed beside its own."""
    seen = observe_surface(cell, np.random.default_rng([seed, 1]), ProfileNoise(), POINTS, labelled=False)
    planned = Cell(Path(), seen.sensor, cell.target, cell.robot, seen.frames, seen.design)
    places: dict[str, Pose] = dict(cell.T_base_target)
    plan = next_views(planned, seen.design, places, placed(seen.frames, cell.robot), ADDED)
    rows = [v.frame for v in plan.views]
    return replace(
        cell,
        location=(*cell.location, *(r.location for r in rows)),
        role=(*cell.role, *(r.role for r in rows)),
        joints_rad=np.concatenate([cell.joints_rad, [r.joints_rad for r in rows if r.joints_rad is not None]]),
    )


def cures(cell: SurfaceCell, seed: int) -> tuple[bool, str]:
    """Whether the planned views make an answer of it that holds its σ, and what is said."""
    result = answer(with_plan(cell, seed), seed, design=True)
    T, covariance = result.T_hand_sensor, result.covariance
    if T is None or covariance is None or not result.verdict.trustworthy:
        return False, result.verdict.text
    error = nees(cell.T_hand_sensor, T, covariance)
    return error < GATE, f"{result.verdict.code}, squared error {error:.1f}"


def main() -> None:
    """Print a line a kind."""
    parser = argparse.ArgumentParser(description="Views of surfaces that do not tell the SCP.")
    parser.add_argument("cells", type=int, nargs="?", default=50)
    parser.add_argument("first", type=int, nargs="?", default=1)
    parser.add_argument("kinds", nargs="*")
    parser.add_argument("--cured", type=int, default=0, metavar="N")
    given = parser.parse_args()
    totals, kinds = Counter[str](), given.kinds or list(SPOILT)
    for name in kinds:
        spoilt, counts, codes = SPOILT[name], Counter[str](), Counter[str]()
        for seed in range(given.first, given.first + given.cells):
            cell = varied(spoilt, seed, ordinary=seed == given.first)
            result = answer(cell, seed, design=seed % 2 == 1, by_hand=seed % 3 == 0)
            codes[result.verdict.code] += 1
            said = {
                "refused": result.T_hand_sensor is None and result.covariance is None,
                "named": any(w in result.verdict.text for w in spoilt.words),
                "advice": "add poses" in result.verdict.text,
            }
            counts.update(k for k, true in said.items() if true)
            if not all(said.values()):
                text = f"{result.verdict.code}: {result.verdict.text[:160]}"
                print(f"  seed {seed}, {len(cell.location)} frames: {text}", flush=True)
            if seed < given.first + given.cured:
                good, words = cures(cell, seed)
                counts["cured"] += good
                if not good:
                    print(f"  seed {seed}, with the plan's views: {words[:160]}", flush=True)
        totals.update(counts)
        line = ", ".join(f"{k} {counts[k]}" for k in ("refused", "named", "advice"))
        cured = f", cured {counts['cured']} of {given.cured}" if given.cured else ""
        print(f"{name:38s} {line} of {given.cells}{cured}  {dict(codes)}", flush=True)
    line = ", ".join(f"{k} {totals[k]}" for k in ("refused", "named", "advice"))
    print(f"{line} of {given.cells * len(kinds)}; cured {totals['cured']} of {given.cured * len(kinds)}")


if __name__ == "__main__":
    main()
