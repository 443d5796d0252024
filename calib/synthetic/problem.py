"""The bundle's problems of synthetic cells, for tests and benchmarks of the solvers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib.bundle import Bundle, Hands
from calib.synthetic.cell import (
    CellFrames,
    Layout,
    Noise,
    SyntheticCell,
    axis_points,
    made_cell,
    observe,
    pose_cell,
    random_cell,
)
from geometry import AxisPoints, Pose, stack_poses
from jig_cad import Jig

EXACT = Noise(point_mm=0.0, joint_rad=0.0, robot=False, anchors=False)
CALIBRATE_ONLY = Layout(places=(("A", "calibrate", 7), ("B", "calibrate", 7), ("C", "calibrate", 7)))


def problem_of(observed: CellFrames, cell: SyntheticCell, role: str = "calibrate") -> Bundle:
    """The bundle's problem of a cell's frames, by its nominal robot and jig."""
    frames = [f for f in observed.frames if f.role == role]
    hands = Hands(cell.robot, np.array([f.joints_rad for f in frames]))
    return Bundle.of([f.axis for f in frames], [f.location for f in frames], cell.jig, hands)


def made_problem(seed: int, noise: Noise) -> tuple[Bundle, SyntheticCell, SyntheticCell]:
    """A random cell's problem, the cell by its drawings and as made."""
    rng = np.random.default_rng(seed)
    cell = random_cell(rng, CALIBRATE_ONLY)
    made = made_cell(cell, rng, noise)
    return problem_of(observe(cell, made, rng, noise), cell), cell, made


def exact_pose_problem(
    rng: np.random.Generator, jig: Jig, layout: Layout = CALIBRATE_ONLY
) -> tuple[Bundle, Pose, Pose]:
    """Exact points of a random cell without a robot: its problem, the true T_hand_sensor and Ts_sensor_jig (F)."""
    T_hand_sensor, Ts_base_hand, Ts_base_jig = pose_cell(rng, layout, jig)
    Ts_sensor_jig = (Ts_base_hand @ T_hand_sensor).inverse() @ Ts_base_jig
    yz = axis_points(Ts_sensor_jig, jig)
    none = np.full(yz.shape[1], -1)
    covariance = np.broadcast_to(np.eye(2) * 0.03**2, (*yz.shape[1:], 2))
    axes = [AxisPoints(jig.strings, none, p, covariance, ("",) * len(none)) for p in yz]
    locations = [name for name, _, count in layout.places for _ in range(count)]
    hands = Hands.at_poses(Ts_base_hand, np.diag([0.01**2] * 3 + [1e-5**2] * 3))
    exact = replace(jig, measured=True)  # its anchors are where they are drawn
    return Bundle.of(axes, locations, exact, hands), T_hand_sensor, Ts_sensor_jig


def true_jigs(cell: SyntheticCell, names: tuple[str, ...] = ("A", "B", "C")) -> Pose:
    """The true jig poses of a cell's calibrate locations."""
    return stack_poses([cell.T_base_jig[n] for n in names])


def true_candidates(made: SyntheticCell) -> list[Pose]:
    """Each frame's true pose T_sensor_jig as its only candidate: what a labelled frame would give, without noise."""
    jigs = stack_poses([made.T_base_jig[n] for n in made.location])
    poses = (made.robot.pose(made.joints_rad) @ made.T_hand_sensor).inverse() @ jigs
    return [poses[i : i + 1] for i in range(len(poses))]
