"""Views of balls, plates, edges and wedges that do not tell the SCP: is each refused by its name, with what to add?

    python benchmarks/calib_degenerate_surfaces.py [CELLS] [FIRST SEED] [KIND …]

Arms as built, joints that repeat to 0.003°, profiles with noise; by design and without in turn. refused: no SCP and no
σ; named: the words name the cause; advice: they say which poses to add.
"""

from __future__ import annotations

import sys
from collections import Counter

import numpy as np

from calib import CalibConfig, calibrate
from calib.synthetic.surfaces import ProfileNoise, observe_surface
from calib.synthetic.telling_nothing import SPOILT, spoilt_cell


def main() -> None:
    """Print a line a kind."""
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    first = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    kinds = sys.argv[3:] or list(SPOILT)
    totals = Counter[str]()
    for name in kinds:
        spoilt, counts, codes = SPOILT[name], Counter[str](), Counter[str]()
        for seed in range(first, first + cells):
            rng = np.random.default_rng(seed)
            cell = spoilt_cell(spoilt, rng)
            seen = observe_surface(cell, rng, ProfileNoise(), points=60, labelled=False)
            design = seen.design if seed % 2 else None
            result = calibrate(
                seen.frames, spoilt.target, cell.robot, seen.sensor, design, config=CalibConfig(model="full")
            )
            codes[result.verdict.code] += 1
            counts["refused"] += result.T_hand_sensor is None and result.covariance is None
            counts["named"] += any(w in result.verdict.text for w in spoilt.words)
            counts["advice"] += "add poses" in result.verdict.text
        totals.update(counts)
        said = ", ".join(f"{k} {counts[k]}" for k in ("refused", "named", "advice"))
        print(f"{name:42s} {said} of {cells}  {dict(codes)}", flush=True)
    print(", ".join(f"{k} {totals[k]}" for k in ("refused", "named", "advice")), f"of {cells * len(kinds)}")


if __name__ == "__main__":
    main()
