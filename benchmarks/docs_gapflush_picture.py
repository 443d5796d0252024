"""Draw the definition of gap and flush, as docs/gapflush.md shows it, from a measured profile.

Run: python benchmarks/docs_gapflush_picture.py [file.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from extraction.gapflush import measure_gap_flush
from extraction.profile import Profile, StripePeaks
from workbench.results.gapflush_picture import draw_gap_flush

GAP_MM, FLUSH_MM, RADII_MM, NOISE_MM = 4.0, 1.2, (1.5, 2.5), 0.02


def profile() -> Profile:
    """Two panels over a floor, as seen from above, with noise."""
    y = np.arange(-14, 18, 0.1)
    z = np.full(len(y), np.nan)
    for s, radius, top in ((y, RADII_MM[0], 0.0), (GAP_MM - y, RADII_MM[1], -FLUSH_MM)):
        z[s <= -radius] = top
        bend = (s > -radius) & (s <= -radius * (1 - np.sin(np.deg2rad(72))))
        z[bend] = top + radius - np.sqrt(radius**2 - (s[bend] + radius) ** 2)
    seen = np.isfinite(z)
    n = int(seen.sum())
    z = z[seen] + 200 + np.random.default_rng(1).normal(0, NOISE_MM, n)
    cov = np.zeros((n, 2, 2))
    cov[:, 1, 1] = NOISE_MM**2
    zero = np.zeros(n)
    peaks = StripePeaks(
        np.arange(n, dtype=np.int32), np.zeros((n, 2)), np.zeros((n, 2)), *(zero,) * 5, flag=np.zeros(n, np.uint8)
    )
    return Profile(peaks, np.column_stack([y[seen], z]), cov)


def main() -> None:
    """Measure and draw."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "docs/pictures/gapflush.png"
    p = profile()
    draw_gap_flush(p, measure_gap_flush(p), target)


if __name__ == "__main__":
    main()
