"""What is known of the speckle in a dataset's images: its grain by the optics, the rest learnt from some of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from extraction import ExtractionConfig, learn_speckle
from extraction.spots import optical_grain_px
from geometry import Sensor

LEARNT_FRAMES = 12  # that the speckle is learnt from: sixty spots tell the contrast to 5 %, the grain to a fifth


def with_known_grain(sensor: Sensor, config: ExtractionConfig) -> ExtractionConfig:
    """The configuration with the grain by the optics, where it gives none and the sensor's file itself states them."""
    grain = optical_grain_px(sensor) if config.noise.speckle_grain_px is None else None
    if grain is None:
        return config
    return config.model_copy(update={"noise": config.noise.model_copy(update={"speckle_grain_px": grain})})


def dataset_config(
    sensor: Sensor, config: ExtractionConfig, total: int, images: Callable[[list[int]], Iterable[object]]
) -> ExtractionConfig:
    """The configuration for a dataset, the speckle learnt from a few frames that are spread over all.

    One frame's spots tell little of it; the σ of all points hang on it.

    Parameters
    ----------
    sensor
        Of the images; where it states its optics, the grain is known.
    config
        What was asked for; what it gives is kept.
    total
        How many frames there are.
    images
        Gives the images (H, W) of the frame numbers it is asked for.

    Returns
    -------
    ExtractionConfig
        With the speckle's contrast and grain.

    """
    config = with_known_grain(sensor, config)
    if total < 2 or not _learns(config):
        return config
    return learn_speckle(images(frames_to_learn(total)), sensor, config)


def _learns(config: ExtractionConfig) -> bool:
    noise = config.noise
    known = noise.speckle_contrast is not None and noise.speckle_grain_px is not None
    return config.localise.method == "ml" and not known


def frames_to_learn(total: int) -> list[int]:
    """Which of ``total`` frames the speckle is learnt from: a few, spread over all."""
    count = min(LEARNT_FRAMES, total)
    return [(2 * n + 1) * total // (2 * count) for n in range(count)]
