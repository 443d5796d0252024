"""The picture of a plan in docs/planning.md: sensor positions around the jig, random views beside planned ones.

Run: python benchmarks/docs_plan_picture.py OUT.png
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt
import numpy as np

from geometry import Pose
from workbench.cell import write_starter
from workbench.files import read_cell
from workbench.plan import best_plan, candidates, plan_limits

ARROW_MM = 60.0


def main() -> None:
    """Draw the views of the starter cell's places A, B and C in the jig's own frame."""
    folder = Path(tempfile.mkdtemp()) / "cell"
    write_starter(folder, "abb_irb6640_180_255", "nominal", "paper")
    cell, rng = read_cell(folder, recorded=False), np.random.default_rng(11)
    found = candidates(cell, 7, "scp", plan_limits(), rng, lambda *_: None)
    plan = best_plan(found, 7, "D", rng)
    pools = [found.views[i].T_sensor_jig[np.arange(7)] for i in found.calibrating]
    drawn = Pose(np.concatenate([p.R for p in pools]), np.concatenate([p.t for p in pools]))
    figure, axes = plt.subplots(1, 2, figsize=(11, 5), subplot_kw={"projection": "3d"}, layout="constrained")
    for ax, title, poses in zip(
        axes, ("21 random feasible views", "21 planned views"), (drawn, plan.views.T_sensor_jig), strict=True
    ):
        sensors = poses.inverse()
        for start, end in zip(cell.jig.starts, cell.jig.ends, strict=True):
            ax.plot(*np.stack([start, end]).T[[2, 1, 0]], color="0.3", linewidth=1)
        x, y, z = sensors.t.T
        for axis, colour, name in ((2, "C3", "depth axis z"), (1, "C0", "lateral axis y")):
            u, v, w = sensors.R[:, :, axis].T
            ax.quiver(z, y, x, w, v, u, length=ARROW_MM, color=colour, linewidth=1, label=name)
        ax.set(xlabel="z_jig / mm", ylabel="y_jig / mm", zlabel="x_jig (up) / mm", title=title)
        ax.set_box_aspect((1, 1, 1))
        ax.view_init(20, -60)
    axes[0].legend(loc="upper left")
    figure.savefig(sys.argv[1], dpi=110)


if __name__ == "__main__":
    main()
