"""Tests on images: the stripe of rendered panels, measured through the sensor's file."""

from __future__ import annotations

import shutil
from pathlib import Path

import numpy as np
import pytest

from assets import path as asset
from geometry import Pose
from perceptron_emu import EmulatorConfig, Scene, render
from perceptron_emu.solids import PanelPair
from tests.workbench.helpers import Cli
from workbench.files import read_sensor, write_png

SENSOR = asset("sensors", "nominal")
STRAIGHT_MM = 0.1  # six σ of a matte face's points without speckle


@pytest.fixture(scope="module")
def pictures(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A frame of two flat panels, twice, and one that was cut short."""
    folder = tmp_path_factory.mktemp("panels")
    pose = Pose(np.eye(3), np.array([0, 0, 300.0]))
    config = EmulatorConfig.model_validate({"exposure": {"time_ms": 0.3}, "speckle": {"enabled": False}})
    scene = Scene(read_sensor(SENSOR), None, solids=PanelPair(4.0, 0.8).solids(pose))
    write_png(folder / "a.png", render(scene, config, np.random.default_rng(1)).image)
    shutil.copy(folder / "a.png", folder / "b.png")
    (folder / "c.png").write_bytes((folder / "a.png").read_bytes()[:2000])
    return folder


def test_straightness_of_a_face_in_images(cli: Cli, pictures: Path) -> None:
    asked = ("accept", "flatness", pictures, "--sensor", SENSOR, "--max-flatness-mm", STRAIGHT_MM)
    result = cli(*asked, "--form-mm", 0.001, "--json")
    assert result.code == 0, result.err
    assert 0.005 < result.json["figures"]["straightness"]["value"] < STRAIGHT_MM
    assert [line["profile"] for line in result.json["lines"]] == ["a", "b"]
    assert "c.png" in result.err
    assert "left out" in result.err


def test_an_image_needs_its_sensor(cli: Cli, pictures: Path) -> None:
    result = cli("accept", "flatness", pictures / "a.png")
    assert result.code == 2
    assert "--sensor" in result.err
