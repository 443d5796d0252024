"""Does the choice of the model pay? Cells whose robot has errors of the stated size, a tenth of it, or none.

Run: python benchmarks/calib_model_choice.py [CELLS] [SEED]. Every cell is calibrated with model full; printed are how
often full was kept, the rms distance of the points from their strings at a verify location by what was kept and by
either model always, and the mean NEES (6 is right) and verdicts of what was kept. The last line has one location only.
"""

from __future__ import annotations

import sys
from collections import Counter
from dataclasses import replace

import numpy as np

from calib import CalibConfig, CalibrationResult
from calib.printed import nees
from calib.synthetic.cell import Layout, Noise, SyntheticCell, calibrated, made_cell, observe, random_cell
from geometry import draw_errors

ONE = Layout(places=(("A", "calibrate", 7),))


def run(cells: int, seed: int, share: float, layout: Layout) -> None:
    """One line: robots whose errors are ``share`` of those stated."""
    rng = np.random.default_rng(seed)
    rms, error, kept, codes = [], [], 0, Counter[str]()
    for _ in range(cells):
        cell, made = _drawn(rng, share, layout)
        observed = observe(cell, made, rng, Noise())
        chosen = calibrated(observed, cell.jig, cell.robot, CalibConfig(model="full"))
        plain = calibrated(observed, cell.jig, cell.robot, CalibConfig(model="scp"))
        kept, codes[chosen.verdict.code] = kept + (chosen.model == "full"), codes[chosen.verdict.code] + 1
        if chosen.T_hand_sensor is not None and chosen.covariance is not None:
            error.append(nees(made.T_hand_sensor, chosen.T_hand_sensor, chosen.covariance))
        if "D" in chosen.locations:
            rms.append([_rms(chosen), _rms(plain)])
    at_d = np.sqrt(np.mean(np.square(rms), axis=0)) if rms else np.full(2, np.nan)
    print(
        f"errors x {share:g}, {len(layout.places)} locations: full kept in {kept} of {cells}, at D {at_d[0]:.4f} mm "
        f"by what was kept, {at_d[1]:.4f} by scp; NEES {np.mean(error):.2f} ± {np.sqrt(12 / len(error)):.2f}, "
        f"{dict(codes)}",
        flush=True,
    )


def _drawn(rng: np.random.Generator, share: float, layout: Layout) -> tuple[SyntheticCell, SyntheticCell]:
    cell = random_cell(rng, layout)
    made = made_cell(cell, rng, Noise(robot=False))
    return cell, replace(made, robot=cell.robot.corrected(share * draw_errors(cell.robot, rng)))


def _rms(result: CalibrationResult) -> float:
    return result.locations["D"].point_rms_mm.solved or float("nan")


def main() -> None:
    """Print one line a size of the robot's errors."""
    cells = int(sys.argv[1]) if len(sys.argv) > 1 else 100
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    for share in (1.0, 0.1, 0.0):
        run(cells, seed, share, Layout())
    run(cells, seed, 1.0, ONE)


if __name__ == "__main__":
    main()
