"""Balls, planes, wedges and edges as targets: is σ true, what accuracy follows, and how long does it take?

    python benchmarks/calib_targets.py [CELLS] [KIND …]

Cells are drawn with seeds 1, 2, …: an industrial arm as built (every number of its table off by its prior), joints
that repeat to 0.003°, three places of nine views each, 300 points a profile of 0.03 mm that neighbours share
(correlation 0.5), model full. The points are where the sheet's rays meet exact geometry; nothing of the solver makes
them. Printed by target:

NEES      mean of ξᵀ P⁻¹ ξ, 6 where the covariance is true, with its own σ
95 %      the errors of the SCP that 95 % of the cells stay below, translation [mm] and rotation [°]
RMSE/CRLB with an exact arm whose joints repeat exactly: root mean square error of whitened ξ over its bound, 1 at best
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np

from calib import CalibConfig, calibrate
from calib.printed import nees
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from geometry import Surface
from geometry.robot import RobotUncertainty
from jig_cad import Edge, Plane, Sphere, Wedge

TARGETS: dict[str, tuple[Surface, Surface]] = {  # as it is, as it is known
    "sphere": (Sphere(40.0), Sphere(40.0)),
    "sphere?": (Sphere(40.0), Sphere(diameter_sigma_mm=np.inf)),
    "plane": (Plane(), Plane()),
    "wedge": (Wedge(90.0), Wedge(90.0)),
    "wedge?": (Wedge(80.0), Wedge(angle_known=False)),
    "edge": (Edge(), Edge()),
}
AS_BUILT = ProfileNoise(correlation=0.5)
EXACT = ProfileNoise(joint_rad=1e-9, robot=False)
NO_ERRORS = RobotUncertainty(1e-9, 0.0, 0.0, 0.0, 0.0)
POINTS = 300
CALIBRATE = (("A", "calibrate", 9), ("B", "calibrate", 9), ("C", "calibrate", 9))


def errors(kind: str, seed: int, noise: ProfileNoise, model: str) -> tuple[float, float, float, str]:
    """NEES, error [mm] and [°], and the verdict's code of one cell; NaN where no answer was given."""
    real, known = TARGETS[kind]
    rng = np.random.default_rng(seed)
    cell = surface_cell(real, rng, CALIBRATE, noise)
    seen = observe_surface(cell, rng, noise, POINTS, labelled=False)
    robot = cell.robot if noise.robot else replace(cell.robot, uncertainty=NO_ERRORS)
    result = calibrate(seen.frames, known, robot, seen.sensor, seen.design, config=CalibConfig(model=model))
    if result.T_hand_sensor is None or result.covariance is None:
        return np.nan, np.nan, np.nan, result.verdict.code
    xi = (result.T_hand_sensor.inverse() @ cell.T_hand_sensor).log()
    squared = nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance)
    length = float(np.linalg.norm(xi[:3])), float(np.rad2deg(np.linalg.norm(xi[3:])))
    return squared, *length, result.verdict.code


def solve_ms(kind: str, runs: int = 7) -> float:
    """Median CPU time [ms] of one solve of 27 frames of 1000 points, from condensing to covariance."""
    from calib.bundle import make_bundle
    from calib.hands import placed
    from calib.surface import begin_on_surfaces, condensed

    real, known = TARGETS[kind]
    rng = np.random.default_rng(1)
    cell = surface_cell(real, rng, CALIBRATE, AS_BUILT)
    seen = observe_surface(cell, rng, AS_BUILT, 1000, labelled=False)
    config = CalibConfig(model="full")
    begun = begin_on_surfaces(placed(seen.frames, cell.robot), known, cell.robot, seen.design, config)
    spent = []
    for _ in range(runs):
        started = time.process_time()
        used = condensed(begun.frames, begun.target).frames
        bundle = make_bundle(used, begun.target, cell.robot, config)
        bundle = bundle.estimating(np.ones(len(bundle.estimated), dtype=bool))
        assert begun.T_hand_sensor is not None
        places = [begun.places[n] for n in bundle.locations]
        _solve(bundle, begun.T_hand_sensor, places)
        spent.append(1e3 * (time.process_time() - started))
    return float(np.median(spent))


def _solve(bundle: object, T: object, places: list[object]) -> None:
    from calib.bundle import solve_bundle
    from calib.engine import covariance
    from geometry import stack_poses

    covariance(solve_bundle(bundle, bundle.start(T, stack_poses(places))))  # type: ignore[attr-defined, arg-type]


def main() -> None:
    """Print a line a target."""
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    kinds = sys.argv[2:] or list(TARGETS)
    print(f"{cells} cells, seeds 1 to {cells}")
    print(f"{'target':10s} {'NEES':>12s} {'95 % mm':>8s} {'95 % °':>8s} {'RMSE/CRLB':>10s} {'refused':>8s} {'ms':>6s}")
    for kind in kinds:
        rows = [errors(kind, seed, AS_BUILT, "full") for seed in range(1, cells + 1)]
        table = np.array([r[:3] for r in rows])
        good = table[np.isfinite(table[:, 0])]
        exact = np.array([errors(kind, seed, EXACT, "scp")[0] for seed in range(1, max(cells // 2, 1) + 1)])
        ratio = float(np.sqrt(np.nanmean(exact) / 6))
        mean, spread = good[:, 0].mean(), good[:, 0].std() / np.sqrt(len(good))
        mm, deg = np.percentile(good[:, 1:], 95, axis=0)
        print(
            f"{kind:10s} {mean:5.2f} ± {spread:4.2f} {mm:8.2f} {deg:8.3f} {ratio:10.3f} {cells - len(good):8d} "
            f"{solve_ms(kind):6.1f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
