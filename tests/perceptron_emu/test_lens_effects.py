"""Effects that are off by default, each against its closed form."""

import numpy as np
import pytest

from geometry import InputError, Pose, Sensor
from perceptron_emu import EmulatorConfig, Material, Scene, mean_electrons, panel, render
from perceptron_emu.lens import focal_length_mm
from perceptron_emu.light.subsurface import line_spread, spread_mm
from tests.pinned import pinned

from .conftest import make_sensor

TILT = 35.0


def config(**tables: dict[str, object]) -> EmulatorConfig:
    return EmulatorConfig.model_validate(tables).off("noise", "speckle", "ambient")


def stripe(scene: Scene, c: EmulatorConfig, rows: slice = slice(0, None)) -> np.ndarray:
    """Mean electrons across a stripe along the image's rows, summed along it."""
    return mean_electrons(scene, c)[rows].sum(1, dtype=float)


def plate(material: Material, tilt: float = 0.0, sensor: Sensor | None = None) -> Scene:
    place = Pose.from_fixed_xyz_deg([0, tilt, 0], [0, 0, 300.0])
    return Scene(sensor or make_sensor(), solids=(panel(60, 60, place, material, "plate"),))


def moments(profile: np.ndarray) -> tuple[float, float]:
    x = np.arange(len(profile))
    middle = np.sum(profile * x) / profile.sum()
    return float(middle), float(np.sum(profile * (x - middle) ** 2) / profile.sum())


def test_the_line_spread_has_the_variance_of_its_formula() -> None:
    """∫ x² (K₀(x/d) + K₀(x/3d)) dx / (4πd) over all x is 7d²."""
    place, share = line_spread()
    assert share.sum() == pytest.approx(1, rel=1e-12)
    assert np.sum(share * place**2) == pytest.approx(7, rel=0.02)


def test_light_from_below_widens_and_moves_the_stripe_as_its_formula_says() -> None:
    solid, deep = (plate(Material(0.8, scatter_mm=s), TILT) for s in (0.0, 0.3))
    sensor = solid.sensor
    (m0, v0), (m1, v1) = (moments(stripe(s, config(laser={"divergence": False}))) for s in (solid, deep))
    # millimetres of surface across the stripe, to rows of the image
    along = np.array([np.cos(np.deg2rad(TILT)), 0, -np.sin(np.deg2rad(TILT))])
    scale = rows_a_mm(sensor, along)
    d = spread_mm(Material(0.8, scatter_mm=0.3))
    assert v1 - v0 == pytest.approx(7 * d**2 * scale**2, rel=0.06)
    refracted = np.sin(np.deg2rad(TILT)) / 1.5
    shift = 0.3 * refracted / np.sqrt(1 - refracted**2)
    assert abs(m1 - m0) == pytest.approx(shift * scale, rel=0.06)


def rows_a_mm(sensor: Sensor, along: np.ndarray) -> float:
    pose, camera = sensor.camera.T_sensor_camera, sensor.camera
    ends = (np.array([[0, 0, 300.0]]) + 0.5 * np.outer([-1, 1], along) - pose.t) @ pose.R
    v = camera.fy_px * ends[:, 1] / ends[:, 2]
    return float(abs(v[1] - v[0]))


def test_scatter_keeps_the_light_and_leaves_gloss_alone() -> None:
    solid, deep = (plate(Material(0.5, scatter_mm=s)) for s in (0.0, 0.2))
    assert stripe(deep, config()).sum() == pytest.approx(stripe(solid, config()).sum(), rel=2e-3)
    with pytest.raises(InputError, match="scatter_mm") as refused:
        Material(0.5, scatter_mm=9.0)
    pinned(str(refused.value))


def test_veiling_glare_is_the_index_of_iso_9358() -> None:
    """A field of light with a black spot: what is seen in the spot is that part of the field's mean."""
    wall = panel(900, 900, Pose(np.eye(3), np.array([0.0, 0, 380])), Material(0.8))
    spot = panel(16, 16, Pose(np.eye(3), np.array([0.0, 0, 379])), Material(0.0))
    room = EmulatorConfig.model_validate({"exposure": {"laser_on": False}, "optics": {"vignetting": False}})
    veiled = room.model_copy(update={"optics": room.optics.model_copy(update={"veiling_glare": 0.03})})
    clear, seen = (mean_electrons(Scene(make_sensor(), solids=(wall, spot)), c) for c in (room, veiled))
    assert seen.sum(dtype=float) == pytest.approx(clear.sum(dtype=float), rel=1e-5)
    dark = clear < 1e-3 * clear.max()
    assert dark.sum() > 2000
    assert seen[dark].mean() == pytest.approx(0.03 * clear.mean(dtype=float), rel=1e-3)
    assert seen.max() == pytest.approx(0.97 * clear.max() + 0.03 * clear.mean(dtype=float), rel=1e-3)


def test_blur_grows_towards_the_corner() -> None:
    """Across the plate's stripe the variance is more by the field's own, to the fourth power of the distance."""
    sensor = make_sensor()
    scene = plate(Material(0.6), sensor=sensor)
    flat, curved = (mean_electrons(scene, config(optics=o)) for o in ({}, {"blur_corner_px": 3.0}))
    half = np.hypot(max(639.5, 640.5), max(511.5, 512.5))
    lit = np.flatnonzero(flat.sum(0) > 0.5 * flat.sum(0).max())
    for u in (lit[8], lit[len(lit) // 2], lit[-9]):
        (m, before), (_, after) = moments(flat[:, u].astype(float)), moments(curved[:, u].astype(float))
        distance2 = ((u - 639.5) ** 2 + (m - 511.5) ** 2) / half**2
        assert after - before == pytest.approx((9 - 0.81) * distance2**2, abs=0.01)
    with pytest.raises(InputError, match="blur_corner_px") as refused:
        render(scene, config(optics={"blur_corner_px": 0.5}))
    pinned(str(refused.value))


def test_an_edge_close_to_the_lens_dims_by_degrees() -> None:
    """Half a plane before the lens: a point is seen by the part of the pupil, a disc, on the free side of it."""
    sensor = make_sensor()
    camera = sensor.camera
    optics = {"f_number": 2.0, "aperture_points": 200}
    scene = plate(Material(0.6), sensor=sensor)
    # an opaque strip 60 mm before the lens, its edge in the middle of the image, along v; not in the laser's way
    place = camera.T_sensor_camera @ Pose(np.eye(3), np.array([200.0, 0, 60.0]))
    blind = panel(400, 40, place, Material(0.0), "blind")
    free, sharp, soft = (
        mean_electrons(Scene(sensor, solids=solids), config(optics=o)).sum(0, dtype=float)
        for solids, o in (
            (scene.solids, optics),
            ((*scene.solids, blind), {"f_number": 2.0}),
            ((*scene.solids, blind), optics),
        )
    )
    lit = free > 0.5 * free.max()
    assert np.ptp((sharp / np.maximum(free, 1))[lit]) > 0.9
    radius = focal_length_mm(config(optics=optics).optics, sensor) / 2.0 / 2
    depth = float((camera.T_sensor_camera.inverse() @ np.array([[0.0, 0, 300]]))[0, 2])
    x = (np.arange(len(free)) - camera.cx_px) / camera.fx_px * depth  # of the plate's points, in the camera's axes
    # the line from a point to the pupil's (p, q) passes the edge x = 0 at 60 mm where p = −x · 60/(depth − 60)
    cut = np.clip(-x * 60 / (depth - 60) / radius, -1, 1)
    share = (np.arccos(-cut) + cut * np.sqrt(1 - cut**2)) / np.pi
    seen = (soft / np.maximum(free, 1))[lit]
    assert np.max(np.abs(seen - share[lit])) < 0.03
