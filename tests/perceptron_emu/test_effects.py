"""Each effect against its own law: motion, shutter, HDR, laser off, defocus with tilt, fan, sheet, filter."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import Pose, Sensor, field_of_view
from perceptron_emu import EmulatorConfig, Scene, panel, render
from perceptron_emu.lens import defocus_radius_px, filter_transmission, focus_distance_mm, to_camera
from perceptron_emu.light import across, along, half_width_mm
from tests.perceptron_emu.conftest import make_sensor
from tests.pinned import pinned

PLAIN = {"ambient": {"enabled": False}, "speckle": {"enabled": False}}
CLEAN = PLAIN | {"noise": {"enabled": False, "full_well_e": 1e6}}


def config(**tables: dict[str, object]) -> EmulatorConfig:
    return EmulatorConfig.model_validate({k: CLEAN.get(k, {}) | tables.get(k, {}) for k in {*CLEAN, *tables}})


def spot_sigma_px(image: np.ndarray, black: float, uv: np.ndarray, half: int = 20) -> np.ndarray:
    u, v = np.round(uv).astype(int)
    patch = image[v - half : v + half + 1, u - half : u + half + 1] - black
    rows, columns = np.mgrid[-half : half + 1, -half : half + 1]
    weight = patch / patch.sum()
    mean = [(weight * columns).sum(), (weight * rows).sum()]
    return np.sqrt([(weight * columns**2).sum() - mean[0] ** 2, (weight * rows**2).sum() - mean[1] ** 2])


def test_motion_blur_has_the_length_of_the_way(scene: Scene) -> None:
    """A sensor that moves by L along its y draws a spot L·f/Z longer in u: its variance grows by that length²/12."""
    sharp_sensor = make_sensor(bit_depth=16)
    still = Scene(sharp_sensor, scene.jig, scene.T_sensor_jig)
    moving = config(motion={"velocity_mm_s": [0, 400, 0], "samples": 25}, exposure={"time_ms": 2.0})
    frames = [render(still, c) for c in (config(exposure={"time_ms": 2.0}), moving)]
    spots = [f.truth.strings[0] for f in frames]
    widths = [spot_sigma_px(f.image.astype(float), 10, s.image_px)[0] for f, s in zip(frames, spots, strict=True)]
    depth = to_camera(sharp_sensor, np.array([0, *spots[0].surface_mm]))[2]
    length_px = 400 * 2e-3 * sharp_sensor.camera.fx_px / depth
    assert np.sqrt(widths[1] ** 2 - widths[0] ** 2) == pytest.approx(length_px / np.sqrt(12), rel=0.02)
    np.testing.assert_allclose(spots[1].image_px, spots[0].image_px, rtol=0, atol=0.01)


def test_a_rolling_shutter_shears_the_picture(scene: Scene) -> None:
    """A row that is read later shows the scene moved further, by velocity times delay."""
    sensor = make_sensor(bit_depth=16)
    still = Scene(sensor, scene.jig, scene.T_sensor_jig)
    motion = {"velocity_mm_s": [0, 100, 0], "samples": 3}
    shutters = [
        config(motion=motion, exposure={"time_ms": 2.0, "shutter": s, "row_time_us": 10.0})
        for s in ("global", "rolling")
    ]
    straight, rolled = (render(still, c).truth.strings for c in shutters)
    for before, after in zip(straight, rolled, strict=True):
        delay_s = (before.image_px[1] - (sensor.camera.height_px - 1) / 2) * 10e-6
        depth = to_camera(sensor, np.array([0, *before.surface_mm]))[2]
        expected = -100 * delay_s * sensor.camera.fx_px / depth
        assert after.image_px[0] - before.image_px[0] == pytest.approx(expected, abs=0.02 * abs(expected) + 0.005)


def test_laser_off_shows_the_room_alone(scene: Scene) -> None:
    wall = panel(600, 600, Pose(np.eye(3), np.array([0.0, 0, 420])))
    both = Scene(scene.sensor, scene.jig, scene.T_sensor_jig, (wall,))
    dark = render(both, EmulatorConfig.model_validate({"exposure": {"laser_on": False}, "noise": {"enabled": False}}))
    pinned(dark)
    assert dark.image.max() < 40
    assert dark.image.min() >= 10
    assert np.ptp(dark.image) > 0


def test_hdr_keeps_the_faint_and_the_bright(scene: Scene) -> None:
    """The merged image is linear in light from one tenth of a grey level of the long exposure to the short one's full
    scale.
    """
    sensor = make_sensor(bit_depth=16, black_level=100.0)
    still = Scene(sensor, scene.jig, scene.T_sensor_jig)
    light = {"laser": {"power_mw": 40.0}, "noise": {"enabled": True, "full_well_e": 10_000, "adc_bits": 12}}
    hdr = config(**light, exposure={"time_ms": 2.0, "hdr_ratios": [0.25, 0.03]})
    single = config(**light, exposure={"time_ms": 2.0})
    merged, clipped = (render(still, c, np.random.default_rng(1)) for c in (hdr, single))
    truth = merged.truth.strings
    gain = 1.03 * (65535 - 100) / 10_000 * 0.03
    for string in truth:
        u, v = np.round(string.image_px).astype(int)
        patch = np.s_[v - 12 : v + 13, u - 12 : u + 13]
        assert (merged.image[patch].astype(float) - 100).sum() == pytest.approx(string.electrons * gain, rel=0.03)
    u, v = np.round(truth[0].image_px).astype(int)
    assert clipped.image[v - 3 : v + 4, u - 3 : u + 4].max() == 65535
    assert merged.image[v - 3 : v + 4, u - 3 : u + 4].max() < 65535


def scheimpflug_sensor() -> Sensor:
    """A sensor whose chip is tilted so that the sheet is in focus: tan τ = v/u · tan(angle of the sheet to the object
    plane).
    """
    plain = make_sensor()
    optics = EmulatorConfig().optics
    u = focus_distance_mm(optics, plain)
    v = (plain.camera.fx_px + plain.camera.fy_px) / 2 * optics.pixel_um * 1e-3
    axis = plain.camera.T_sensor_camera.R[:, 2]
    sheet_tilt = np.pi / 2 - np.arcsin(abs(axis[0]))
    tau = np.arctan(v / u * np.tan(sheet_tilt))
    for sign in (1, -1):
        sensor = make_sensor((0.0,) * 12 + (sign * float(tau), 0.0))
        if np.max(defocus_on_sheet(sensor)) < 2:
            return sensor
    raise AssertionError("neither tilt brings the sheet into focus")


def defocus_on_sheet(sensor: Sensor) -> np.ndarray:
    yz = np.stack(np.meshgrid(np.linspace(-40, 40, 5), np.linspace(240, 360, 7)), -1).reshape(-1, 2)
    xyz = np.column_stack([np.zeros(len(yz)), yz])
    optics = config(optics={"defocus": True, "f_number": 4.0}).optics
    return defocus_radius_px(optics, sensor, to_camera(sensor, xyz))


def test_scheimpflug_tilt_brings_the_whole_sheet_into_focus() -> None:
    """The thin lens and the tilted chip, written apart, obey Scheimpflug's rule; the untilted chip is badly out of
    focus.
    """
    assert np.max(defocus_on_sheet(make_sensor())) > 1.5
    assert np.max(defocus_on_sheet(scheimpflug_sensor())) < 0.05


def test_defocus_widens_a_spot_as_its_disc_does(scene: Scene) -> None:
    """A disc of radius R adds R²/4 to the variance in each direction."""
    sensor = make_sensor(bit_depth=16)
    still = Scene(sensor, scene.jig, scene.T_sensor_jig)
    optics: dict[str, object] = {"f_number": 8.0, "focus_distance_mm": 400.0}
    noise: dict[str, object] = {"full_well_e": 2e4}
    sharp, soft = (render(still, config(optics=optics | {"defocus": on}, noise=noise)) for on in (False, True))
    spot = sharp.truth.strings[0]
    lens = config(optics=optics | {"defocus": True}).optics
    radius = float(defocus_radius_px(lens, sensor, to_camera(sensor, np.array([0, *spot.surface_mm]))))
    widths = [spot_sigma_px(f.image.astype(float), 10, spot.image_px) ** 2 for f in (sharp, soft)]
    np.testing.assert_allclose(widths[1] - widths[0], radius**2 / 4, rtol=0.03)


@pytest.mark.parametrize("profile", ["powell", "gaussian", "uniform"])
def test_the_fan_holds_all_the_power(profile: str) -> None:
    laser = EmulatorConfig.model_validate({"laser": {"profile": profile, "edge_fraction": 0.6}}).laser
    angle = np.linspace(-0.6, 0.6, 200_001)
    density = along(laser, 0.8, angle)
    assert np.trapezoid(density, angle) == pytest.approx(1, rel=1e-4)
    if profile != "uniform":
        assert along(laser, 0.8, np.array([0.3999]))[0] / along(laser, 0.8, np.array([0.0]))[0] == pytest.approx(
            0.6, rel=1e-2
        )


def test_the_sheet_has_its_waist_where_configured() -> None:
    laser = EmulatorConfig.model_validate({"laser": {"waist_um": 100, "waist_distance_mm": 300, "m2": 1.0}}).laser
    rayleigh = np.pi * 0.1**2 / 660e-6
    width = half_width_mm(laser, make_sensor(), np.array([300.0, 300 + rayleigh, 300 - rayleigh]))
    np.testing.assert_allclose(width, [0.1, 0.1 * np.sqrt(2), 0.1 * np.sqrt(2)], rtol=1e-12)
    x = np.linspace(-1, 1, 20_001)
    assert np.trapezoid(across(x, np.float64(0.1)), x) == pytest.approx(1, rel=1e-9)


def test_the_filter_dims_slanted_laser_light_and_most_of_the_room() -> None:
    optics = EmulatorConfig.model_validate({"optics": {"filter_fwhm_nm": 10.0}}).optics
    cosine = np.cos(np.deg2rad([0.0, 10.0, 25.0]))
    transmission = filter_transmission(optics, 660.0, cosine, 660.0)
    assert transmission[0] == pytest.approx(optics.filter_peak)
    assert transmission[0] > transmission[1] > transmission[2]
    assert transmission[2] < 0.01


def test_full_truth_labels_and_curve(scene: Scene) -> None:
    """Labelled pixels stand where the light is; the curve lies on the wall and misses what the strings shade."""
    wall = panel(600, 600, Pose(np.eye(3), np.array([0.0, 0, 420])), name="wall")
    frame = render(Scene(scene.sensor, scene.jig, scene.T_sensor_jig, (wall,)), None, full_truth=True)
    pinned(frame)
    truth = frame.truth
    assert truth.labels is not None
    assert truth.curve is not None
    assert truth.label_names == ("", *scene.jig.strings, "wall") if scene.jig else False
    for i, string in enumerate(truth.strings):
        u, v = np.round(string.image_px).astype(int)
        assert truth.labels[v, u] == i + 1
    np.testing.assert_allclose(truth.curve.yz_mm[..., 1], 420, atol=1e-9)
    assert len(truth.curve.yz_mm) == len(scene.jig.strings) + 1 if scene.jig else False
    polygon = field_of_view(scene.sensor)
    assert polygon.shape[1] == 2
