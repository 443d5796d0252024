"""Figures of sensors, arms and files kept as they are, where laws allow a tolerance or look at a few only."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.synthetic.cell import default_sensor, industrial_arm
from geometry import AxisPoints, Pose, SheetPoints, draw_errors, express, field_of_view, interpret, stack_poses
from geometry.boxes import box_to_boxes_mm, segments_to_boxes_mm
from geometry.pose import exp_so3, log_so3, quaternion_wxyz
from geometry.robot import CONVENTIONS, Compliance, deflection, torque, torque_by_joints, with_compliance_prior
from geometry.robot.compliant import assumed_compliance
from geometry.rounding import clean, json_text, rounded, rounded_by_sigma, rounded_covariance, rounded_transform
from geometry.sensor import SensorUncertainty, project
from geometry.sensor.deviation import SensorDeviation, calibration_covariance, stated_uncertainty
from geometry.sensor.uncertainty import SOURCE_SIGMA
from tests.geometry.strategies import line_sensor, random_robot
from tests.geometry.test_sensor import LENSES
from tests.pinned import pinned

POINTS_MM = np.array([[-40.0, 190.0], [0.0, 240.0], [35.0, 310.0], [12.0, 205.0]])


@pytest.mark.parametrize("lens", LENSES)
def test_what_a_camera_sees_and_how_it_moves(lens: str) -> None:
    sensor = line_sensor(distortion=LENSES[lens])
    camera = sensor.require_camera()
    known = SensorUncertainty.by_source("drawing", (camera.fx_px, camera.fy_px))
    deviation = SensorDeviation(sensor, known.parameters)
    values = 2.0 * np.sqrt(np.diag(known.covariance))
    seen = deviation.seen(POINTS_MM, values)
    twists, motions = deviation.derivatives(POINTS_MM, values)
    really = deviation.really(values)
    pinned(
        {
            "pixels": project(camera, np.column_stack([np.zeros(4), POINTS_MM])),
            "field": field_of_view(sensor, 3.0, 6),
            "plane": seen.T_sensor_sheet.matrix,
            "seen": seen.yz_mm,
            "twists": twists,
            "motions": motions,
            "at rest": deviation.motions(POINTS_MM),
            "on the curve": deviation.on_curve(POINTS_MM, values, known),
            "really": [really.require_camera().matrix, really.require_camera().distortion14],
            "there": really.require_camera().T_sensor_camera.matrix,
        }
    )


@pytest.mark.parametrize("source", SOURCE_SIGMA)
def test_what_a_source_leaves_unknown(source: str) -> None:
    """Of its own numbers, completed where a file names some, and taken apart into independent ones."""
    usual = SensorUncertainty.by_source(source, (1500.0, 1510.0))
    some = SensorUncertainty.from_sigma({"k1": 0.02, "plane_shift_mm": 0.3}, source).completed((1500.0, 1510.0))
    pinned(
        {
            "usual": usual,
            "completed": some,
            "independent": usual.independent(),
            "sigma": some.sigma,
            "profiles": SensorUncertainty.by_source(source, None),
        }
    )


def test_what_a_files_tangent_leaves_of_its_points() -> None:
    sensor = default_sensor()
    camera = sensor.require_camera()
    known = SensorUncertainty.by_source("calibrated", (camera.fx_px, camera.fy_px))
    with_it = replace(sensor, uncertainty=known)
    pinned({"stated": stated_uncertainty(with_it), "covariance": calibration_covariance(with_it, POINTS_MM)})


@pytest.mark.parametrize("convention", ["standard", "modified"])
def test_an_arm_and_what_it_weighs(convention: str) -> None:
    rng = np.random.default_rng(4)
    robot = random_robot(rng, 6, convention)
    q, load = rng.uniform(-1, 1, (3, 6)), Compliance()
    prior = with_compliance_prior(robot)
    off = 0.5 * np.array([p.sigma for p in prior.parameters])
    pinned(
        {
            "pose": robot.pose(q).matrix,
            "joints": robot.joint_jacobian(q),
            "parameters": robot.parameter_jacobian(q),
            "links": robot.link_poses(q).matrix,
            "noise": robot.joint_noise(q),
            "names": robot.parameters,
            "torque": torque(robot, q, load),
            "by joints": torque_by_joints(robot, q, load),
            "deflection": deflection(robot, q, load),
            "assumed": assumed_compliance(robot),
            "prior": prior.parameters,
            "soft": prior.pose(q, off).matrix,
            "soft joints": prior.joint_jacobian(q, off),
            "soft parameters": prior.parameter_jacobian(q, off),
            "soft noise": prior.joint_noise(q, off),
            "drawn": draw_errors(robot, np.random.default_rng(1)),
            "corrected": robot.corrected(draw_errors(robot, np.random.default_rng(1))).pose(q).matrix,
        }
    )


@pytest.mark.parametrize("convention", CONVENTIONS)
def test_a_pose_in_every_makers_numbers(convention: str) -> None:
    pose = Pose.exp(np.array([300.0, -200.0, 90.0, 0.4, -1.1, 0.7]))
    shown = express(pose, convention)
    pinned({"shown": shown, "read": interpret(list(shown.values()), convention).matrix})


def test_rotations_at_every_size() -> None:
    """Near nothing, near a half turn, and where the largest component of a quaternion is any of the four."""
    axis = np.array([[2.0, -1.0, 0.5], [0.1, 1.0, 0.2], [0.0, 0.3, -1.0], [1.0, 1.0, 1.0]])
    unit = axis / np.linalg.norm(axis, axis=1, keepdims=True)
    for angle in (1e-9, 0.9e-4, 1.1e-4, 0.3, 2.0, np.pi - 1e-5, np.pi - 1e-9):
        R = exp_so3(angle * unit)
        np.testing.assert_allclose(log_so3(R), angle * unit, rtol=0, atol=1e-7)
        w = quaternion_wxyz(R)
        np.testing.assert_allclose(np.abs(w[:, 0]), np.cos(angle / 2), rtol=0, atol=1e-12)
        pinned({"R": R, "log": log_so3(R), "quaternion": w})


def test_numbers_as_files_have_them() -> None:
    rng = np.random.default_rng(5)
    root = rng.normal(size=(6, 6)) * [1e-3, 1, 10, 1e-6, 1, 100]
    covariance = root.T @ root
    T = Pose.exp(rng.normal(size=6)).matrix
    values = {
        "covariance_a": covariance.tolist(),
        "T_a_b": T.tolist(),
        "rms_mm": 1 / 3,
        "n": 3,
        "far": np.inf,
        "no": None,
    }
    by_sigma = [
        rounded_by_sigma(v, s) for v in (1234.56789, 0.00123456, -7e-9) for s in (12.0, 0.03, 4e-5, 0.0, np.nan)
    ]
    pinned(
        {
            "rounded": rounded(values),
            "by sigma": by_sigma,
            "transform": rounded_transform(T),
            "covariance": rounded_covariance(covariance),
            "clean": clean(values),
            "text": json_text(rounded(clean(values))),
        }
    )
    assert np.linalg.eigvalsh(rounded_covariance(covariance))[0] >= 0


def test_ways_to_boxes() -> None:
    boxes = np.array([[[-10.0, -20, -30], [10, 20, 30]], [[50, 0, 0], [60, 5, 90]]])
    rng = np.random.default_rng(6)
    starts, ends = rng.uniform(-100, 100, (2, 12, 3))
    turned = Pose.exp(np.array([40.0, 60.0, -10.0, 0.3, 0.2, -0.9]))
    shown = segments_to_boxes_mm(starts, ends, boxes)
    pinned({"segments": shown, "box": box_to_boxes_mm(stack_poses([turned]), boxes[1], boxes)})


def test_frames_of_points_in_one_table() -> None:
    """Frames of other lengths are filled up, and what fills them counts nothing."""
    rng = np.random.default_rng(7)

    def of(labels: str) -> AxisPoints:
        n = len(labels)
        cov = np.tile(np.diag([0.01, 0.04]), (n, 1, 1))
        return AxisPoints(tuple(labels), np.full(n, -1), rng.normal(size=(n, 2)), cov, ("",) * n)

    table = SheetPoints.of([of("ab"), of("c"), of("bca")], ("a", "b", "c"))
    np.testing.assert_array_equal(table.present.sum(axis=1), [2, 1, 3])
    pinned({"all": table, "last": table[np.array([2])], "xyz": table.xyz_mm, "n": len(table)})


def test_an_arms_way_is_the_table_of_its_parameters() -> None:
    arm = industrial_arm()
    pinned({"names": arm.parameters, "limits": arm.stated_limits, "matrix": arm.readings_to_angles})
