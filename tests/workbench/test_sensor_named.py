"""Sensors by a preset's name wherever a sensor.toml is taken, and a region that was drawn for another image."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from extraction.stripe.pictures import draw
from geometry import InputError
from workbench.accept.recorded import ProfileRecording, read_recorded
from workbench.cell import ProfileSource, read_profile
from workbench.cli.main import run

FAR = "[region]\nkeep = [[[3000, 3000], [4000, 3000], [4000, 4000]]]\n"


@pytest.fixture
def picture(tmp_path: Path) -> Path:
    """A straight stripe as the nominal sensor's image."""
    light = np.zeros((1024, 1280))
    light[:, 100:1200] = 150 * np.exp(-0.5 * ((np.arange(1024) - 502.3) / 1.8) ** 2)[:, None]
    image = np.rint(light + np.random.default_rng(2).normal(10, 1, light.shape)).clip(0, 255).astype(np.uint8)
    path = tmp_path / "stripe.png"
    cv2.imwrite(str(path), image)
    return path


def test_a_preset_is_a_sensor(picture: Path) -> None:
    assert len(read_profile(ProfileSource(picture, Path("nominal")))) > 1000
    assert len(read_recorded(ProfileRecording((picture,), sensor=Path("nominal"))).profiles) == 1
    with pytest.raises(InputError, match="no preset"):
        read_profile(ProfileSource(picture, Path("nominall")))


def test_a_region_of_another_image_is_the_reason(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Nothing is looked at: the sentence speaks of the region, not of the stripe's parameters."""
    cv2.imwrite(str(tmp_path / "a.png"), draw("beside_a_border", np.random.default_rng(1)).image)
    (tmp_path / "far.toml").write_text(FAR)
    made = run(["profile", str(tmp_path / "a.png"), "--recipe", str(tmp_path / "far.toml"), "--json"])
    said = capsys.readouterr()
    assert made in (0, 1, 3)
    assert "mask and region leave none" in said.out + said.err
