"""`init`, `datasheet` and `render --profiles`: what is emulated in a maker's format is calibrated to its truth."""

from __future__ import annotations

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from geometry import Pose
from tests.workbench.helpers import Cli
from workbench.files import read_sensor

NEES_LIMIT = 30.0  # a sound covariance exceeds it in 4 of 100,000 runs
SHEET = [f"--{k}={v}" for k, v in {"clearance-mm": 190, "range-mm": 210, "near-mm": 96, "far-mm": 194}.items()]
SHEET += ["--points=640", "--repeatability-mm=0.002"]


def squared_error(answer: dict, folder: Path) -> float:
    truth = Pose.from_matrix(np.array(json.loads((folder / "truth.json").read_text())["T_hand_sensor"]), 1e-6)
    error = (Pose.from_matrix(np.array(answer["T_hand_sensor"]), 1e-6).inverse() @ truth).log()
    return float(error @ np.linalg.solve(np.array(answer["covariance"]), error))


def test_a_sensor_of_a_data_sheet_measures_what_it_says(cli: Cli, tmp_path: Path) -> None:
    path = tmp_path / "sensor.toml"
    assert cli("datasheet", path, *SHEET, "--name", "some profiler").code == 0
    sensor = read_sensor(path)
    assert sensor.profile is not None
    field = sensor.profile.field_of_view_mm
    np.testing.assert_allclose(sorted(field[:, 1]), [190, 190, 400, 400], rtol=0, atol=1e-9)
    assert np.ptp(field[:, 0]) == 194
    assert sensor.profile.pitch_mm == pytest.approx(194 / 639, abs=1e-5)
    # both borders of the field pass through the emitter
    y, z = sensor.sheet.origin_mm[1:]
    near, far = (48 - y) / (190 - z), (97 - y) / (400 - z)
    assert near == pytest.approx(far, abs=1e-3)
    refused = cli("datasheet", path, *[a.replace("=194", "=94") for a in SHEET])
    assert refused.code == 2
    assert "the fan opens with depth" in refused.err


@pytest.mark.parametrize(
    ("target", "form"), [("sphere", "gocator"), ("wedge", "keyence_csv"), ("plane", "keyence_lj_x")]
)
def test_what_is_rendered_is_calibrated_to_its_truth(cli: Cli, tmp_path: Path, target: str, form: str) -> None:
    cli("datasheet", tmp_path / "s.toml", *SHEET)
    assert cli("init", tmp_path / "plan", "--target", target, "--sensor", tmp_path / "s.toml").code == 0
    out = tmp_path / "out"
    made = cli("render", tmp_path / "plan", "--out", out, "--profiles", form, "--per-location", 8, "--seed", 2)
    assert made.code == 0, made.err
    assert tomllib.loads((out / "sensor.toml").read_text())["profile"]["format"] == form
    first = {p.name: p.read_bytes() for p in (out / "profiles").iterdir()}
    again = tmp_path / "again"
    cli("render", tmp_path / "plan", "--out", again, "--profiles", form, "--per-location", 8, "--seed", 2)
    assert first == {p.name: p.read_bytes() for p in (again / "profiles").iterdir()}
    outcome = cli("calibrate", out, "--model", "full", "--json")
    assert outcome.code == 0, outcome.err
    assert squared_error(outcome.json, out) < NEES_LIMIT
    assert outcome.json["locations"]["D"]["target"]["kind"] == target
    assert not [n for n in outcome.json["notes"] if "T_base_jig" in n]


def test_a_camera_sensors_field_becomes_a_profilers(cli: Cli, tmp_path: Path) -> None:
    assert cli("init", tmp_path / "plan", "--target", "plane", "--sensor", "lmi_gocator_2340").code == 0
    made = cli("render", tmp_path / "plan", "--out", tmp_path / "out", "--profiles", "ply", "--per-location", 2)
    assert made.code == 0, made.err
    sensor = read_sensor(tmp_path / "out" / "sensor.toml")
    assert sensor.camera is None
    assert sensor.profile.field_of_view_mm[:, 1].min() == pytest.approx(190, abs=0.1)
    assert "can not be written" in cli("render", tmp_path / "plan", "--out", tmp_path / "x", "--profiles", "sick").err


def test_unknown_targets_are_refused(cli: Cli, tmp_path: Path) -> None:
    outcome = cli("init", tmp_path / "plan", "--target", "spere")
    assert outcome.code == 2
    assert 'did you mean "sphere"' in outcome.err
