"""Points under other sensor parameters, against OpenCV's projection of the points that they should be."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from calib.synthetic.cell import default_sensor
from geometry import Pose, Sensor, exp_so3
from geometry.sensor import (
    SENSOR_PARAMETERS,
    SensorDeviation,
    SensorUncertainty,
    calibration_covariance,
    project,
    stated_uncertainty,
)

ATOL_PX = 1e-8
CHANGES = {
    "focal": {"fx_px": 15.0, "fy_px": 12.0},
    "centre": {"cx_px": 5.0, "cy_px": -4.0},
    "lens": {"k1": -0.08, "p1": 1e-3},
    "plane": {"plane_tilt_y_rad": 4e-3, "plane_tilt_z_rad": -3e-3, "plane_shift_mm": 0.4},
}


@pytest.mark.parametrize("kind", CHANGES)
def test_a_point_keeps_its_pixel(kind: str) -> None:
    """The corrected camera projects the corrected point to the pixel that the file's camera saw its point in."""
    sensor, change = default_sensor(), CHANGES[kind]
    camera = sensor.require_camera()
    yz = np.random.default_rng(1).uniform([-40, 250], [40, 330], (20, 2))
    seen = SensorDeviation(sensor, tuple(change)).seen(yz, list(change.values()))
    true_mm = seen.T_sensor_sheet @ np.column_stack([np.zeros(20), seen.yz_mm])
    if kind != "plane":
        np.testing.assert_allclose(true_mm[:, 0], 0, atol=1e-12)

    def project(p: np.ndarray, more: dict[str, float]) -> np.ndarray:
        back = camera.T_sensor_camera.inverse()
        K = camera.matrix + np.array(
            [[more.get("fx_px", 0), 0, more.get("cx_px", 0)], [0, more.get("fy_px", 0), more.get("cy_px", 0)], [0] * 3]
        )
        lens = np.array([more.get("k1", 0.0), 0.0, more.get("p1", 0.0), 0.0, 0.0])
        return np.asarray(cv2.projectPoints(p, cv2.Rodrigues(back.R)[0], back.t, K, lens)[0][:, 0])

    by_file = project(np.column_stack([np.zeros(20), yz]), {})
    np.testing.assert_allclose(project(true_mm, change), by_file, atol=ATOL_PX)


def test_derivatives_are_those_of_the_plane_and_of_the_points() -> None:
    names = ("fx_px", "cy_px", "k1", "plane_tilt_y_rad", "plane_tilt_z_rad", "plane_shift_mm", "scale_z")
    deviation = SensorDeviation(default_sensor(), names)
    rng = np.random.default_rng(2)
    yz, values = rng.uniform([-40, 250], [40, 330], (3, 5, 2)), rng.normal(size=7) * 1e-3
    twists, motions = deviation.derivatives(yz, values)
    step = rng.normal(size=7) * 1e-6
    here, there = deviation.seen(yz, values), deviation.seen(yz, values + step)
    np.testing.assert_allclose(motions @ step, there.yz_mm - here.yz_mm, atol=1e-9)
    np.testing.assert_allclose((here.T_sensor_sheet.inverse() @ there.T_sensor_sheet).log(), twists @ step, atol=1e-11)


EVERY = SENSOR_PARAMETERS
LENS = (-0.12, 0.2, 1e-3, -5e-4, 0.02, 0.01, 0.0, 0.0, 1e-3, 0.0, -1e-3, 0.0, 0.04, -0.06)


def test_motions_in_closed_form_are_the_derivatives() -> None:
    sensor = default_sensor().with_camera(distortion=LENS)
    deviation = SensorDeviation(sensor, EVERY)
    yz = np.random.default_rng(3).uniform([-40, 250], [40, 330], (30, 2))
    motions = deviation.derivatives(yz, np.zeros(len(EVERY)))[1]
    scale = np.abs(motions).max(axis=(0, 1))
    np.testing.assert_allclose(deviation.motions(yz) / scale, motions / scale, rtol=0, atol=1e-4)  # of differences


def test_the_sensor_as_it_really_is_sees_its_points_where_the_file_expects_others() -> None:
    """The corrected sensor's points in its own plane lie on the pixels in which the file sees the measured ones."""
    sensor = default_sensor().with_camera(distortion=LENS)
    names = ("fx_px", "cy_px", "k1", "tau_x", "plane_tilt_y_rad", "plane_tilt_z_rad", "plane_shift_mm")
    values = np.array([8.0, -3.0, 0.02, 0.01, 3e-3, -2e-3, 0.3])
    deviation = SensorDeviation(sensor, names)
    yz = np.random.default_rng(4).uniform([-40, 250], [40, 330], (20, 2))
    true_yz = deviation.seen(yz, values).yz_mm

    def pixels(of: Sensor, points: np.ndarray) -> np.ndarray:
        return project(of.require_camera(), np.column_stack([np.zeros(len(points)), points]))

    np.testing.assert_allclose(pixels(deviation.really(values), true_yz), pixels(sensor, yz), atol=1e-7)


def test_the_covariance_of_points_is_what_drawn_sensors_scatter() -> None:
    sensor = replace(default_sensor(), uncertainty=SensorUncertainty((), np.zeros((0, 0)), "data sheet"))
    known = stated_uncertainty(sensor)
    assert known is not None
    yz = np.array([[-30.0, 260.0], [0.0, 290.0], [35.0, 320.0]])
    stated = calibration_covariance(sensor, yz)
    rng, deviation = np.random.default_rng(5), SensorDeviation(sensor, known.parameters)
    drawn = rng.multivariate_normal(np.zeros(len(known.parameters)), known.covariance, 400)
    moved = np.stack([deviation.seen(yz, values).yz_mm - yz for values in drawn])
    for k in range(len(yz)):
        ratio = np.linalg.eigvals(np.linalg.solve(stated[k], np.cov(moved[:, k].T))).real
        assert np.all((ratio > 0.75) & (ratio < 1.3))


def test_a_sensor_that_states_nothing_has_no_covariance() -> None:
    assert calibration_covariance(default_sensor(), np.zeros((2, 2))) is None


def test_profile_sensor_has_scales_alone() -> None:
    assert SensorUncertainty.by_source("drawing", None).parameters == ("scale_y", "scale_z")


def test_independent_errors_give_the_covariance_back() -> None:
    usual = SensorUncertainty.by_source("data sheet", (2300.0, 2300.0))
    names, basis = usual.independent()
    np.testing.assert_allclose(basis @ basis.T, usual.covariance, rtol=0, atol=1e-12)
    assert names[0] == "fx_px, fy_px"


def test_plane_is_turned_about_its_axes() -> None:
    seen = SensorDeviation(default_sensor(), ("plane_tilt_y_rad",)).seen(np.zeros((0, 2)), [0.01])
    np.testing.assert_allclose(seen.T_sensor_sheet.matrix, Pose(exp_so3(np.array([0, 0.01, 0])), np.zeros(3)).matrix)


def _tilted_valley(sensor: Sensor, names: tuple[str, ...], yz: np.ndarray) -> SensorUncertainty:
    """A chip's tilt of 1° that the other numbers make up for at its foot, and little else."""
    sigma = np.array([1.0, 1.0, 60.0, 60.0, 2e-3, 2e-3, 0.02, 0.02])
    by = SensorDeviation(sensor, names).motions(yz).reshape(-1, len(names)) * sigma
    columns = [np.eye(len(names))[:, -2:]]
    columns[0][:6] = -np.linalg.lstsq(by[:, :6], by[:, 6:], rcond=1e-9)[0]
    basis = np.column_stack([*columns, 1e-4 * np.eye(len(names))]) * sigma[:, None]
    return SensorUncertainty(names, basis @ basis.T, None, basis @ basis.T)


def test_sensors_drawn_on_the_curve_scatter_as_the_tangent_says() -> None:
    """Along the tangent itself the sag of a tilted chip's valley would show; the plane is left as it was drawn."""
    sensor, names = default_sensor(), ("fx_px", "fy_px", "cx_px", "cy_px", "p1", "p2", "tau_x", "tau_y")
    y, z = np.meshgrid(np.linspace(-40, 40, 5), np.linspace(260, 330, 5))
    yz = np.stack([y.ravel(), z.ravel()], -1)
    known = _tilted_valley(sensor, names, yz)
    deviation, (_, basis) = SensorDeviation(sensor, names), known.independent()
    tangent = deviation.motions(yz).reshape(-1, len(names))
    stated = float(np.sqrt(np.mean(np.sum((tangent @ known.of_points) * tangent, axis=1))))
    rng = np.random.default_rng(2)
    straight, curved = list[np.ndarray](), list[np.ndarray]()
    for _ in range(60):
        values = basis @ rng.standard_normal(basis.shape[1])
        for kind, v in ((straight, values), (curved, deviation.on_curve(yz, values, known))):
            kind.append(deviation.seen(yz, v).yz_mm - yz)
    rms = [float(np.sqrt(np.mean(np.square(kind)))) for kind in (straight, curved)]
    assert rms[0] > 1.5 * stated
    assert rms[1] == pytest.approx(stated, rel=0.25)
