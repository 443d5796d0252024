"""Light scattered by two surfaces: against the mirrored plane, an integral done otherwise, and what must not change.

What they do not prove: the BRDFs together with shadows in whole scenes; benchmarks/perceptron_emu_bounces.py compares
ten with a path tracer.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from trimesh.creation import cylinder

from geometry import InputError, Pose
from perceptron_emu import EmulatorConfig, Material, Scene, Solid, mean_electrons, panel, project, render
from perceptron_emu.image.ghosts import pixel_rays
from perceptron_emu.light import Light
from tests.perceptron_emu.conftest import make_sensor
from tests.pinned import pinned

PLACE_ATOL_PX = 0.1  # of a mirrored line: the lobe is 12 px wide there
LIGHT_RTOL = 0.05
FINER_RTOL = 0.03  # the rims of a post 45 px wide are sampled at the middles of pixels
QUIET = {"laser": {"profile": "uniform", "divergence": False, "power_mw": 50.0}, "optics": {"vignetting": False}}


def configs() -> tuple[EmulatorConfig, EmulatorConfig]:
    once = EmulatorConfig.model_validate(QUIET).off("noise", "speckle", "ambient")
    return once, once.model_copy(update={"light": once.light.model_copy(update={"bounces": True})})


def ghost_of(scene: Scene, with_configs: Sequence[EmulatorConfig] | None = None) -> np.ndarray:
    once, twice = (mean_electrons(scene, c).astype(float) for c in with_configs or configs())
    return twice - once


def mirror_and_wall() -> tuple[Scene, Pose, Pose]:
    """A nearly perfect mirror that throws the sheet aside, on a matte wall that the laser does not reach."""
    mirror = Pose.from_fixed_xyz_deg([-50.0, 4.0, 0.0], [0, 14.0, 300.0])
    wall = Pose.from_fixed_xyz_deg([80.0, 0.0, 0.0], [0, -9.0, 297.0])
    solids = (
        panel(30, 6, mirror, Material(0.0, 0.9, 0.02), "mirror"),
        panel(30, 30, wall, Material(0.8), "wall"),
    )
    return Scene(make_sensor(), solids=solids), mirror, wall


def test_a_mirrored_sheet_falls_where_the_mirrored_plane_meets_the_wall() -> None:
    scene, mirror, wall = mirror_and_wall()
    ghost = ghost_of(scene)
    assert ghost.max() > 5
    n = mirror.R[:, 2]
    plane = np.array([1.0, 0, 0]) - 2 * n[0] * n  # the sheet's normal, mirrored; the mirror's middle lies in the sheet
    along = np.cross(plane, wall.R[:, 2])
    rows = np.vstack([plane, wall.R[:, 2], along])
    foot = np.linalg.solve(rows, [plane @ mirror.t, wall.R[:, 2] @ wall.t, along @ wall.t])
    line = project(scene.sensor, foot + np.outer([-5.0, 5.0], along / np.linalg.norm(along)))
    across = np.array([line[1, 1] - line[0, 1], line[0, 0] - line[1, 0]])
    across /= np.linalg.norm(across)
    v, u = np.nonzero(ghost > 0.3 * ghost.max())
    weight = ghost[v, u]
    off = (np.column_stack([u, v]) - line[0]) @ across
    assert abs((weight * off).sum() / weight.sum()) < PLACE_ATOL_PX


def test_the_glow_of_a_stripe_on_a_matte_wall_is_the_line_lamps() -> None:
    """Two matte panels: the light on one of the other's stripe by an integral over a line lamp."""
    floor = Pose.from_fixed_xyz_deg([0, 0, 90.0], [0, 0, 310.0])
    wall = Pose.from_fixed_xyz_deg([0.0, 90.0, 0], [-9.0, 0, 302.0])  # beside the sheet, facing it
    scene = Scene(
        make_sensor(),
        solids=(panel(60, 40, floor, Material(0.5), "floor"), panel(12, 30, wall, Material(0.6), "wall")),
    )
    once, _ = configs()
    ghost = ghost_of(scene)
    path = Light(scene.sensor, once).path
    for z, y in ((300.0, 0.0), (304.0, 6.0), (306.0, -4.0)):
        point = np.array([-9.0, y, z])
        lamp_y = np.linspace(-30, 30, 6001)
        lamp = np.column_stack([0 * lamp_y, lamp_y, 0 * lamp_y + 310.0])
        s = np.hypot(lamp[:, 1], 310.0)
        power = path.scale / scene.sensor.sheet.fan_rad / s * 310.0 / s  # a mm of floor: E s dφ, dφ = cos θ dy / s
        way = lamp - point
        r2 = (way**2).sum(1)
        lit = (power * 0.5 / np.pi * (310.0 - z) * 9.0 / r2**2).sum() * (lamp_y[1] - lamp_y[0])
        u, v = np.round(project(scene.sensor, point)).astype(int)
        expected = lit * 0.6 / np.pi * pixel_rays(scene.sensor, once.optics, 660.0).of_radiance[v, u]
        assert ghost[v, u] == pytest.approx(expected, rel=LIGHT_RTOL, abs=0.3)


def test_ghosts_are_the_same_however_fine_the_pixels_are() -> None:
    """Rims of a post and of its shadow included: squares of pixels are halved there, and light is taken over."""
    wall = Pose.from_fixed_xyz_deg([0, 4, 90.0], [0, 0, 312.0])
    post = Solid(
        cylinder(3.0, 40.0, sections=48), Material(0.1, 0.8, 0.2), Pose.from_fixed_xyz_deg([0, 90, 0], [0, 8.0, 298.0])
    )
    scene = Scene(make_sensor(), solids=(post, panel(120, 60, wall, Material(0.6), "wall")))
    strong = {"power_mw": 5000.0}  # so that nothing is left out for being faint
    once, twice = (c.model_copy(update={"laser": c.laser.model_copy(update=strong)}) for c in configs())
    camera, n = scene.camera, 2
    optics = once.optics.model_copy(update={"pixel_um": once.optics.pixel_um / n, "blur_px": once.optics.blur_px * n})
    fine_sensor = scene.sensor.with_camera(
        width_px=n * camera.width_px, height_px=n * camera.height_px, fx_px=n * camera.fx_px, fy_px=n * camera.fy_px,
        cx_px=n * (camera.cx_px + 0.5) - 0.5, cy_px=n * (camera.cy_px + 0.5) - 0.5,
    )  # fmt: skip
    fine = Scene(fine_sensor, solids=scene.solids)
    fine_ghost = ghost_of(fine, [c.model_copy(update={"optics": optics}) for c in (once, twice)])
    summed = fine_ghost[::2, ::2] + fine_ghost[1::2, ::2] + fine_ghost[::2, 1::2] + fine_ghost[1::2, 1::2]
    ghost = ghost_of(scene, [once, twice])
    assert ghost.sum() == pytest.approx(summed.sum(), rel=FINER_RTOL)
    assert np.abs(ghost - summed).mean() < FINER_RTOL * ghost.mean()


def test_light_that_does_not_bounce_costs_nothing_and_changes_nothing() -> None:
    scene, *_ = mirror_and_wall()
    once, _ = configs()
    alone = Scene(scene.sensor, solids=scene.solids[1:])
    assert np.array_equal(mean_electrons(alone, once), mean_electrons(alone, configs()[1]))
    assert not EmulatorConfig().light.bounces


def test_ghosts_have_their_own_label() -> None:
    scene, *_ = mirror_and_wall()
    _, twice = configs()
    truth = render(scene, twice, full_truth=True).truth
    pinned(truth)
    assert truth.label_names[-1] == "ghost"
    where = truth.labels == len(truth.label_names) - 1
    ghost = ghost_of(scene)
    assert where.sum() > 100
    assert ghost[where].min() > 0.9


@pytest.mark.parametrize("values", [(0.6, 0.5, 0.2), (1.0, 0.1, 0.2)])
def test_materials_that_send_back_more_light_than_they_get_are_refused(values: tuple[float, float, float]) -> None:
    with pytest.raises(InputError, match="more light than") as refused:
        Material(*values)
    pinned(str(refused.value))


def test_surfaces_that_keep_no_light_and_mirrors_that_face_the_laser_are_refused() -> None:
    _, twice = configs()
    white = panel(60, 40, Pose.from_fixed_xyz_deg([0, 0, 90.0], [0, 0, 300.0]), Material(1.0), "white")
    with pytest.raises(InputError, match="bounce without end") as refused:
        mean_electrons(Scene(make_sensor(), solids=(white,)), twice)
    pinned(str(refused.value))
    facing = panel(10, 40, Pose.from_fixed_xyz_deg([0, 0, 90.0], [0, 0, 300.0]), Material(0.0, 0.9, 0.02), "mirror")
    with pytest.raises(InputError, match="throws the laser back") as refused:
        mean_electrons(Scene(make_sensor(), solids=(facing,)), twice)
    pinned(str(refused.value))
