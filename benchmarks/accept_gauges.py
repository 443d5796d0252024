"""Gauges of known components: how often the intervals of `accept gauge` hold the truth, of 200 for each kind of study.

Run: python benchmarks/accept_gauges.py [count]
"""

from __future__ import annotations

import sys

import numpy as np
from scipy.stats import binom

from workbench.accept import GaugeTable, study_gauge

EV, AV, PV = 0.5, 0.7, 2.0
STUDIES = (((10, 3, 3), 0.0), ((10, 3, 3), 0.6), ((8, 4, 2), 0.6), ((12, 1, 4), 0.0))  # parts, operators, trials; INT
NAMES = ("EV", "AV", "INT", "GRR", "PV", "TV", "percent_GRR")
DRAWS = 10_000
LIKELY = 1e-3  # of both sides together


def covered(shape: tuple[int, int, int], interaction: float, count: int) -> dict[str, int]:
    """In how many of the gauges each interval holds the truth."""
    p, o, r = shape
    truth = {"EV": EV, "AV": AV if o > 1 else 0.0, "INT": interaction, "PV": PV}
    gauge = np.sqrt(truth["EV"] ** 2 + truth["AV"] ** 2 + truth["INT"] ** 2)
    truth |= {"GRR": gauge, "TV": np.hypot(gauge, PV)}
    truth["percent_GRR"] = 100 * gauge / truth["TV"]
    rng = np.random.default_rng([77, *shape, round(10 * interaction)])
    out = dict.fromkeys(NAMES, 0)
    for _ in range(count):
        values = (
            50
            + PV * rng.standard_normal((p, 1, 1))
            + truth["AV"] * rng.standard_normal((1, o, 1))
            + interaction * rng.standard_normal((p, o, 1))
            + EV * rng.standard_normal((p, o, r))
        )
        operators = tuple("ABCD"[:o]) if o > 1 else ()
        table = GaugeTable(tuple(map(str, range(p))), operators, values, np.full(p, np.nan))
        for figure in study_gauge(table, draws=DRAWS).figures:
            if figure.name in out and figure.bounds is not None:
                out[figure.name] += int(figure.bounds.low <= truth[figure.name] <= figure.bounds.high)
    return out


def main() -> None:
    """Print a row per study."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    low, high = (int(binom.ppf(q, count, 0.95)) for q in (LIKELY / 2, 1 - LIKELY / 2))
    print(f"of {count}; {low} to {high} are likely where 95 % are right")
    print("study          INT   " + "  ".join(f"{n:>11s}" for n in NAMES))
    for shape, interaction in STUDIES:
        found = covered(shape, interaction, count)
        print(f"{' × '.join(map(str, shape)):13s} {interaction:4.1f}   " + "  ".join(f"{found[n]:11d}" for n in NAMES))


if __name__ == "__main__":
    main()
