"""What is known of a dataset's speckle: the grain by the optics that sensor.toml states, the rest learnt."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from extraction import MAX_GRAIN_PX, ExtractionConfig, SpotNoiseConfig
from geometry import Sensor
from workbench.cell import dataset_config, find_emulator, find_sensor, with_known_grain
from workbench.cell.speckle import frames_to_learn
from workbench.files import read_cell, read_image, read_sensor, sensor_text

# by hand: light of 660 nm at F/4 on pixels of 5.3 µm, the chip 12.19 mm behind the lens, the sheet 313.6 mm before it
NOMINAL_GRAIN_PX = 0.660 * 4.0 * (1.0 + 12.19 / 313.6) / 5.3


def _sensor(tmp_path: Path, old: str, new: str) -> Sensor:
    path = tmp_path / "sensor.toml"
    text = sensor_text(find_sensor("nominal"), find_emulator("nominal"))
    assert old in text
    path.write_text(text.replace(old, new), encoding="utf-8")
    return read_sensor(path)


def test_stated_optics_give_the_grain() -> None:
    noise = with_known_grain(find_sensor("nominal"), ExtractionConfig()).noise
    assert noise.speckle_grain_px == pytest.approx(NOMINAL_GRAIN_PX, rel=1e-3)
    assert noise.speckle_contrast is None


@pytest.mark.parametrize("line", ["wavelength_nm = 660.0\n", "pixel_um = 5.3\n", "f_number = 4.0\n"])
def test_optics_that_a_file_does_not_state_are_not_assumed(tmp_path: Path, line: str) -> None:
    sensor = _sensor(tmp_path, line, "")
    assert with_known_grain(sensor, ExtractionConfig()) == ExtractionConfig()


def test_a_given_grain_is_kept() -> None:
    given = ExtractionConfig(noise=SpotNoiseConfig(speckle_grain_px=0.9))
    assert with_known_grain(find_sensor("nominal"), given) == given


def test_a_coarse_grain_ends_where_pixels_can_not_tell(tmp_path: Path) -> None:
    sensor = _sensor(tmp_path, "f_number = 4.0", "f_number = 32.0")
    assert with_known_grain(sensor, ExtractionConfig()).noise.speckle_grain_px == MAX_GRAIN_PX


def test_what_the_optics_do_not_say_is_learnt(recording: Path) -> None:
    cell = read_cell(recording)
    asked: list[int] = []

    def images(frames: list[int]) -> list[object]:
        asked.extend(frames)
        return [read_image(cell.folder / cell.frames[k].image, cell.sensor) for k in frames]

    total = len(cell.frames)
    known = dataset_config(find_sensor("nominal"), ExtractionConfig(), total, images).noise
    assert known.speckle_grain_px == pytest.approx(NOMINAL_GRAIN_PX, rel=1e-3)
    assert known.speckle_contrast is not None
    assert asked == frames_to_learn(total)
    unknown = replace(cell.sensor, optics=None)
    learnt = dataset_config(unknown, ExtractionConfig(), total, images).noise
    assert learnt.speckle_grain_px not in (None, known.speckle_grain_px)


def test_one_frame_speaks_for_itself() -> None:
    def images(_: list[int]) -> list[object]:
        raise AssertionError("nothing to learn from")

    config = dataset_config(find_sensor("nominal"), ExtractionConfig(), 1, images)
    assert config.noise.speckle_contrast is None
