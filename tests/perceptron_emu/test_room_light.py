"""Room light: where faces lie in a bent image, and what lies before what."""

import cv2
import numpy as np
import pytest
import trimesh

from geometry import Pose
from perceptron_emu import EmulatorConfig, Material, Scene, Solid, mean_electrons, panel

from .conftest import make_sensor

BENT = (-0.2, 0.08, 1e-3, -8e-4, 0.01, 0.02, -0.01, 0.004, 2e-4, -1e-4, 3e-4, 1e-4, 0.03, -0.05)
ROOM = EmulatorConfig.model_validate(
    {"ambient": {"fill": 1.0}, "optics": {"vignetting": False}, "exposure": {"laser_on": False}}
)
MEAN_PX = 0.01  # of an edge that a whole image of rows shows
PLACE = Pose.from_fixed_xyz_deg([10, -15, 25], [3, 2, 300.0])


def room(*solids: Solid, config: EmulatorConfig = ROOM) -> np.ndarray:
    return mean_electrons(Scene(make_sensor(BENT), solids=solids), config)


def white() -> float:
    """Electrons of a white surface: a panel that fills the image."""
    return float(room(panel(4000, 4000, PLACE, Material(1.0)))[500, 600])


def test_a_panel_brings_the_light_of_its_image() -> None:
    """The blur keeps all light: its sum is the area of the panel's outline, drawn by OpenCV's lens, times its level."""
    camera = make_sensor(BENT).camera
    half = np.array([[-20.0, -15], [20, -15], [20, 15], [-20, 15]])
    t = np.linspace(0, 1, 400, endpoint=False)[:, None]
    rim = np.concatenate([a + t * (b - a) for a, b in zip(half, np.roll(half, -1, 0), strict=True)])
    there = camera.T_sensor_camera.inverse() @ (PLACE @ np.column_stack([rim, np.zeros(len(rim))]))
    u, v = cv2.projectPoints(there, np.zeros(3), np.zeros(3), camera.matrix, camera.distortion14)[0][:, 0].T
    area = abs(np.sum(u * np.roll(v, -1) - v * np.roll(u, -1))) / 2
    image = room(panel(40, 30, PLACE, Material(0.5)))
    assert image.sum() / (0.5 * white()) == pytest.approx(area, rel=5e-4)
    rows, columns = np.mgrid[: image.shape[0], : image.shape[1]]
    moment = np.sum((u + np.roll(u, -1)) * (u * np.roll(v, -1) - v * np.roll(u, -1))) / 6 / area
    assert np.sum(image * columns) / image.sum() == pytest.approx(abs(moment), abs=0.03)
    assert rows[image > 0].min() < v.min() < v.max() < rows[image > 0].max()


def test_parts_of_pixels_put_edges_where_they_are() -> None:
    """Edges near the image's axes: the light beyond them, over the pixels along them, is their place."""
    camera = make_sensor().camera
    place = Pose.from_fixed_xyz_deg([0, 0, 0], [0, 0, 300.0])
    far, off = {}, {}
    for samples in (1, 4):
        config = ROOM.model_copy(update={"ambient": ROOM.ambient.model_copy(update={"samples": samples})})
        T = camera.T_sensor_camera @ place @ Pose.from_fixed_xyz_deg([0, 0, 1.0], [1.03, 0, 0])
        seen = mean_electrons(Scene(make_sensor(), solids=(panel(20, 40, T, Material(0.5)),)), config)
        corners = (T @ np.array([[10.0, -20, 0], [10, 20, 0]])) @ camera.T_sensor_camera.R
        corners -= camera.T_sensor_camera.t @ camera.T_sensor_camera.R
        (u0, v0), (u1, v1) = camera.fx_px * corners[:, :2] / corners[:, 2:] + [camera.cx_px, camera.cy_px]
        rows = np.arange(int(v0) + 20, int(v1) - 20)
        middle = int(camera.cx_px)
        level = seen[rows, middle]
        found = middle - 0.5 + seen[rows, middle:].sum(axis=1) / level
        apart = found - (u0 + (rows - v0) * (u1 - u0) / (v1 - v0))
        far[samples], off[samples] = float(np.abs(apart).max()), float(apart.mean())
    assert far[4] < 0.3 * far[1]
    assert abs(off[4]) < MEAN_PX


def test_a_plane_is_one_however_it_is_cut() -> None:
    """The same panel of 2 and of 2,048 triangles, of corners named once and named anew."""
    whole = panel(60, 50, PLACE, Material(0.5))
    fine = whole.mesh
    for _ in range(5):
        fine = fine.subdivide()
    soup = trimesh.Trimesh(fine.triangles.reshape(-1, 3), np.arange(3 * len(fine.faces)).reshape(-1, 3), process=False)
    seen = room(whole)
    for mesh in (fine, soup):
        other = room(Solid(mesh, Material(0.5), PLACE))
        assert np.mean(np.abs(other - seen) > 1e-3 * seen.max()) < 2e-5


def test_a_hole_shows_what_lies_behind() -> None:
    ring = trimesh.creation.annulus(10, 30, 4, sections=48)
    wall = panel(600, 600, Pose(np.eye(3), np.array([0.0, 0, 380])), Material(0.2))
    image = room(Solid(ring, Material(0.8), PLACE), wall) / white()
    centre = make_sensor(BENT).camera
    seen = centre.T_sensor_camera.inverse() @ PLACE.t[None]
    u, v = np.round(cv2.projectPoints(seen, np.zeros(3), np.zeros(3), centre.matrix, centre.distortion14)[0][0, 0])
    assert image[int(v), int(u)] == pytest.approx(0.2, rel=1e-3)
    assert image[int(v), int(u) + 150] == pytest.approx(0.8, rel=1e-3)


def test_the_nearer_face_is_seen_whatever_the_order() -> None:
    near, far = (
        panel(30, 30, Pose(np.eye(3), np.array([0.0, 0, z])), Material(a)) for z, a in ((280, 0.7), (320, 0.1))
    )
    assert np.array_equal(room(near, far), room(far, near))
    assert room(near, far).max() == pytest.approx(0.7 * white(), rel=1e-3)


def test_a_face_that_reaches_behind_the_camera_is_cut() -> None:
    floor = panel(3000, 3000, Pose.from_fixed_xyz_deg([90, 0, 0], [0, 30, 0]), Material(0.5))
    image = room(floor)
    assert image[500, -1] == pytest.approx(0.5 * white(), rel=1e-3)
    assert np.isfinite(image).all()


def test_a_lamp_casts_the_shadow_of_its_direction() -> None:
    """A panel over a wall: the shadow is the panel's outline moved along the light, as large and dark as it must be."""
    lamp = {"direction": (0.3, 0.1, 0.9), "fill": 0.4, "shadows": True}
    lit = EmulatorConfig.model_validate(ROOM.model_dump() | {"ambient": lamp})
    plain = EmulatorConfig.model_validate(ROOM.model_dump() | {"ambient": lamp | {"shadows": False}})
    wall = panel(500, 500, Pose(np.eye(3), np.array([0.0, 0, 360])), Material(0.5))
    board = panel(24, 20, Pose(np.eye(3), np.array([-30.0, -10, 320])), Material(0.5))
    alone, before = room(wall, config=lit), room(wall, board, config=plain)
    np.testing.assert_allclose(alone, room(wall, config=plain), rtol=2e-3)
    seen = room(wall, board, config=lit)
    depth = 0.9 / np.linalg.norm([0.3, 0.1, 0.9])
    shade = seen[(seen < 0.9 * before) & (before > 0)]
    assert np.median(shade) / alone.max() == pytest.approx(0.4 / (0.4 + 0.6 * depth), rel=2e-2)
    camera = make_sensor(BENT).camera
    half = np.array([[-12.0, -10], [12, -10], [12, 10], [-12, 10]])
    t = np.linspace(0, 1, 400, endpoint=False)[:, None]
    rim = np.concatenate([a + t * (b - a) for a, b in zip(half, np.roll(half, -1, 0), strict=True)])
    moved = np.array([[-30.0, -10, 320]]) + np.array([0.3, 0.1, 0.9]) * (40 / 0.9)
    on_wall = np.column_stack([rim, np.zeros(len(rim))]) + moved
    there = camera.T_sensor_camera.inverse() @ on_wall
    u, v = cv2.projectPoints(there, np.zeros(3), np.zeros(3), camera.matrix, camera.distortion14)[0][:, 0].T
    area = abs(np.sum(u * np.roll(v, -1) - v * np.roll(u, -1))) / 2
    full = np.median((before - seen)[(seen < 0.9 * before) & (before > 0)])
    assert np.sum(before - seen > full / 2) == pytest.approx(area, rel=0.01)
