"""OpenGL's depth buffers as a third opinion on geometry, visibility and shading; skipped where there is no OpenGL."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import InputError, Pose
from perceptron_emu import EmulatorConfig, Scene, panel, project, render
from perceptron_emu.gl import CellView, GlView, cell_picture, depth_and_identity, gl_problem, gl_world
from perceptron_emu.gl.world import back_project
from tests.perceptron_emu.conftest import jig_before, make_sensor
from tests.pinned import pinned

CLEAN = EmulatorConfig.model_validate(
    {"ambient": {"enabled": False}, "noise": {"enabled": False, "full_well_e": 1e6}, "speckle": {"enabled": False}}
)
STRING_ATOL_PX = 0.05
PLANE_ATOL_PX = 0.01
DEPTH_ATOL_MM = 1e-3

needs_gl = pytest.mark.skipif((PROBLEM := gl_problem()) is not None, reason=str(PROBLEM))
pytestmark = pytest.mark.filterwarnings("ignore")  # PyOpenGL's own deprecations


@needs_gl
def test_depth_map_agrees_with_projection() -> None:
    """Points back-projected from OpenGL's depth of a slanted panel lie on it and project to their own pixels."""
    sensor = make_sensor()
    slanted = Pose.from_fixed_xyz_deg([12, 15, 4], [0, 0, 300])
    scene = Scene(sensor, solids=(panel(300, 300, slanted),))
    intrinsics = (sensor.camera.fx_px, sensor.camera.fy_px, sensor.camera.cx_px, sensor.camera.cy_px)
    view = GlView(sensor.camera.T_sensor_camera, intrinsics, sensor.camera.width_px, sensor.camera.height_px)
    depth, number = depth_and_identity(gl_world(scene, None), view)
    seen = number == 1
    assert seen.sum() > 100_000
    points = back_project(view, depth)[seen]
    assert np.max(np.abs((points - slanted.t) @ slanted.R[:, 2])) < DEPTH_ATOL_MM
    v, u = np.nonzero(seen)
    np.testing.assert_allclose(project(sensor, points), np.column_stack([u, v]), rtol=0, atol=1e-6)


@needs_gl
def test_strings_agree_with_opengl() -> None:
    scene = jig_before(make_sensor())
    own, gl = (render(scene, CLEAN, renderer=name).truth.strings for name in ("own", "pyrender"))  # type: ignore[arg-type]
    for a, b in zip(own, gl, strict=True):
        np.testing.assert_allclose(b.image_px, a.image_px, rtol=0, atol=STRING_ATOL_PX)
        assert b.electrons == pytest.approx(a.electrons, rel=0.03)


@needs_gl
def test_a_stripe_agrees_with_opengl() -> None:
    sensor = make_sensor(bit_depth=16)
    scene = Scene(sensor, solids=(panel(400, 24, Pose.from_fixed_xyz_deg([12, 15, 4], [0, 0, 300])),))
    rows = np.arange(sensor.camera.height_px)[:, None]
    centres = []
    for name in ("own", "pyrender"):
        image = render(scene, CLEAN, renderer=name).image[:, 590:690].astype(float) - 10  # type: ignore[arg-type]
        centres.append((rows * image).sum(0) / image.sum(0))
    assert abs(np.mean(centres[1] - centres[0])) < PLANE_ATOL_PX
    assert np.std(centres[1] - centres[0]) < PLANE_ATOL_PX


@needs_gl
def test_pictures_show_sensor_sheet_and_jig() -> None:
    """The cell's picture holds the sheet's red and the view's green."""
    scene = jig_before(make_sensor())
    assert scene.jig is not None
    cell = CellView(scene.sensor, Pose.identity(), ((scene.jig, scene.T_sensor_jig),))
    picture = cell_picture(cell, 320, 240).astype(int)
    assert picture.shape == (240, 320, 3)
    assert np.sum(picture[..., 0] - picture[..., 1] > 20) > 50
    assert np.sum(picture[..., 1] - picture[..., 0] > 20) > 50


@needs_gl
def test_the_same_cell_gives_the_same_picture() -> None:
    """Arm, sensor and jigs reach into each other: what is drawn last shows there."""
    scene = jig_before(make_sensor())
    assert scene.jig is not None
    beside = Pose(np.eye(3), np.array([3.0, 2.0, 1.0])) @ scene.T_sensor_jig
    links = Pose(
        np.repeat(np.eye(3)[None], 4, 0), np.array([[0, 0, -700], [300, -200, -300], [90, -50, -100], [0, 0, 0.0]])
    )
    jigs = ((scene.jig, scene.T_sensor_jig), (scene.jig, beside))
    first, *others = (cell_picture(CellView(scene.sensor, Pose.identity(), jigs, links), 640, 480) for _ in range(4))
    for other in others:
        np.testing.assert_array_equal(other, first)


def test_an_unknown_renderer_is_an_input_error() -> None:
    with pytest.raises(InputError, match="povray") as refused:
        render(jig_before(make_sensor()), renderer="povray")  # type: ignore[arg-type]
    pinned(str(refused.value))
