"""A kind of target that no room knows: one class and its mesh, and it is emulated, calibrated, planned and told of.

It does not prove that a profile's points on it are found among others: that is a finder of extraction's, by kind.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import trimesh

from calib import CalibConfig, calibrate
from calib.surface import degenerate
from geometry import AxisPoints, Frame, InputError, Pose, Surface, draw_errors, exp_so3, inverse_kinematics
from jig_cad.bodies import target_meshes
from workbench.cell import find_robot, find_sensor
from workbench.emulate.sheet_profile import profile_sensor, profiler, sheet_profile
from workbench.files import Cell
from workbench.plan import next_views, size_mm
from workbench.plan.clearance import target_boxes
from workbench.report.scene import _lines

RADIUS_MM, LENGTH_MM = 25.0, 300.0
ATOL_MM = 0.005  # a mesh of 512 sections, and points interpolated between rays of its profile
NEES_LIMIT = 30.0  # a sound covariance exceeds it in 4 of 100,000 runs
UPRIGHT = np.array([[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]])


@dataclass(frozen=True, eq=False)
class Cylinder(Surface):
    """A cylinder about its x axis."""

    kind = "cylinder"
    features: tuple[str, ...] = ("cylinder",)
    freedom: tuple[bool, ...] = (False, True, True, False, True, True)

    def offset(self, points_mm, feature):
        """Distance from the surface, and its gradient."""
        across = points_mm * [0.0, 1.0, 1.0]
        length = np.linalg.norm(across, axis=1, keepdims=True)
        return length - RADIUS_MM, (across / np.maximum(length, 1e-9))[:, None, :]


@target_meshes.register(Cylinder)
def _pipe(_: Cylinder) -> dict[str, trimesh.Trimesh]:
    mesh = trimesh.creation.cylinder(RADIUS_MM, LENGTH_MM, sections=512)
    mesh.apply_transform(Pose(exp_so3(np.array([0.0, np.pi / 2, 0.0])), np.zeros(3)).matrix)
    return {"pipe": mesh}


PROFILER = profiler(profile_sensor(find_sensor("nominal"), "csv"))
QUIET = replace(PROFILER, sigma_mm=0.0)


def test_its_profile_is_of_its_mesh() -> None:
    view = Pose(exp_so3(np.array([0.2, -0.3, 0.5])), np.array([3.0, -4.0, 300.0])) @ Pose(UPRIGHT.T, np.zeros(3))
    scan = sheet_profile(QUIET, Cylinder(), view, np.random.default_rng(1))
    seen = np.isfinite(scan.z_mm)
    assert seen.sum() > 150
    points = np.column_stack([np.zeros(seen.sum()), scan.y_mm[seen], scan.z_mm[seen]])
    off, gradient = Cylinder().offset(view.inverse() @ points, np.zeros(len(points), dtype=int))
    np.testing.assert_allclose(off, 0, rtol=0, atol=ATOL_MM)
    ray = points - QUIET.origin_mm
    assert np.all(np.sum((gradient[:, 0] @ view.R.T) * ray, axis=1) < 0), "points of the far side"


def test_it_is_boxed_drawn_and_told_of() -> None:
    np.testing.assert_allclose(
        target_boxes(Cylinder())[0], [[-LENGTH_MM / 2, -RADIUS_MM, -RADIUS_MM], [LENGTH_MM / 2, RADIUS_MM, RADIUS_MM]],
        rtol=0, atol=1e-9,
    )  # fmt: skip
    assert _lines(Cylinder(), Pose.identity()).shape == (1, 2, 3)
    place = Pose(UPRIGHT, np.array([1.0, 2.0, 3.0]))
    assert set(Cylinder().at_place(place, np.zeros((1, 3)))) == {"T_base_target"}
    frames = [
        Frame(k, "A", hand=place @ Pose(exp_so3(np.array([0.3 * k, 0.0, 0.0])) @ UPRIGHT.T, np.array([0.0, 0, -300])))
        for k in range(4)
    ]
    found = degenerate(frames, Cylinder(), Pose.identity(), {"A": place})
    assert found is not None
    assert "the cylinder's own line" in found.text


def test_it_is_calibrated_and_its_next_views_tell_more_than_random_ones(tmp_path) -> None:
    rng = np.random.default_rng(2)
    robot, sensor = find_robot("abb_irb6640_180_255"), find_sensor("nominal")
    design = Pose.from_fixed_xyz_deg((0, 0, 20), (-17, -76, 117))
    truth = design @ Pose.exp(np.array([0.5, -0.7, 0.4, 0.01, -0.01, 0.015]))
    built, target = robot.corrected(draw_errors(robot, rng)), Cylinder()
    places = {k: Pose(UPRIGHT, np.array([1600.0, y, 900.0])) for k, y in (("A", -450.0), ("B", 0.0), ("C", 450.0))}
    places["C"] = places["C"] @ Pose(exp_so3(np.array([0.0, 0.0, 1.2])), np.zeros(3))
    frames: list[Frame] = []
    for location, T_base_target in places.items():
        while sum(f.location == location for f in frames) < 7:
            tilt = np.deg2rad(rng.uniform([-40, -25, -25], [40, 25, 25]))
            view = Pose(exp_so3(tilt), exp_so3(tilt) @ [0.0, 0.0, -305.0] + rng.uniform(-10, 10, 3))
            found = inverse_kinematics(robot, T_base_target @ view @ design.inverse(), rng)
            if not found.converged:
                continue
            q = found.joints + rng.normal(size=6) * robot.uncertainty.joint_sigma_rad
            scan = sheet_profile(QUIET, target, (built.pose(q) @ truth).inverse() @ T_base_target, rng)
            seen = np.flatnonzero(np.isfinite(scan.z_mm))
            seen = seen[np.linspace(0.2 * len(seen), 0.8 * len(seen), 20).astype(int)]
            yz = np.column_stack([scan.y_mm[seen], scan.z_mm[seen]]) + rng.normal(size=(20, 2)) * 0.02
            axis = AxisPoints(
                ("cylinder",) * 20, np.full(20, -1), yz, np.tile(4e-4 * np.eye(2), (20, 1, 1)), ("",) * 20
            )
            frames.append(Frame(len(frames), location, joints_rad=found.joints, axis=axis, labels_given=True))
    result = calibrate(frames, target, robot, sensor, design, places, CalibConfig(model="full"))
    assert result.verdict.code == "ok", result.verdict
    error = (result.T_hand_sensor.inverse() @ truth).log()
    assert error @ np.linalg.solve(result.covariance, error) < NEES_LIMIT
    cell = Cell(tmp_path, sensor, target, robot, tuple(frames), design)
    plan = next_views(cell, truth, places, result.frames, 2, model="full", compared=10)
    assert len(plan.views) == 2
    after = float(size_mm(plan.after, "E"))
    assert after < float(size_mm(plan.before, "E"))
    assert after <= float(np.median(size_mm(plan.random, "E")))


def test_one_without_a_body_is_refused_by_name() -> None:
    class Bare(Surface):
        pass

    with pytest.raises(InputError, match="class Bare has no body"):
        sheet_profile(QUIET, Bare(), Pose.identity(), np.random.default_rng(1))
