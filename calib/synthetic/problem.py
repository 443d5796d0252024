"""The bundle's problems of synthetic cells, for tests and benchmarks of the solvers."""

from __future__ import annotations

import numpy as np

from calib.bundle.problem import Problem, pad_points, pose_chain, robot_chain
from calib.observation import Observations
from calib.synthetic.cell import Cell, Layout, Noise, axis_points, made_cell, observe, pose_cell, random_cell
from geometry import AxisPoints, Pose, stack_poses
from jig_cad import Jig

EXACT = Noise(point_mm=0.0, joint_rad=0.0, robot=False, anchors=False)
CALIBRATE_ONLY = Layout(places=(("A", "calibrate", 7), ("B", "calibrate", 7), ("C", "calibrate", 7)))


def problem_of(observations: Observations, cell: Cell, role: str = "calibrate") -> Problem:
    """The bundle's problem of a cell's frames, by its nominal robot and jig."""
    frames = [f for f in observations.frames if f.role == role]
    names = list(dict.fromkeys(f.location for f in frames))
    location = np.array([names.index(f.location) for f in frames], dtype=np.intp)
    chain = robot_chain(cell.robot, np.array([f.joints_rad for f in frames]))
    points = pad_points([f.axis for f in frames if f.axis is not None], cell.jig)
    sigma = cell.jig.tolerance_mm / np.sqrt(12)
    return Problem(points, chain, location, len(names), cell.jig.anchors_mm, float(sigma))


def made_problem(seed: int, noise: Noise) -> tuple[Problem, Cell, Cell]:
    """A random cell's problem, the cell by its drawings and as made."""
    rng = np.random.default_rng(seed)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, noise)
    return problem_of(observe(cell, made, rng, noise), cell), cell, made


def exact_pose_problem(
    rng: np.random.Generator, jig: Jig, layout: Layout = CALIBRATE_ONLY
) -> tuple[Problem, Pose, Pose]:
    """Exact points of a random cell without a robot: its problem, the true T_hand_sensor and Ts_sensor_jig (F)."""
    T_hand_sensor, Ts_base_hand, Ts_base_jig = pose_cell(rng, layout, jig)
    Ts_sensor_jig = (Ts_base_hand @ T_hand_sensor).inverse() @ Ts_base_jig
    yz = axis_points(Ts_sensor_jig, jig)
    none = np.full(yz.shape[1], -1)
    covariance = np.broadcast_to(np.eye(2) * 0.03**2, (*yz.shape[1:], 2))
    frames = [AxisPoints(jig.strings, none, p, covariance, ("",) * len(none)) for p in yz]
    counts = [count for _, _, count in layout.places]
    location = np.repeat(np.arange(len(counts)), counts)
    chain = pose_chain(Ts_base_hand, np.diag([0.01**2] * 3 + [1e-5**2] * 3))
    problem = Problem(pad_points(frames, jig), chain, location, len(counts), jig.anchors_mm, 0.0)
    return problem, T_hand_sensor, Ts_sensor_jig


def true_jigs(cell: Cell, names: tuple[str, ...] = ("A", "B", "C")) -> Pose:
    """The true jig poses of a cell's calibrate locations."""
    return stack_poses([cell.T_base_jig[n] for n in names])


def true_candidates(made: Cell) -> list[Pose]:
    """Each frame's true pose T_sensor_jig as its only candidate: what a labelled frame would give, without noise."""
    jigs = stack_poses([made.T_base_jig[n] for n in made.location])
    poses = (made.robot.pose(made.joints_rad) @ made.T_hand_sensor).inverse() @ jigs
    return [poses[i : i + 1] for i in range(len(poses))]
