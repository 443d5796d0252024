"""Balls, planes, wedges and edges as targets: is σ true, what accuracy follows, and how long does it take?

    python benchmarks/calib_targets.py [CELLS] [KIND …] [--arms built measured exact] [--model auto] [--store FILE]

Cells are drawn with seeds 1, 2, …: an industrial arm as built (every number of its table off by its prior), joints
that repeat to 0.003°, three places of nine views each, 300 points a profile of 0.03 mm that neighbours share
(correlation 0.5). The points are where the sheet's rays meet exact geometry; nothing of the solver makes them. Printed
by target:

NEES      mean of ξᵀ P⁻¹ ξ, 6 where the covariance is true, with its own σ
95 %      share of the truths inside their 95 % ellipsoid
95 % mm   the errors of the SCP that 95 % of the cells stay below, translation [mm] and rotation [°]
RMSE/CRLB with an exact arm whose joints repeat exactly: root mean square error of whitened ξ over its bound, 1 at best

--arms: built; measured by its maker, whose table is off by a fifth of that; exact, for RMSE/CRLB.
--store: every cell's figures go there, a line a cell, and what stands there is not computed again.

KIND poses: what σ are worth where only a controller's numbers are known. An arm of 2 m as built, drawn by its priors,
stands as its nominal table says; one ball of 80 mm is seen from 15 poses as people take them: six shifts, three turns
about each axis of up to 14°. Errors and σ of the answer, and of that with all points weighted alike.
"""

from __future__ import annotations

import argparse
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from calib import CalibConfig, calibrate
from calib.printed import nees
from calib.synthetic.cell import industrial_arm
from calib.synthetic.surfaces import ProfileNoise, SurfaceCell, observe_surface, surface_cell
from geometry import DhRobot, Pose, Role, Surface, draw_errors, exp_so3, inverse_kinematics, stack_poses
from geometry.robot import RobotUncertainty
from jig_cad import Edge, Plane, Sphere, Wedge
from workbench.files import read_robot

ROBOTS = Path(__file__).parents[1] / "assets" / "robots"

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
CALIBRATE: tuple[tuple[str, Role, int], ...] = (("A", "calibrate", 9), ("B", "calibrate", 9), ("C", "calibrate", 9))


MEASURED = 0.2  # of the usual errors of a table


def arm(scale: float) -> DhRobot:
    """The industrial arm with a table whose errors are so many times the usual ones."""
    robot = industrial_arm()
    usual = robot.uncertainty
    return replace(
        robot,
        uncertainty=replace(
            usual,
            theta_sigma_rad=scale * usual.theta_sigma_rad,
            d_sigma_mm=scale * usual.d_sigma_mm,
            a_sigma_mm=scale * usual.a_sigma_mm,
            alpha_sigma_rad=scale * usual.alpha_sigma_rad,
        ),
    )


@dataclass(frozen=True)
class Error:
    """Of one cell: ξᵀ P⁻¹ ξ, the error [mm] and [°], and the verdict's code; NaN where no answer was given."""

    nees: float
    mm: float
    deg: float
    code: str


def error_of(kind: str, seed: int, noise: ProfileNoise, model: str, scale: float = 1.0) -> Error:
    """The error of one cell's SCP."""
    real, known = TARGETS[kind]
    rng = np.random.default_rng(seed)
    cell = surface_cell(real, rng, CALIBRATE, noise, arm(scale))
    seen = observe_surface(cell, rng, noise, POINTS, labelled=False)
    robot = cell.robot if noise.robot else replace(cell.robot, uncertainty=NO_ERRORS)
    result = calibrate(seen.frames, known, robot, seen.sensor, seen.design, config=CalibConfig(model=model))
    if result.T_hand_sensor is None or result.covariance is None:
        return Error(np.nan, np.nan, np.nan, result.verdict.code)
    xi = (result.T_hand_sensor.inverse() @ cell.T_hand_sensor).log()
    squared = nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance)
    length = float(np.linalg.norm(xi[:3])), float(np.rad2deg(np.linalg.norm(xi[3:])))
    return Error(squared, *length, result.verdict.code)


@dataclass
class Store:
    """Errors by target, arm, model and seed; a file of them where one is named."""

    path: Path | None
    rows: dict[str, Error]

    @staticmethod
    def opened(path: Path | None) -> Store:
        """What stands in the file, nothing where there is none."""
        lines = path.read_text().splitlines() if path is not None and path.exists() else []
        return Store(path, {key: Error(*row) for key, row in map(json.loads, lines)})

    def errors(self, kind: str, arm_is: str, model: str, seeds: Sequence[int]) -> list[Error]:
        """One of each seed, computed where it is not there yet."""
        noise = EXACT if arm_is == "exact" else AS_BUILT
        scale = MEASURED if arm_is == "measured" else 1.0
        out = []
        for seed in seeds:
            key = f"{kind} {arm_is} {model} {seed}"
            if key not in self.rows:
                found = self.rows[key] = error_of(kind, seed, noise, model, scale)
                if self.path is not None:
                    with self.path.open("a") as file:
                        file.write(json.dumps([key, [found.nees, found.mm, found.deg, found.code]]) + "\n")
            out.append(self.rows[key])
        return out


def solve_ms(kind: str, runs: int = 15) -> float:
    """Least CPU time [ms] of one solve of 27 frames of 1000 points, from condensing to covariance."""
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
    return min(spent)


def _solve(bundle: object, T: object, places: Sequence[object]) -> None:
    from calib.bundle import solve_bundle
    from calib.engine import covariance
    from geometry import stack_poses

    covariance(solve_bundle(bundle, bundle.start(T, stack_poses(places))))  # type: ignore[attr-defined, arg-type]


HAND_MM, TOOL_MM = (-195.8, 1363.3, 524.8), (-150.0, 715.0, 190.0)  # a long tool, as of a gantry's profiler
SHIFTS_MM = ((0, 0, 0), (10, 0, 0), (27, 0, 0), (0, 0, 19), (0, 36, 19), (0, -51, 19))
TURNS_DEG = tuple(np.array(axis) * s for axis in np.eye(3) for s in (-5.0, -9.0, -14.0))


def posed_cell(rng: np.random.Generator) -> SurfaceCell:
    """One ball and 15 hand poses about it, reached by an arm that is drawn from its priors."""
    robot = read_robot(ROBOTS / "fanuc_m20ia_10l.toml")
    if not isinstance(robot, DhRobot):
        raise TypeError("the preset is a table of joints")
    tool = Pose(exp_so3(np.deg2rad([0.7, 0.0, 0.4])), np.array(TOOL_MM))
    upright = Pose(np.diag([1.0, -1.0, -1.0]), np.array(HAND_MM))
    ball = (upright @ tool).t + upright.R @ tool.R @ np.array([6.0, 0.0, 290.0])
    turned = []
    for k, turn in enumerate(TURNS_DEG):  # about the ball, cut up to some 20 mm beside its middle
        R = exp_so3(np.deg2rad(turn))
        beside = upright.R @ np.array([(-1) ** k * (6.0 + 2.0 * k), 0.0, 0.0])
        turned.append(Pose(R @ upright.R, ball + R @ (upright.t - ball) + beside))
    hands = stack_poses([*(Pose(upright.R, upright.t + np.array(s)) for s in SHIFTS_MM), *turned])
    start = inverse_kinematics(robot, hands[:1], np.random.default_rng(0), max_starts=20).joints[0]
    found = inverse_kinematics(robot, hands, np.random.default_rng(0), seeds=start)
    count = len(hands)
    built = robot.corrected(draw_errors(robot, rng))
    place = {"A": Pose(np.eye(3), ball)}
    roles: tuple[Role, ...] = tuple("calibrate" for _ in range(count))
    return SurfaceCell(Sphere(80.0), robot, built, tool, place, ("A",) * count, roles, found.joints)


def poses_alone(cells: int) -> None:
    """Print NEES and errors of answers to hand poses alone."""
    noise = ProfileNoise(correlation=0.9)
    squared, off, off_alike = [], [], []
    for seed in range(1, cells + 1):
        rng = np.random.default_rng(seed)
        cell = posed_cell(rng)
        seen = observe_surface(cell, rng, noise, POINTS, labelled=False)
        nominal = cell.robot.pose(cell.joints_rad)
        frames = [replace(f, joints_rad=None, T_base_hand=nominal[f.number]) for f in seen.frames]
        result = calibrate(frames, Sphere(80.0), None, seen.sensor, None)
        if result.T_hand_sensor is None or result.covariance is None or result.equal_weights is None:
            print(f"seed {seed}: {result.verdict.code}")
            continue
        squared.append(nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance))
        off.append((result.T_hand_sensor.inverse() @ cell.T_hand_sensor).log())
        off_alike.append((result.equal_weights.T_hand_sensor.inverse() @ cell.T_hand_sensor).log())
    spread = np.std(squared) / np.sqrt(len(squared))
    print(f"hand poses alone, {len(squared)} of {cells} cells: NEES {np.mean(squared):.2f} ± {spread:.2f}")
    for name, errors_of in (("weighted by the noise found", off), ("all points alike", off_alike)):
        rms = np.sqrt(np.mean(np.square(errors_of), axis=0))
        mm, deg = np.linalg.norm(rms[:3]), np.rad2deg(np.linalg.norm(rms[3:]))
        print(f"{name}: rms error {mm:.2f} mm, {deg:.2f}°")


def table(kind: str, arm_is: str, rows: Sequence[Error]) -> str:
    """A line of the printed table."""
    given = [r for r in rows if np.isfinite(r.nees)]
    if not given:
        return f"{kind:8s} {arm_is:9s} no answer in {len(rows)} cells"
    squared = np.array([r.nees for r in given])
    mm, deg = (np.percentile([getattr(r, what) for r in given], 95) for what in ("mm", "deg"))
    share = float(np.mean(squared < chi2.isf(0.05, 6)))
    spread = squared.std() / np.sqrt(len(squared))
    out = (
        f"{kind:8s} {arm_is:9s} {len(rows):5d} {squared.mean():6.2f} ± {spread:4.2f} {share:6.1%} {mm:9.3f} {deg:8.4f}"
    )
    ratio = f"{np.sqrt(squared.mean() / 6):6.3f}" if arm_is == "exact" else " " * 6
    codes = {c: sum(r.code == c for r in rows) for c in sorted({r.code for r in rows})}
    return f"{out} {ratio} {len(rows) - len(given):8d}  {codes}"


def main() -> None:
    """Print a line a target and arm."""
    parser = argparse.ArgumentParser(description="Balls, planes, wedges and edges as targets.")
    parser.add_argument("cells", type=int, nargs="?", default=500)
    parser.add_argument("kinds", nargs="*", default=[])
    parser.add_argument("--arms", nargs="+", choices=["built", "measured", "exact"], default=["built", "exact"])
    parser.add_argument("--model", default="auto")
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--store", type=Path)
    given = parser.parse_args()
    kinds = given.kinds or list(TARGETS)
    seeds = range(given.first, given.first + given.cells)
    if "poses" in kinds:
        poses_alone(given.cells)
        kinds = [k for k in kinds if k != "poses"]
    if not kinds:
        return
    store = Store.opened(given.store)
    print(f"seeds {seeds[0]} to {seeds[-1]}, model {given.model}")
    print(
        f"{'target':8s} {'arm':9s} {'cells':>5s} {'NEES':>13s} {'95 %':>6s} {'95 % mm':>9s} {'95 % °':>8s} "
        f"{'RMSE/CRLB'} {'refused'}"
    )
    for kind in kinds:
        for arm_is in given.arms:
            model = "scp" if arm_is == "exact" else given.model
            print(table(kind, arm_is, store.errors(kind, arm_is, model, seeds)), flush=True)
        print(f"{kind:8s} solve of 27 frames of 1000 points {solve_ms(kind):.1f} ms CPU", flush=True)


if __name__ == "__main__":
    main()
