"""The jig's pose from one frame: exact recovery, ambiguity said to be so, what the sixth string buys.

Run: calib_jig_pose.py [cells]. Prints the figures of docs/jig_pose.md: a few minutes for 10,000 cells.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from numpy.typing import NDArray

from calib.pose.candidates import JigPoseResult
from calib.pose.closed_form import closed_forms
from calib.pose.crossing import crossings
from calib.pose.fit import jig_pose
from calib.pose.solver import PoseProblem, solve_poses
from calib.pose.starts import pencil_starts
from calib.pose.weakness import scaled_condition
from calib.synthetic.views import random_pose
from geometry import AxisPoints, Pose, nearest_rotation, stack_poses
from jig_cad import DEFAULT_STRINGS, STRINGS, Jig

Array = NDArray[np.float64]

SIGMA_MM = 0.02
DISTANCE_MM = 300.0
TILTS_DEG = ((0.0, 1.0), (1.0, 3.0), (3.0, 6.0), (6.0, 12.0), (12.0, 24.0), (24.0, 35.0))


def main(cells: int) -> None:
    """Print all tables."""
    print(f"exact points, {cells} random cells (sides 60-120 mm, heights 0.7-1.3 sides, tilts 2-35°, any roll)")
    for strings in (DEFAULT_STRINGS, tuple(STRINGS)):
        exact_recovery(cells, strings)
    print("\nambiguous or degenerate frames of five strings, noise 0.02 mm: how many are said to be so")
    for name, frames in (("mirror", mirror_poses), ("perpendicular", perpendicular_poses)):
        ambiguous(name, frames, 1000)
    print("\nfive and six strings, noise 0.02 mm: condition, rms σ at the anchors, ambiguity")
    for tilt in TILTS_DEG:
        compare(tilt, 200)


def exact_recovery(cells: int, strings: tuple[str, ...]) -> None:
    """Least squares without a guess, and the paper's closed form, against the truth."""
    rng = np.random.default_rng(1)
    jigs, poses = [], []
    for _ in range(cells):
        side = rng.uniform(60, 120)
        jigs.append(Jig.nominal(side, rng.uniform(0.7, 1.3) * side, strings=strings))
        poses.append(random_pose(rng, jigs[-1], rng.uniform(120, 400)))
    T = stack_poses(poses)
    starts, directions = np.stack([j.starts for j in jigs]), np.stack([j.directions for j in jigs])
    yz = crossings(T, starts, directions)[0]
    clock = time.perf_counter()
    begin = pencil_starts(starts, directions, yz)
    many = PoseProblem(starts[:, None], directions[:, None], yz[:, None], np.eye(2 * len(strings)) / SIGMA_MM)
    solution = solve_poses(many, begin)
    clock = (time.perf_counter() - clock) / cells
    rows, best = np.arange(cells), np.argmin(solution.cost, axis=1)
    sound = np.array([scaled_condition(j) < 1e3 for j in solution.jacobian[rows, best]])
    report(f"  {len(strings)} strings, least squares", T, solution.T_sensor_jig[rows, best], sound)
    print(f"    {clock * 1e6:.0f} µs a pose in a batch")
    if strings == DEFAULT_STRINGS:
        forms = closed_forms(yz, np.array([j.side_mm for j in jigs]), np.array([j.height_mm for j in jigs]))
        chosen = forms.T_sensor_jig[rows, np.argmin(forms.h1_disagreement_mm, axis=1)]
        report("  closed form of the paper", T, chosen, sound & forms.defined)


def report(name: str, truth: Pose, found: Pose, sound: NDArray[np.bool_]) -> None:
    """One line: largest errors among the sound cells, and how many took a wrong branch."""
    xi = (truth[np.flatnonzero(sound)].inverse() @ found[np.flatnonzero(sound)]).log()
    shift, turn = np.linalg.norm(xi[:, :3], axis=1), np.linalg.norm(xi[:, 3:], axis=1)
    wrong = int(np.sum(shift > 1e-3))
    print(f"{name}: {sound.sum()} sound cells, {wrong} wrong branches, ≤ {shift.max():.1e} mm, ≤ {turn.max():.1e} rad")


def mirror_poses(rng: np.random.Generator, jig: Jig) -> Pose:
    """A view in which B' and C' stand at equal height, its mirror possible too."""
    while True:
        f, h1 = rng.uniform(0.25, 0.75), rng.uniform(0.1, 0.9) * jig.height_mm
        level = jig.height_mm * (1 - f)
        if abs(h1 - level) < 0.05 * jig.height_mm:
            continue
        depth, half = np.sqrt(3) / 2 * jig.side_mm, jig.side_mm / 2
        b1, c1 = np.array([level, -half * f, depth * f]), np.array([level, half * (1 - f), depth * (1 - f)])
        pose = _facing(np.cross(b1 - [h1, 0, 0], c1 - [h1, 0, 0]), (b1 + c1) / 2, rng)
        mirrored = _facing(np.cross(b1 - [2 * level - h1, 0, 0], c1 - [2 * level - h1, 0, 0]), (b1 + c1) / 2, rng)
        if all(
            np.all((s := crossings(p, jig.starts, jig.directions)[1] / jig.lengths) > 0.02) and np.all(s < 0.98)
            for p in (pose, mirrored)
        ):
            return pose


def perpendicular_poses(rng: np.random.Generator, jig: Jig) -> Pose:
    """A view within 1° of perpendicular to the pillar."""
    return random_pose(rng, jig, DISTANCE_MM, (0.0, 1.0))


def _facing(normal: Array, aim: Array, rng: np.random.Generator) -> Pose:
    """T_sensor_jig of a sheet through ``aim`` with the normal, seen from the front of the pillar."""
    x = normal / np.linalg.norm(normal)
    x = x * (1.0 if x[0] > 0 else -1.0)
    z = np.array([0.0, rng.normal(0, 0.3), 1.0])
    z = z - (z @ x) * x
    z = z / np.linalg.norm(z)
    R = nearest_rotation(np.column_stack([x, np.cross(z, x), z]))
    return Pose(R, aim - DISTANCE_MM * z).inverse()


def frame(T: Pose, jig: Jig, rng: np.random.Generator) -> AxisPoints:
    """Noisy axis points of all strings."""
    yz = crossings(T, jig.starts, jig.directions)[0] + rng.normal(0, SIGMA_MM, (len(jig.strings), 2))
    n = len(jig.strings)
    return AxisPoints(jig.strings, np.full(n, -1), yz, np.tile(np.eye(2) * SIGMA_MM**2, (n, 1, 1)), ("",) * n)


def ambiguous(name: str, poses, count: int) -> None:  # type: ignore[no-untyped-def]
    """How many frames of a kind are called mirror or weak, and how many have the truth among the candidates."""
    rng = np.random.default_rng(2)
    jig = Jig.nominal(tolerance_mm=0.0)
    told = listed = 0
    for _ in range(count):
        T = poses(rng, jig)
        result = jig_pose(frame(T, jig, rng), jig)
        told += result.ambiguity != "unique"
        listed += min(_anchors_apart(T, c.T_sensor_jig, jig) for c in result.candidates) < 10.0
    print(f"  {name}: {told} of {count} said to be so, the truth among the candidates (to 10 mm) in {listed}")


def compare(tilt_deg: tuple[float, float], count: int) -> None:
    """One row a number of strings."""
    for strings in (DEFAULT_STRINGS, tuple(STRINGS)):
        rng = np.random.default_rng(3)
        jig = Jig.nominal(strings=strings, tolerance_mm=0.0)
        results: list[JigPoseResult] = []
        errors = []
        for _ in range(count):
            T = random_pose(rng, jig, DISTANCE_MM, tilt_deg)
            results.append(jig_pose(frame(T, jig, rng), jig))
            errors.append(_anchors_apart(T, results[-1].T_sensor_jig, jig))
        kinds = [r.ambiguity for r in results]
        share = ", ".join(f"{k} {100 * kinds.count(k) / count:.0f} %" for k in ("unique", "mirror", "weak"))
        condition = np.median([r.condition for r in results])
        print(
            f"  tilt {tilt_deg[0]:g}-{tilt_deg[1]:g}°, {len(strings)} strings: condition {condition:.0f}, error at the "
            f"anchors median {np.median(errors):.2f}, 95 % {np.quantile(errors, 0.95):.2f} mm; {share}"
        )


def _anchors_apart(a: Pose, b: Pose, jig: Jig) -> float:
    return float(np.sqrt(np.mean(np.sum((a @ jig.anchors_mm - b @ jig.anchors_mm) ** 2, -1))))


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 10_000)
