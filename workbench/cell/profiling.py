"""Profiles and what is measured in them: settings, images with their laser-off frame and mask, profile files."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from extraction import GapFlushConfig, Profile
from geometry import InputError, Remark, no_remark, read_bytes
from geometry.sensor import AUTO, ProfileOutput
from workbench.cell.presets import find_sensor
from workbench.files import LOSSY_SUFFIXES, SUFFIXES, Image, Settings, read_image

MAX_OWN_BYTES = 64 * 2**20  # a profile of ours has some kilobytes


@dataclass(frozen=True)
class ProfileSource:
    """Where a profile comes from: an image with its sensor, laser-off frame and mask, or a profile file."""

    path: Path
    sensor: Path | None = None
    laser_off: Path | None = None
    mask: Path | None = None
    settings: Settings = field(default_factory=Settings)


def with_options(config: GapFlushConfig, told: dict[str, object]) -> GapFlushConfig:
    """Settings with some of them told anew; InputError where they do not go together."""
    try:
        return GapFlushConfig.model_validate(config.model_dump() | told)
    except ValidationError as error:
        raise InputError(error.errors()[0]["msg"].removeprefix("Value error, ")) from None


def is_profile_file(path: Path) -> bool:
    """Whether a file is no image by its name, nor a folder of them."""
    return path.suffix.lower() not in (*SUFFIXES, *LOSSY_SUFFIXES) and not path.is_dir()


def read_profile(source: ProfileSource, remark: Remark = no_remark) -> Profile:
    """The profile of an image, or of a profile file; InputError says what is missing."""
    if is_profile_file(source.path):
        if source.laser_off or source.mask:
            raise InputError(f"{source.path} is a profile already: --laser-off and --mask belong to an image")
        return _profile_of_file(source, remark)
    if source.sensor is None:
        raise InputError(f"{source.path} is an image, not a profile's file: it needs --sensor FILE")
    sensor = find_sensor(str(source.sensor))
    image = read_image(source.path, sensor, remark, lossy=True)
    off = None if source.laser_off is None else read_image(source.laser_off, sensor, remark, lossy=True)
    mask = None if source.mask is None else read_image(source.mask, sensor, lossy=True) > 0
    from extraction import extract_profile

    return extract_profile(image, sensor, source.settings.stripe, off, usable(image, mask, source.settings))


def usable(image: Image, mask: NDArray[np.bool_] | None, settings: Settings) -> NDArray[np.bool_] | None:
    """The pixels (H, W) that a mask and the settings' region both let through; None where all may be used."""
    from extraction import region_mask

    region = region_mask(settings.extraction.region, image.shape)
    if mask is None or region is None:
        return region if mask is None else mask
    if mask.shape != region.shape:
        return mask  # extraction says what is wrong with it
    return mask & region


def _profile_of_file(source: ProfileSource, remark: Remark) -> Profile:
    """A profile by its maker's file, with what a profile sensor's file says of it; our own CSV has the stripe's too."""
    sensor = None if source.sensor is None else find_sensor(str(source.sensor))
    output = ProfileOutput() if sensor is None or sensor.profile is None else sensor.profile
    from extraction import read_profile_csv
    from workbench.profiles import Told, checked_profile, read_scan_lines

    if output.format == AUTO and source.path.suffix.lower() == ".csv" and _has_stripe(source.path):
        own = read_profile_csv(source.path)
        return own if sensor is None or own.sensor_cov_yz_mm2 is not None else own.with_sensor(sensor)
    told = Told(output.format, output.pitch_mm, output.start_mm, output.unit, output.width, remark)
    lines = read_scan_lines(source.path, told)
    if len(lines) > 1:
        raise InputError(f"{source.path}: holds {len(lines)} profiles; a file of one is needed here")
    checked = checked_profile(lines[0], output, source.path)
    for sentence in checked.remarks:
        remark(sentence)
    return checked.profile if sensor is None else checked.profile.with_sensor(sensor)


def _has_stripe(path: Path) -> bool:
    """Whether `profile` wrote the file: its points' widths in the image stand there."""
    return b"width_px" in read_bytes(path, MAX_OWN_BYTES, "profile")[:4096]
