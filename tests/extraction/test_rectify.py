"""Pixels → laser sheet against OpenCV, against geometry and against finite differences."""

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from extraction.sheet import SheetTable, image_to_sheet, propagate, sheet_table, undistort
from geometry import Camera, InputError, Pose, Sensor, Sheet, exp_so3
from tests.pinned import pinned

ATOL_PX = 1e-9
ATOL_MM = 1e-9
ATOL_TABLE_MM = 1e-4

DISTORTIONS = {
    "none": (),
    "four": (-0.18, 0.12, 8e-4, -6e-4),
    "five": (-0.25, 0.14, 1e-3, -5e-4, -0.03),
    "rational": (0.8, -0.3, 5e-4, 2e-4, 0.05, 0.95, -0.2, 0.02),
    "prism": (-0.2, 0.1, 1e-4, 2e-4, 0.0, 0.0, 0.0, 0.0, 2e-3, -1e-3, 1e-3, 5e-4),
    "tilted": (-0.2, 0.15, 1e-3, -2e-3, 0.05, 0.01, -0.02, 0.01, 1e-3, -1e-3, 2e-3, 1e-3, 0.12, -0.15),
}


def make_sensor(distortion: tuple[float, ...], camera_yaw_rad: float = 0.4) -> Sensor:
    """A sensor whose camera stands 120 mm beside the sheet, image rows along -z, and looks inwards."""
    x_and_y = np.array([[0.0, -np.cos(camera_yaw_rad), -np.sin(camera_yaw_rad)], [1, 0, 0]])
    R = np.vstack([x_and_y, np.cross(x_and_y[0], x_and_y[1])])
    pose = Pose(R, np.array([120.0, 3.0, -5.0]))
    return Sensor(Sheet(), Camera(1280, 1024, 2300.0, 2290.0, 641.5, 509.5, pose, distortion))


def pixels(n: int = 3000, seed: int = 1) -> np.ndarray:
    return np.random.default_rng(seed).uniform([-0.5, -0.5], [1279.5, 1023.5], (n, 2))


@pytest.mark.parametrize("name", DISTORTIONS)
def test_opencv_projects_the_sheet_points_back_onto_their_pixels(name):
    """Round trip through `cv2.projectPoints`; says nothing on how well a lens follows the model."""
    sensor, uv = make_sensor(DISTORTIONS[name]), pixels()
    yz, _ = image_to_sheet(sensor, uv)
    xyz = np.column_stack([np.zeros(len(yz)), yz])
    to_camera = sensor.camera.T_sensor_camera.inverse()
    back = cv2.projectPoints(
        xyz, cv2.Rodrigues(to_camera.R)[0], to_camera.t, sensor.camera.matrix, sensor.camera.distortion14
    )
    np.testing.assert_allclose(back[0][:, 0], uv, atol=ATOL_PX, rtol=0)


@pytest.mark.parametrize("name", [name for name in DISTORTIONS if name != "none"])
def test_rays_agree_with_opencv_undistort_points(name):
    sensor, uv = make_sensor(DISTORTIONS[name]), pixels(500)
    many_steps = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 500, 1e-15)
    theirs = cv2.undistortPointsIter(
        uv[:, None], sensor.camera.matrix, sensor.camera.distortion14, np.eye(3), np.eye(3), many_steps
    )
    np.testing.assert_allclose(undistort(sensor, uv).xy * 2300, theirs[:, 0] * 2300, atol=1e-8, rtol=0)


def test_known_point_by_hand():
    """The principal ray of a camera at (120, 3, -5), turned by 0.4 rad, meets x = 0 at z = -5 + 120 / tan 0.4."""
    sensor = make_sensor((), camera_yaw_rad=0.4)
    yz, _ = image_to_sheet(sensor, np.array([[641.5, 509.5]]))
    np.testing.assert_allclose(yz[0], [3.0, -5.0 + 120.0 / np.tan(0.4)], atol=ATOL_MM, rtol=0)


@pytest.mark.parametrize("name", DISTORTIONS)
def test_jacobian_is_the_derivative(name):
    sensor, uv, h = make_sensor(DISTORTIONS[name]), pixels(300), 1e-3
    _, jacobian = image_to_sheet(sensor, uv)
    for axis in range(2):
        step = h * np.eye(2)[axis]
        slope = (image_to_sheet(sensor, uv + step)[0] - image_to_sheet(sensor, uv - step)[0]) / (2 * h)
        np.testing.assert_allclose(jacobian[:, :, axis], slope, atol=1e-7, rtol=1e-6)


@pytest.mark.parametrize("name", DISTORTIONS)
def test_table_agrees_with_the_exact_inversion_over_the_image(name):
    sensor = make_sensor(DISTORTIONS[name])
    table, uv = SheetTable.build(sensor), pixels(20000, seed=2)
    exact, exact_jacobian = image_to_sheet(sensor, uv)
    read, jacobian = table.lookup(uv)
    assert np.abs(read - exact).max() <= ATOL_TABLE_MM
    np.testing.assert_allclose(jacobian, exact_jacobian, rtol=1e-3, atol=1e-4)
    assert table.usable[1:-1, 1:-1].mean() > 0.5, "most of the image is answered by the table"


def test_table_is_built_once_per_sensor():
    sensor = make_sensor(DISTORTIONS["five"])
    assert sheet_table(sensor) is sheet_table(sensor)
    assert sheet_table(make_sensor(DISTORTIONS["five"])) is not sheet_table(sensor)


def test_rays_that_miss_the_sheet_are_nan_in_both_ways():
    """Looking nearly along the sheet, one side of the image sees past it."""
    sensor = make_sensor((), camera_yaw_rad=0.1)
    uv = np.array([[640.0, 0.0], [640.0, 1023.0]])
    yz, jacobian = image_to_sheet(sensor, uv)
    missed = np.isnan(yz).any(axis=1)
    assert missed.sum() == 1
    assert np.isnan(jacobian[missed]).all()
    assert np.isfinite(jacobian[~missed]).all()
    np.testing.assert_allclose(SheetTable.build(sensor).lookup(uv)[0], yz, atol=ATOL_TABLE_MM)


def test_pixels_beyond_the_fold_of_the_lens_are_nan_not_another_branch():
    """k1 = -1 folds at r = 1/√3, seen radius 0.385: no ray exists beyond it, and within it none of another branch."""
    sensor = make_sensor((-1.0, 0.0, 0.0, 0.0))
    seen = np.array([0.1, 0.3, 0.38, 0.39, 0.8])
    uv = np.column_stack([641.5 + 2300 * seen, np.full(5, 509.5)])
    xy = undistort(sensor, uv).xy
    assert np.isfinite(xy[:3]).all()
    assert np.isnan(xy[3:]).all()
    assert (xy[:3, 0] < 1 / np.sqrt(3)).all()
    np.testing.assert_allclose(xy[:3, 0] * (1 - xy[:3, 0] ** 2), seen[:3], atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(
    st.floats(-0.3, 0.3), st.floats(-0.2, 0.2), st.floats(-0.25, 0.25), st.floats(-0.25, 0.25), st.integers(0, 2**31)
)
def test_every_finite_answer_projects_back(k1, k2, tau_x, tau_y, seed):
    """Law: wherever an answer is given, OpenCV's forward model carries it onto its pixel."""
    sensor = make_sensor((k1, k2, 1e-3, 1e-3, 0, 0, 0, 0, 0, 0, 0, 0, tau_x, tau_y))
    uv = pixels(50, seed)
    xy = undistort(sensor, uv).xy
    good = np.isfinite(xy).all(axis=1)
    rays = np.column_stack([xy, np.ones(len(xy))])[good]
    back = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), sensor.camera.matrix, sensor.camera.distortion14)[0][:, 0]
    np.testing.assert_allclose(back, uv[good], atol=ATOL_PX, rtol=0)
    assert good.any()


def test_covariance_by_monte_carlo():
    sensor, rng = make_sensor(DISTORTIONS["tilted"]), np.random.default_rng(3)
    cov = np.array([[0.04, 0.01], [0.01, 0.02]])
    centre = np.array([[700.0, 400.0]])
    _, jacobian = image_to_sheet(sensor, centre)
    cloud, _ = image_to_sheet(sensor, centre + rng.multivariate_normal(np.zeros(2), cov, 40000))
    np.testing.assert_allclose(np.cov(cloud.T), propagate(jacobian, cov)[0], rtol=0.04)


@pytest.mark.parametrize("uv", [np.zeros(2), np.zeros((3, 3)), np.zeros((2, 2, 2))])
def test_wrong_shape_is_refused(uv):
    with pytest.raises(InputError, match="shape") as refused:
        image_to_sheet(make_sensor(()), uv)
    pinned(str(refused.value))


def test_empty_and_nan_input():
    sensor = make_sensor(DISTORTIONS["tilted"])
    yz, jacobian = image_to_sheet(sensor, np.zeros((0, 2)))
    assert yz.shape == (0, 2)
    assert jacobian.shape == (0, 2, 2)
    assert np.isnan(image_to_sheet(sensor, np.array([[np.nan, 1.0]]))[0]).all()
    assert np.isnan(sheet_table(sensor).lookup(np.array([[np.nan, 1.0]]))[0]).all()


def test_any_camera_attitude_meets_the_sheet_at_x_zero():
    """Law: camera centre, sheet point and ray are collinear for random attitudes."""
    rng = np.random.default_rng(5)
    base = make_sensor(())
    for _ in range(20):
        pose = Pose(
            exp_so3(rng.normal(0, 0.2, 3)) @ base.camera.T_sensor_camera.R, base.camera.centre_mm + rng.normal(0, 5, 3)
        )
        sensor = Sensor(Sheet(), Camera(1280, 1024, 2300.0, 2290.0, 641.5, 509.5, pose))
        uv = pixels(20, 7)
        yz, _ = image_to_sheet(sensor, uv)
        seen = np.column_stack([np.zeros(len(yz)), yz]) - pose.t
        rays = np.column_stack([undistort(sensor, uv).xy, np.ones(len(uv))]) @ pose.R.T
        off = np.linalg.norm(np.cross(seen, rays), axis=1) / np.linalg.norm(rays, axis=1)
        assert np.nanmax(off) < 1e-8


@pytest.mark.parametrize("name", ["none", "five"])
def test_beyond_the_tables_nodes_the_exact_inversion_answers(name):
    """On every side, one pixel within the last cell and one beyond it."""
    sensor = make_sensor(DISTORTIONS[name])
    columns, rows = (-30.0, -9.0, 640.0, 1287.0, 1289.0, 1310.0), (-30.0, -9.0, 1031.0, 1033.0, 1060.0)
    uv = np.array([[u, v] for u in columns for v in rows])
    read, jacobian = SheetTable.build(sensor).lookup(uv)
    exact, slope = image_to_sheet(sensor, uv)
    np.testing.assert_allclose(read, exact, atol=ATOL_TABLE_MM, rtol=0)
    np.testing.assert_allclose(jacobian, slope, atol=1e-3, rtol=1e-3)
