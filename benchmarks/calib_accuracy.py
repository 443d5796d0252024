"""RMSE of the SCP against the Cramér-Rao bound, beside other methods on the same data in the same run.

Run: python benchmarks/calib_accuracy.py [TRIALS] [SEED]. 3 locations x 7 poses, exact robot and jig, points of 10, 30
and 50 µm, each with joint noise of 0 and 0.003°. Peers: the paper's chain, OpenCV's five hand-eye methods (from a
least-squares jig pose per frame), and scipy's plain bundle (numeric Jacobian, points alone).
"""

from __future__ import annotations

import sys
import time
from dataclasses import dataclass, replace

import cv2
import numpy as np
from scipy.optimize import least_squares

from calib import CalibConfig
from calib.bundle.problem import Bundle
from calib.bundle.solution import solve_problem
from calib.bundle.solve import solve_bundle
from calib.engine import covariance
from calib.paper.scp import PaperProblem, solve_paper
from calib.pose.closed_form import closed_forms
from calib.pose.fit import jig_pose
from calib.synthetic.cell import Layout, Noise, SyntheticCell, made_cell, observe, random_cell
from calib.synthetic.problem import problem_of, true_candidates
from geometry import Pose, RobotUncertainty, stack_poses
from jig_cad import Jig

NEAR = Layout(
    places=(("A", "calibrate", 7), ("B", "calibrate", 7), ("C", "calibrate", 7)),
    standoff_mm=(140.0, 180.0),
    tilt_deg=(12.0, 35.0),
    swing_deg=35.0,
)
OPENCV = {
    "Tsai": cv2.CALIB_HAND_EYE_TSAI,
    "Park": cv2.CALIB_HAND_EYE_PARK,
    "Horaud": cv2.CALIB_HAND_EYE_HORAUD,
    "Andreff": cv2.CALIB_HAND_EYE_ANDREFF,
    "Daniilidis": cv2.CALIB_HAND_EYE_DANIILIDIS,
}


@dataclass(frozen=True)
class Setting:
    """One line of the table."""

    point_mm: float
    joint_deg: float


def cell_for(rng: np.random.Generator, setting: Setting) -> SyntheticCell:
    """A cell with an exact robot and jig, whose stated noise is the true one."""
    cell = random_cell(rng, NEAR, Jig.nominal(height_mm=120.0, tolerance_mm=0.0))
    exact = RobotUncertainty(float(np.deg2rad(setting.joint_deg)), 0.0, 0.0, 0.0, 0.0)
    return replace(cell, robot=replace(cell.robot, uncertainty=exact))


def paper(problem: Bundle, cell: SyntheticCell, own: Pose) -> Pose | None:
    """The paper's chain: closed forms (the sign candidate nearest the least-squares pose), then Eqs. (1)-(4)."""
    forms = closed_forms(problem.term.points.yz_mm, cell.jig.side_mm, cell.jig.height_mm)
    use = np.flatnonzero(forms.defined)
    distance = np.linalg.norm(forms.T_sensor_jig.t[use] - own.t[use, None], axis=-1)
    origins = forms.T_sensor_jig.t[use, np.argmin(distance, axis=1)]
    if len(use) < 5:
        return None
    return solve_paper(PaperProblem(origins, problem.hands[use], problem.location[use]), cell.design).T_hand_sensor


def opencv(problem: Bundle, own: Pose, method: int) -> Pose:
    """OpenCV's hand-eye: one target, so the frames of each location are solved apart and averaged."""
    found = []
    nominal = problem.hands.pose(np.zeros(len(problem.hands.sigma)))
    for k in range(len(problem.locations)):
        i = np.flatnonzero(problem.location == k)
        hand, jig = nominal[i], own[i]
        R, t = cv2.calibrateHandEye(list(hand.R), list(hand.t), list(jig.R), list(jig.t), method=method)
        found.append(Pose(R, t[:, 0]))
    mean = found[0]
    for _ in range(5):
        mean = mean @ Pose.exp(np.mean([(mean.inverse() @ p).log() for p in found], axis=0))
    return mean


def scipy_bundle(problem: Bundle, start: Pose, jigs: Pose) -> Pose:
    """Least squares over SCP and jig poses with a numeric Jacobian and the points' weights alone."""
    state = problem.start(start, jigs)
    weight = np.repeat(1 / np.sqrt(problem.term.points.cov_mm2[..., 0, 0]), 2, axis=-1)

    def of(x: np.ndarray) -> np.ndarray:
        twists = x.reshape(-1, 6)
        moved = state.with_value("scp", start @ Pose.exp(twists[0])).with_value("target", jigs @ Pose.exp(twists[1:]))
        return (problem.term.residual(moved) * weight).ravel()

    x = least_squares(of, np.zeros(6 * (1 + len(problem.locations))), method="lm", x_scale="jac").x
    return start @ Pose.exp(x[:6])


def trial(rng: np.random.Generator, cell: SyntheticCell, setting: Setting, out: dict[str, list[np.ndarray]]) -> None:
    """One noisy data set, solved by all."""
    noise = Noise(setting.point_mm, float(np.deg2rad(setting.joint_deg)), robot=False, anchors=False)
    observed = observe(cell, made_cell(cell, rng, noise), rng, noise)
    problem, candidates = problem_of(observed, cell), true_candidates(cell)
    own = stack_poses([
        jig_pose(f.axis, cell.jig, guess=candidates[i][0]).T_sensor_jig for i, f in enumerate(observed.frames)
    ])  # fmt: skip
    jigs = stack_poses([cell.T_base_jig[n] for n in ("A", "B", "C")])
    methods = {
        "bundle (ours)": lambda: solve_problem(problem, candidates, cell.design, CalibConfig()).T_hand_sensor,
        "paper's chain": lambda: paper(problem, cell, own),
        "scipy bundle": lambda: scipy_bundle(problem, cell.design, jigs),
    } | {f"OpenCV {name}": lambda m=m: opencv(problem, own, m) for name, m in OPENCV.items()}
    for name, method in methods.items():
        started = time.perf_counter()
        pose = method()
        spent = time.perf_counter() - started
        error = np.full(6, np.nan) if pose is None else (pose.inverse() @ cell.T_hand_sensor).log()
        out.setdefault(name, []).append(np.concatenate([error, [spent]]))


def bound(cell: SyntheticCell, setting: Setting) -> np.ndarray:
    """Cramér-Rao covariance (6, 6) at the truth, joint noise marginalised."""
    noise = Noise(0.0, 0.0, robot=False, anchors=False)
    exact = problem_of(observe(cell, cell, np.random.default_rng(0), noise), cell)
    points = exact.term.points
    cov = np.broadcast_to(np.eye(2) * setting.point_mm**2, points.cov_mm2.shape)
    exact = replace(exact, terms=(replace(exact.term, points=replace(points, cov_mm2=cov)),))
    jigs = stack_poses([cell.T_base_jig[n] for n in ("A", "B", "C")])
    return covariance(solve_bundle(exact, exact.start(cell.T_hand_sensor, jigs))).of("scp")


def main() -> None:
    """Print RMSE and its ratio to the bound, per setting and method."""
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 500
    rng = np.random.default_rng(int(sys.argv[2]) if len(sys.argv) > 2 else 1)
    for setting in (Setting(mm, deg) for deg in (0.0, 0.003) for mm in (0.01, 0.03, 0.05)):
        cell, out = cell_for(rng, setting), {}
        crlb = bound(cell, setting)
        for _ in range(trials):
            trial(rng, cell, setting, out)
        limit_mm, limit_rad = np.sqrt(np.trace(crlb[:3, :3])), np.sqrt(np.trace(crlb[3:, 3:]))
        print(
            f"\npoints {setting.point_mm * 1e3:.0f} µm, joints {setting.joint_deg}°, {trials} trials: "
            f"bound {limit_mm:.4f} mm, {np.rad2deg(limit_rad):.4f}°",
            flush=True,
        )
        for name, trials_of_method in out.items():
            rows = np.array(trials_of_method)
            mm = np.sqrt(np.nanmean(np.sum(rows[:, :3] ** 2, axis=1)))
            rad = np.sqrt(np.nanmean(np.sum(rows[:, 3:6] ** 2, axis=1)))
            print(
                f"  {name:18s} {mm:8.4f} mm ({mm / limit_mm:6.2f} x)  {np.rad2deg(rad):8.4f}° "
                f"({rad / limit_rad:6.2f} x)"
                f"  {1e3 * np.median(rows[:, 6]):7.1f} ms  failed {np.mean(np.isnan(rows[:, 0])):.1%}"
            )


if __name__ == "__main__":
    main()
