"""Laws of the rendered frame: truth, determinism, shadows, energy. Shading itself is checked elsewhere against a path
tracer.
"""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from geometry import Pose, Sensor
from jig_cad import Jig
from perceptron_emu import EmulatorConfig, Scene, Solid, mean_electrons, panel, project, render
from tests.perceptron_emu.conftest import TILTED, jig_before, make_sensor
from tests.pinned import pinned

ATOL_PX = 1e-5
EXACT_LINE_PX = 1e-3
CLEAN_16BIT = EmulatorConfig.model_validate(
    {"ambient": {"enabled": False}, "noise": {"enabled": False, "full_well_e": 1e6}, "speckle": {"enabled": False}}
)


def centroid(image: np.ndarray, black: float, uv: np.ndarray, half: int = 14) -> np.ndarray:
    u, v = np.round(uv).astype(int)
    patch = image[v - half : v + half + 1, u - half : u + half + 1] - black
    rows, columns = np.mgrid[v - half : v + half + 1, u - half : u + half + 1]
    return np.array([np.sum(patch * columns), np.sum(patch * rows)]) / np.sum(patch)


def test_same_seed_same_bytes(scene: Scene) -> None:
    first, again, other = (render(scene, None, np.random.default_rng(s)) for s in (3, 3, 4))
    assert first.image.tobytes() == again.image.tobytes()
    assert first.image.tobytes() != other.image.tobytes()


@pytest.mark.parametrize("distortion", [(), TILTED])
def test_noise_free_spot_centroid_is_the_truth(distortion: tuple[float, ...]) -> None:
    """The drawn pixels and the truth integrate the same light by different sums."""
    scene = jig_before(make_sensor(distortion))
    electrons = mean_electrons(scene, CLEAN_16BIT).astype(float)
    for string in render(scene, CLEAN_16BIT).truth.strings:
        found = centroid(electrons, 0.0, string.image_px)
        np.testing.assert_allclose(found, string.image_px, rtol=0, atol=ATOL_PX)


def test_axis_points_lie_on_the_strings_and_in_the_sheet(scene: Scene) -> None:
    assert scene.jig is not None
    in_jig = scene.T_sensor_jig.inverse()
    for i, string in enumerate(render(scene, CLEAN_16BIT).truth.strings):
        point = in_jig @ np.array([0.0, *string.axis_mm])
        offset = point - scene.jig.starts[i]
        assert np.linalg.norm(np.cross(offset, scene.jig.directions[i])) < 1e-9


def test_lit_surface_lies_between_axis_and_emitter(scene: Scene) -> None:
    """The lit surface is nearer than the axis by 0.8 to 1.5 radii in z, up to 0.3 in y."""
    radius = 0.15
    for string in render(scene, CLEAN_16BIT).truth.strings:
        dy, dz = (string.surface_mm - string.axis_mm) / radius
        assert -1.6 < dz < -0.75
        assert abs(dy) < 0.45


def test_a_plate_before_the_laser_hides_every_string(scene: Scene) -> None:
    shield = panel(300, 300, Pose(np.eye(3), np.array([0.0, 0, 150])))
    frame = render(Scene(scene.sensor, scene.jig, scene.T_sensor_jig, (shield,)), CLEAN_16BIT)
    pinned(frame)
    assert all(s.visible_fraction == 0 and np.all(np.isnan(s.image_px)) for s in frame.truth.strings)
    assert all(np.all(np.isfinite(s.axis_mm)) for s in frame.truth.strings)


def test_a_blade_before_the_camera_cuts_a_spot(scene: Scene) -> None:
    """A box whose edge the camera's ray to string A grazes hides part of the spot and moves its centroid to the free
    side.
    """
    free = render(scene, CLEAN_16BIT).truth.strings[0]
    pinned(free)
    towards = scene.sensor.camera.centre_mm - np.array([0.0, *free.surface_mm])
    edge = np.array([0.0, *free.surface_mm]) + 0.1 * towards
    blade = trimesh.creation.box((20, 20, 0.5))
    blade.apply_translation([0, 10 + edge[1], edge[2]])
    frame = render(Scene(scene.sensor, scene.jig, scene.T_sensor_jig, (Solid(blade),)), CLEAN_16BIT)
    pinned(frame)
    cut = frame.truth.strings[0]
    assert 0.2 < cut.visible_fraction < 0.8
    assert cut.image_px[0] < free.image_px[0] - 0.1


def test_stripe_on_a_tilted_plane_lies_on_the_exact_line() -> None:
    sensor = make_sensor()
    plane = Pose.from_fixed_xyz_deg([12, 15, 4], [0, 0, 300])
    image = mean_electrons(Scene(sensor, solids=(panel(400, 400, plane),)), CLEAN_16BIT).astype(float)
    normal, point = plane.R[:, 2], plane.t
    y = np.linspace(-60, 60, 4001)
    z = point[2] - (normal[1] * (y - point[1]) + normal[0] * (0 - point[0])) / normal[2]
    line = project(sensor, np.column_stack([np.zeros_like(y), y, z]))
    columns = np.arange(250, 1000)
    rows = np.arange(sensor.camera.height_px)[:, None]
    measured = np.sum(rows * image[:, columns], 0) / np.sum(image[:, columns], 0)
    error = measured - np.interp(columns, line[:, 0], line[:, 1])
    assert abs(np.mean(error)) < EXACT_LINE_PX
    assert np.std(error) < EXACT_LINE_PX


def test_strings_cast_shadows_on_a_wall() -> None:
    sensor = make_sensor(bit_depth=16)
    wall = panel(900, 900, Pose(np.eye(3), np.array([0.0, 0, 420])))
    jig = jig_before(sensor)
    bare = render(Scene(sensor, solids=(wall,)), CLEAN_16BIT).image.astype(float).sum()
    pinned(bare)
    both = render(Scene(sensor, jig.jig, jig.T_sensor_jig, (wall,)), CLEAN_16BIT)
    pinned(both)
    spots = sum(s.electrons for s in both.truth.strings) * (65535 - 10) / 1e6
    assert both.image.astype(float).sum() < bare + spots


def test_far_jig_gives_no_spots(sensor: Sensor) -> None:
    frame = render(Scene(sensor, Jig.nominal(), Pose(np.eye(3), np.array([-50.0, 900, 300]))), CLEAN_16BIT)
    pinned(frame)
    assert all(s.visible_fraction == 0 for s in frame.truth.strings)
