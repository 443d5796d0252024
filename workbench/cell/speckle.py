"""What is known of the speckle in a dataset's images: its grain by the optics, the rest learnt from some of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from extraction import MAX_GRAIN_PX, ExtractionConfig, learn_speckle
from perceptron_emu import grain_px
from workbench.files import SensorDescription

LEARNT_FRAMES = 6  # frames that the speckle is learnt from, and the largest share of a dataset's
LEARNT_SHARE = 0.3
# what tells the grain λF#(1 + m), by table of sensor.toml; the emulator's defaults are no knowledge of a real sensor
OPTICS = {"laser": {"wavelength_nm"}, "optics": {"pixel_um", "f_number"}}


def with_known_grain(sensor: SensorDescription, config: ExtractionConfig) -> ExtractionConfig:
    """The configuration with the grain by the optics, where it gives none and the sensor's file itself states them."""
    stated = all(keys <= sensor.emulator_keys.get(table, {}).keys() for table, keys in OPTICS.items())
    if config.noise.speckle_grain_px is not None or not stated:
        return config
    grain = min(grain_px(sensor.emulator, sensor.model), MAX_GRAIN_PX)
    return config.model_copy(update={"noise": config.noise.model_copy(update={"speckle_grain_px": grain})})


def dataset_config(
    sensor: SensorDescription, config: ExtractionConfig, total: int, images: Callable[[list[int]], Iterable[object]]
) -> ExtractionConfig:
    """The configuration for a dataset of ``total`` frames, the speckle learnt from a few that are spread over all.

    One frame's spots tell little of it; the σ of all points hang on it. What the configuration gives is kept.
    images: the frames of the numbers that it is given.
    """
    config = with_known_grain(sensor, config)
    if total < 2 or not _learns(config):
        return config
    return learn_speckle(images(frames_to_learn(total)), sensor.model, config)


def _learns(config: ExtractionConfig) -> bool:
    noise = config.noise
    known = noise.speckle_contrast is not None and noise.speckle_grain_px is not None
    return config.localise.method == "ml" and not known


def frames_to_learn(total: int) -> list[int]:
    """Which of ``total`` frames the speckle is learnt from: a few, spread over all."""
    count = min(LEARNT_FRAMES, max(1, int(LEARNT_SHARE * total)), total)
    return [(2 * n + 1) * total // (2 * count) for n in range(count)]
