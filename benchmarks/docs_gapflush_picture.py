"""Draw the definition of gap and flush, as docs/gapflush.md shows it, from a measured profile.

Run: python benchmarks/docs_gapflush_picture.py [file.png]
"""

from __future__ import annotations

import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np

from extraction.gapflush import GapFlush, measure_gap_flush
from extraction.profile import Profile, StripePeaks

mpl.use("Agg")
import matplotlib.pyplot as plt

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


def draw(p: Profile, g: GapFlush, path: Path) -> None:
    """Points, fitted faces and bends, and the lengths between them; the sensor is above."""
    figure, ax = plt.subplots(figsize=(8, 3.6), dpi=100)
    ax.plot(*p.yz_mm.T, ".", color="0.6", markersize=3, label="profile")
    for edge, label in ((g.left, "left"), (g.right, "right")):
        q = edge.parameters
        tangent, centre, along = edge.tangent_point(q), edge.centre(q), edge.face_direction(q)
        face = np.array([tangent - edge.side * 8 * along, tangent])
        ax.plot(*face.T, color="tab:blue", linewidth=1.5)
        angle = np.linspace(0, 2 * np.pi, 200)
        ax.plot(
            *(centre[:, None] + q[3] * np.array([np.cos(angle), np.sin(angle)])), "--", color="tab:blue", linewidth=0.8
        )
        ax.plot(*tangent, "o", color="tab:blue", markersize=4)
        index = 0 if edge.side > 0 else 1
        ax.annotate(
            f"radius {label}\n{g.radius_mm[index]:.2f} mm",
            centre,
            ha="center",
            va="center",
            fontsize=8,
            color="tab:blue",
        )
    foot = g.flush_points[1]
    x = g.left.face_direction(g.left.parameters)
    ax.plot(*np.array([foot - 10 * x, foot + 3 * x]).T, ":", color="black", linewidth=0.8)
    down = np.array([-x[1], x[0]])
    level = max((point - foot) @ down for point in g.gap_points) + 2.5
    ends = np.array([point + (level - (point - foot) @ down) * down for point in g.gap_points])
    _length(ax, ends, f"gap {g.gap_mm:.2f} mm", (0, 0.6))
    for point, end in zip(g.gap_points, ends, strict=True):
        ax.plot(*np.array([point, end]).T, color="tab:red", linewidth=0.6)
        ax.plot(*point, "o", color="tab:red", markersize=4)
    _length(ax, g.flush_points, f"flush {g.flush_mm:+.2f} mm", (0.4, -0.02))
    ax.set(xlabel="y [mm]", ylabel="z [mm], away from the sensor", xlim=(-12, 16), ylim=(197.5, 205.5))
    ax.invert_yaxis()
    ax.set_aspect("equal")
    ax.set_title("reference: left face (dotted, extended); sensor above", fontsize=9)
    figure.tight_layout()
    figure.savefig(path, metadata={"Software": None})


def _length(ax: plt.Axes, ends: np.ndarray, text: str, offset: tuple[float, float]) -> None:
    ax.annotate("", ends[0], ends[1], arrowprops={"arrowstyle": "<->", "color": "tab:red"})
    ax.annotate(
        text, ends.mean(axis=0) + offset, color="tab:red", fontsize=9, ha="left" if offset[0] else "center", va="center"
    )


def main() -> None:
    """Measure and draw."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parents[1] / "docs/pictures/gapflush.png"
    p = profile()
    draw(p, measure_gap_flush(p), target)


if __name__ == "__main__":
    main()
