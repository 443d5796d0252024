"""How long a solve takes in memory: SCP, jig poses, joint noise; 21 and 1,000 frames; with covariance.

Run: python benchmarks/calib_speed.py. The median of several solves on one thread, from the design SCP.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np
from calib_accuracy import OPENCV, opencv, scipy_bundle

from calib.bundle.problem import Bundle
from calib.bundle.solve import solve_bundle
from calib.engine import covariance, scaled_condition
from calib.synthetic.cell import Noise
from calib.synthetic.problem import made_problem, true_candidates, true_jigs
from geometry import stack_poses


def repeated(bundle: Bundle, times: int) -> Bundle:
    """The same frames again and again: as many rows as a long recording has."""
    index = np.tile(np.arange(len(bundle.hands)), times)
    terms = (bundle.term.at_frames(index, bundle.location[index]),)
    return replace(bundle, terms=terms, hands=bundle.hands[index], location=bundle.location[index])


def median_ms(solve: Callable[[], object], runs: int) -> float:
    """Median CPU time of ``runs`` calls [ms], after one that warms up."""
    solve()
    spent = []
    for _ in range(runs):
        started = time.process_time()
        solve()
        spent.append(time.process_time() - started)
    return 1e3 * float(np.median(spent))


def main() -> None:
    """Print the medians, and the peers' over ours."""
    problem, cell, made = made_problem(1, Noise())
    jigs = true_jigs(made)
    scp, full = np.zeros(24, dtype=bool), np.ones(24, dtype=bool)

    def ours(p: Bundle, estimated: np.ndarray) -> Callable[[], object]:
        start = p.start(cell.design, jigs)

        def solve() -> object:
            result = solve_bundle(p.estimating(estimated), start)
            return covariance(result), scaled_condition(result, "scp")

        return solve

    own = stack_poses([c[0] for c in true_candidates(made)])
    ms = median_ms(ours(problem, scp), 21)
    print(f"21 frames, scp:     {ms:7.1f} ms (reach 10)")
    print(f"21 frames, full:    {median_ms(ours(problem, full), 21):7.1f} ms")
    numeric = median_ms(lambda: scipy_bundle(problem, cell.design, jigs), 5)
    print(f"scipy, numeric Jacobian, no covariance: {numeric:7.1f} ms, {numeric / ms:.1f} x ours")
    for name, method in OPENCV.items():
        peer = median_ms(lambda m=method: opencv(problem, own, m), 21)
        print(f"OpenCV {name + ', no covariance:':32s} {peer:7.1f} ms, {peer / ms:.2f} x ours")
    long = repeated(problem, 48)
    print(f"{len(long.hands)} frames, scp:   {median_ms(ours(long, scp), 5):7.1f} ms (reach 300)")


if __name__ == "__main__":
    main()
