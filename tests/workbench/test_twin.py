"""The twin: keys found again from emulated images, bad input by name.

What it does not prove: that the σ hold over many sensors (benchmarks/twin_recovery.py draws them).
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from extraction import StripeConfig
from geometry import Camera, InputError, Pose, Sensor, Sheet
from perceptron_emu import EmulatorConfig, Material, Scene, panel, render
from tests.workbench.helpers import Cli
from workbench.files import read_emulator, sensor_text, write_png
from workbench.twin import find_images, fit, fit_twin, twin_object
from workbench.twin.seen import Look, see, usual_width_px

SIGMAS = 4.0
ROTATION = np.array([[0, -0.924016832, -0.382351793], [1, 0, 0], [0, -0.382351793, 0.924016832]])


def small_sensor(black_level: float = 9.0) -> Sensor:
    u, _, vt = np.linalg.svd(ROTATION)
    camera = Camera(
        400, 320, 1150.0, 1150.0, 199.5, 159.5, Pose(u @ vt, np.array([120.0, 0, 0])), black_level=black_level
    )
    return Sensor(Sheet(fan_rad=float(np.deg2rad(44))), camera)


def stripes(sensor: Sensor, config: EmulatorConfig, count: int) -> list[tuple[str, np.ndarray]]:
    rng = np.random.default_rng(5)
    out = []
    for k in range(count):
        pose = Pose.from_fixed_xyz_deg([8.0 - 8 * k, 6.0, 90], [0, 0, 290.0 + 2 * k])
        scene = Scene(sensor, solids=(panel(140, 24, pose, Material(0.6)),))
        out.append((f"{k}.png", render(scene, config, rng).image))
    return out


def test_a_twin_finds_the_keys_that_its_images_were_made_with(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fit, "ITERATIONS", 3)
    monkeypatch.setattr(fit, "LAST_STEPS", 2)
    monkeypatch.setattr(fit, "DRAWS", 2)
    keys = {
        "laser": {"power_mw": 5.0}, "optics": {"blur_px": 1.3, "f_number": 6.0}, "speckle": {"contrast": 0.4},
        "noise": {"read_noise_e": 25.0},
    }  # fmt: skip
    made = EmulatorConfig.model_validate(keys)
    images = stripes(small_sensor(), made, 3)
    twin = fit_twin(images, small_sensor(0.0), EmulatorConfig(), 1, lambda done, total: None)
    found = {k.name: k for k in twin.keys}
    for table, values in keys.items():
        for name, value in values.items():
            assert abs(found[name].value - value) < SIGMAS * found[name].sigma, (table, name)
    assert found["black_level"].value == pytest.approx(9.0, abs=0.1)
    assert found["blur_px"].sigma < 0.15
    assert found["contrast"].sigma < 0.15
    assert found["gain_dn_per_e"].sigma < 0.4 * found["gain_dn_per_e"].value  # noise beside the stripe against darkness
    assert twin.chi2_per_dof < 2.5
    answer = twin_object(twin)
    assert answer["distances"]["width_px"] < 0.3
    assert answer["n_images"] == 3


def test_images_without_laser_and_of_another_sensor_are_refused(tmp_path: Path) -> None:
    sensor = small_sensor()
    dark = EmulatorConfig.model_validate({"exposure": {"laser_on": False}})
    with pytest.raises(InputError, match="none of the 1 images shows a laser stripe"):
        fit_twin(stripes(sensor, dark, 1), sensor, EmulatorConfig(), 0, lambda *_: None)
    narrow = Sensor(Sheet(origin_mm=np.array([0.0, 150.0, 0.0]), fan_rad=0.1), sensor.require_camera())
    with pytest.raises(InputError, match="another sensor's images"):
        fit_twin(stripes(sensor, EmulatorConfig(), 1), narrow, EmulatorConfig(), 0, lambda *_: None)
    with pytest.raises(InputError, match="no images in it"):
        find_images(tmp_path)
    with pytest.raises(InputError, match="no such folder"):
        find_images(tmp_path / "none")


def test_validate_wants_a_twin_where_it_is_told_of_one(cli: Cli, tmp_path: Path) -> None:
    file = tmp_path / "sensor.toml"
    file.write_text(sensor_text(small_sensor(), EmulatorConfig()), encoding="utf-8")
    result = cli("validate", "--twin", file, "--out", tmp_path / "v")
    assert result.code == 2
    assert "is no twin" in result.err


def test_the_command_writes_a_sensor_file_and_a_page(cli: Cli, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fit, "ITERATIONS", 1)
    monkeypatch.setattr(fit, "LAST_STEPS", 1)
    monkeypatch.setattr(fit, "DRAWS", 1)
    sensor = small_sensor()
    (tmp_path / "sensor.toml").write_text(sensor_text(sensor, EmulatorConfig()), encoding="utf-8")
    for name, image in stripes(sensor, EmulatorConfig(), 1):
        write_png(tmp_path / name, image)
    out, page = tmp_path / "twin.toml", tmp_path / "twin.html"
    result = cli("twin", tmp_path, "--sensor", tmp_path / "sensor.toml", "--out", out, "--report", page, "--json")
    assert result.code == 0, result.err
    assert len(result.json["keys"]) == 10
    assert read_emulator(out).speckle.contrast is not None
    assert "two-sample distance" in page.read_text(encoding="utf-8")


def test_clipped_stripes_are_told_by_their_flanks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(fit, "ITERATIONS", 2)
    monkeypatch.setattr(fit, "LAST_STEPS", 1)
    monkeypatch.setattr(fit, "DRAWS", 1)
    sensor = small_sensor()
    bright = EmulatorConfig.model_validate({"laser": {"power_mw": 30.0}})
    twin = fit_twin(stripes(sensor, bright, 2), sensor, EmulatorConfig(), 0, lambda *_: None)
    assert twin.clipped
    assert sum(len(s.profile) for s in twin.recorded) > 500
    widths = [
        np.median(np.concatenate([s.profile.peaks.width_px for s in seen])) for seen in (twin.recorded, twin.emulated)
    ]
    assert widths[1] == pytest.approx(widths[0], rel=0.15)


def test_a_lit_rim_is_no_stripe() -> None:
    rows, columns = np.mgrid[:320, :400].astype(float)
    stripe = 90 * np.exp(-((rows - 100 - 0.02 * columns) ** 2) / (2 * 1.6**2)) * (columns < 190)
    rim = 40 * np.exp(-((rows - 250) ** 2) / (2 * 3.6**2)) * (columns > 210)
    image = np.clip(np.random.default_rng(2).normal(stripe + rim + 12, 0.8) + 0.5, 0, 255).astype(np.uint8)
    every = see(image, small_sensor(), StripeConfig(), Look())
    assert np.any(every.profile.peaks.section > 210)
    usual = usual_width_px([every])
    assert usual == pytest.approx(1.6, abs=0.1)
    laser = see(image, small_sensor(), StripeConfig(), Look(width_px=usual))
    assert len(laser.profile) > 150
    assert np.all(laser.profile.peaks.section < 200)
