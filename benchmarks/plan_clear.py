"""How many proposed configurations go through the floor or touch something, judged by points of this file's own.

Run: python benchmarks/plan_clear.py [--seeds N] [--no-floor] [PRESET ...]. Each preset's starter cell, 4 places × 7
views. Looked at: the links' axes from the elbow on, and a grid in the housing, against the floor at z = 0 and against
the jig's meshes as trimesh holds them. --no-floor: what is proposed where no floor is known, for comparison.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import trimesh

from geometry import Workspace
from geometry.sensor import housing_box
from jig_cad.solids import jig_solids
from workbench.cell import write_starter
from workbench.files import read_cell
from workbench.plan import plan_limits, propose

PRESETS = ("ur5e", "kuka_kr6_r700", "fanuc_m20ia_10l", "hyundai_hh7", "abb_irb6640_180_255")


def main() -> None:
    """Print a line a preset and seed."""
    parser = argparse.ArgumentParser()
    parser.add_argument("presets", nargs="*", default=PRESETS)
    parser.add_argument("--seeds", type=int, default=1)
    parser.add_argument("--no-floor", action="store_true")
    given = parser.parse_args()
    for name in given.presets:
        folder = Path(tempfile.mkdtemp()) / "cell"
        write_starter(folder, name, "nominal", "paper")
        cell = read_cell(folder, recorded=False)
        if given.no_floor:
            cell = replace(cell, workspace=Workspace(None))
        for seed in range(given.seeds):
            started = time.process_time()
            plan = propose(cell, 7, "D", "scp", plan_limits(), seed, lambda *_: None)
            spent = time.process_time() - started
            q = np.deg2rad(plan.joints_deg)
            hand, links = cell.arm.pose(q), cell.arm.link_poses(q).t
            grid = np.stack(np.meshgrid(*np.linspace(*housing_box(cell.sensor), 7).T, indexing="ij"), -1).reshape(-1, 3)
            housing = hand @ cell.design @ grid[None]
            low = np.minimum(links[:, 2:, 2].min(axis=1), housing[..., 2].min(axis=1))
            nearest = []
            for row, points in zip(plan.rows, housing, strict=True):
                there = cell.T_base_jig[row.location].inverse() @ points
                nearest.append(
                    min(trimesh.proximity.closest_point(m, there)[1].min() for m in jig_solids(cell.jig).values())
                )
            print(
                f"{name} seed {seed}: {len(q)} configurations, {int(np.sum(low < 0))} through the floor (lowest point "
                f"{low.min():.0f} mm), housing at least {min(nearest):.0f} mm off the jig; "
                f"{sum(m.room_mm < 0 for m in plan.moves)} of {len(plan.moves)} straight moves without room; "
                f"{plan.ratio_to_random:.2f} of random plans; {spent:.1f} CPU-s",
                flush=True,
            )


if __name__ == "__main__":
    main()
