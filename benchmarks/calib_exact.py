"""Exact points to the SCP: largest errors over random cells, by the paper's iteration and by the bundle.

Run: python benchmarks/calib_exact.py [CELLS] [SEED]. 3 locations x 7 poses, from the design SCP, 2° and 1 mm away; the
jig poses start from the paper's closed form with all its sign candidates. A wrong branch is an error above 1e-3 mm.
"""

from __future__ import annotations

import sys

import numpy as np

from calib.synthetic.exact_recovery import recover
from jig_cad import Jig

WRONG_MM = 1e-3


def main() -> None:
    """Print one line a method."""
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    rng = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 2)
    every = [recover(rng, Jig.nominal()) for _ in range(cells)]
    sound = [r for r in every if r.sound]
    settled = sum(r.converged for r in sound)
    print(f"{cells} random cells, {len(sound)} of scaled condition < 1e3, both converged in {settled}")
    for name, errors in (("paper", [r.paper for r in sound]), ("bundle", [r.bundle for r in sound])):
        xi = np.array(errors)
        mm, rad = np.linalg.norm(xi[:, :3], axis=1), np.linalg.norm(xi[:, 3:], axis=1)
        wrong = int(np.sum(mm > WRONG_MM))
        print(f"  {name:8s} wrong branch {wrong}, largest error {mm.max():.2g} mm, {rad.max():.2g} rad")


if __name__ == "__main__":
    main()
