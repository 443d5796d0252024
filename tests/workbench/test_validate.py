"""`validate`: figures on rendered frames and on a dataset, thresholds as exit codes, the bound against theory."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from geometry import Camera, Pose, Sensor, Sheet
from perceptron_emu import EmulatorConfig, Scene
from tests.workbench.helpers import Cli
from tests.workbench.test_twin import small_sensor
from workbench.files import sensor_text
from workbench.validate import figures
from workbench.validate.bound import DETECTABLE_SNR, best_snr, position_bound_px
from workbench.validate.measure import MeasuredFrames

GOOD = "min_detection_rate = 0.9\nmax_false_rate = 0.02\nmax_mislabel_rate = 0.02\nmax_bias_z_mm = 0.05\n"


def test_rendered_frames(cli: Cli, tmp_path: Path) -> None:
    """Few frames: what they show is checked loosely, benchmarks print the real figures."""
    (tmp_path / "thresholds.toml").write_text(GOOD)
    out = tmp_path / "out"
    call = ("validate", "--frames", 6, "--out", out, "--json", "--thresholds", tmp_path / "thresholds.toml")
    result = cli(*call)
    assert result.code == 0, result.err
    figures = result.json["figures"]
    assert figures["frames"] == 6
    assert figures["scatter_y_mm"] < figures["scatter_z_mm"] < 0.06
    assert 0.5 < figures["sigma_ratio"] < 2
    assert figures["bound_ratio"] > 1
    rows = list(csv.DictReader((out / "strings.csv").read_text().splitlines()))
    assert len(rows) == 2 * 6 * 5
    assert len((out / "frames.csv").read_text().splitlines()) == 1 + 2 * 6
    assert abs(figures["bias_u_px"]) < 0.1
    html = (out / "report.html").read_text(encoding="utf-8")
    assert "All 4 thresholds hold" in html
    assert "http" not in html.replace("http-equiv", "")


def test_drawn_sensors_err_as_their_file_says(cli: Cli, tmp_path: Path) -> None:
    """Six sensors tell a grossly wrong σ only; with the random part alone the ratio would be a hundredth."""
    sensor, out = tmp_path / "sensor.toml", tmp_path / "out"
    nominal = (Path(__file__).parents[2] / "assets" / "sensors" / "nominal.toml").read_text()
    sensor.write_text(nominal + '[uncertainty]\nsource = "drawing"\n')
    call = ("validate", "--sensor", sensor, "--frames", 2, "--out", out, "--json")
    result = cli(*call, "--draw-sensor", 6)
    assert result.code == 0, result.err
    figures = result.json["figures"]
    assert figures["sensors"] == 6
    assert figures["sensor_rms_z_mm"] > 10 * figures["scatter_z_mm"]
    assert 0.4 < figures["sensor_sigma_ratio"] < 2.5
    rows = list(csv.DictReader((out / "drawn_sensors.csv").read_text().splitlines()))
    assert {r["sensor"] for r in rows} == {str(i) for i in range(6)}
    assert "sensors drawn from" in (out / "report.html").read_text(encoding="utf-8")
    sensor.write_text(nominal)
    refused = cli(*call, "--draw-sensor", 6)
    assert refused.code == 2
    assert "states no [uncertainty]" in refused.err


def test_a_dataset_fails_an_impossible_threshold(cli: Cli, recording: Path, tmp_path: Path) -> None:
    (tmp_path / "thresholds.toml").write_text("max_scatter_y_mm = 1e-6\nmin_detection_rate = 0.5\n")
    thresholds = ("--thresholds", tmp_path / "thresholds.toml", "--out", tmp_path / "out")
    result = cli("validate", recording, "--json", *thresholds)
    assert result.code == 1
    assert result.json["failed"] == ["max_scatter_y_mm"]
    assert "max_scatter_y_mm" in result.err
    assert result.json["figures"]["mislabel_rate"] == 0


def test_bad_input(cli: Cli, dataset: Path, tmp_path: Path) -> None:
    (tmp_path / "thresholds.toml").write_text("min_detection = 0.9\n")
    result = cli("validate", dataset, "--thresholds", tmp_path / "thresholds.toml", "--out", tmp_path / "out")
    assert result.code == 2
    assert "min_detection_rate" in result.err
    (dataset / "truth.json").unlink()
    result = cli("validate", dataset, "--out", tmp_path / "out")
    assert result.code == 2
    assert "truth" in result.err


@pytest.mark.parametrize("sigma", [1.0, 1.6])
def test_bound_of_a_gaussian_spot(sigma: float) -> None:
    """Shot noise alone: the bound of a round Gaussian of N photo-electrons is σ / √N."""
    n, size, centre = 1e4, 64, 31.8
    profile = np.exp(-((np.arange(size) - centre) ** 2) / (2 * sigma**2))
    electrons = n * np.outer(profile, profile) / profile.sum() ** 2
    noise = {"read_noise_e": 0.0, "gain_dn_per_e": 1.0, "full_well_e": 1e9}
    config = EmulatorConfig.model_validate({"noise": noise})
    pose = Pose(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]), np.array([100.0, 0, 0]))
    scene = Scene(Sensor(Sheet(), Camera(size, size, 100, 100, 32, 32, pose, bit_depth=16)))
    bound = position_bound_px(electrons, np.array([centre, centre]), config, scene)
    assert bound == pytest.approx(sigma / np.sqrt(n), rel=0.03)  # quantisation adds a little


def test_the_best_ratio_is_what_a_filter_of_the_own_shape_reaches() -> None:
    """The filter's answer over many noises against its scatter without a spot: the formula by Monte Carlo."""
    rng = np.random.default_rng(3)
    v, u = np.mgrid[:61, :61]
    spot = np.exp(-0.5 * ((u - 30.0) ** 2 + (v - 30.0) ** 2) / 1.4**2)
    config = EmulatorConfig.model_validate({"noise": {"read_noise_e": 12.0, "gain_dn_per_e": 1.0}})
    background, read = 40.0, 12.0
    pose = Pose(np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]]), np.array([100.0, 0, 0]))
    scene = Scene(Sensor(Sheet(), Camera(61, 61, 100, 100, 30, 30, pose, bit_depth=16)))
    for height in (4.0, 25.0):
        light = height * spot
        ratio = best_snr(light + background, np.array([30.2, 29.9]), config, scene)
        noise = rng.poisson(background, (800, 61, 61)) - background + rng.normal(0, read, (800, 61, 61))
        dark = np.einsum("nij,ij->n", np.rint(noise), light)
        assert ratio == pytest.approx(np.sum(light * light) / dark.std(), rel=0.08)
    assert best_snr(np.full((61, 61), background), np.array([30.0, 30.0]), config, scene) == 0
    assert np.isnan(best_snr(light, np.array([-50.0, 30.0]), config, scene))


def test_a_string_that_no_detector_sees_is_not_asked_for() -> None:
    row = {"nominal": True, "visible": True, "found": True, "flag": "x"}
    strings = [
        row | {"detectable": True},
        row | {"detectable": True, "found": False},
        row | {"detectable": False, "found": False},
        row | {"detectable": False},
    ]
    told = figures(MeasuredFrames(strings, []))
    assert told["detection_rate"] == 0.5
    assert told["too_faint"] == 2
    assert 8 < DETECTABLE_SNR < 9  # Φ⁻¹(1 - 1e-7) + Φ⁻¹(0.999)


def test_validate_tells_of_a_twins_strings_and_stripes(cli: Cli, tmp_path: Path) -> None:
    twin, out = tmp_path / "twin.toml", tmp_path / "v"
    emulator = EmulatorConfig.model_validate({"speckle": {"contrast": 0.3}})
    twin.write_text(sensor_text(small_sensor(), emulator), encoding="utf-8")
    limits = tmp_path / "limits.toml"
    limits.write_text("min_stripe_found_rate = 0.7\nmax_stripe_scatter_mm = 0.001\n", encoding="utf-8")
    result = cli("validate", "--twin", twin, "--frames", 2, "--out", out, "--thresholds", limits)
    assert result.code == 1
    assert "max_stripe_scatter_mm = 0.001 not held" in result.err
    assert "min_stripe_found_rate" not in result.err
    assert "On a matte plate" in result.out
    assert "On a matte plate" in (out / "report.html").read_text(encoding="utf-8")
    figures = json.loads((out / "result.json").read_text(encoding="utf-8"))["figures"]
    assert figures["stripe_wrong_rate"] == 0
    assert abs(figures["stripe_bias_mm"]) < figures["stripe_scatter_mm"] < 0.5
    assert 0.5 < figures["stripe_sigma_ratio"] < 2
