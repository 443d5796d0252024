"""Profiles and what is measured in them: settings, images with their laser-off frame and mask, profile files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from pydantic import Field

from extraction import GapFlushConfig, Profile, StripeConfig, extract_profile, read_profile_csv
from geometry import InputError, Remark, no_remark
from workbench.files import FileSection, read_image, read_sensor, read_toml, validate


class ProfileFile(FileSection):
    """A settings file for `profile` and `gapflush`."""

    stripe: StripeConfig = Field(default_factory=StripeConfig)
    gapflush: GapFlushConfig = Field(default_factory=GapFlushConfig)


@dataclass(frozen=True)
class ProfileSource:
    """Where a profile comes from: an image with its sensor, laser-off frame and mask, or a profile's CSV."""

    path: Path
    sensor: Path | None = None
    laser_off: Path | None = None
    mask: Path | None = None
    settings: ProfileFile = field(default_factory=ProfileFile)


def read_profile_settings(paths: Sequence[Path]) -> ProfileFile:
    """The settings of files, a table of a later one in place of an earlier one's."""
    tables: dict[str, object] = {}
    for path in paths:
        found = validate(ProfileFile, read_toml(path))
        tables.update({name: getattr(found, name) for name in found.model_fields_set})
    return ProfileFile.model_validate(tables)


def read_profile(source: ProfileSource, remark: Remark = no_remark) -> Profile:
    """The profile of an image, or of a CSV that `profile` wrote; InputError says what is missing."""
    if source.path.suffix.lower() == ".csv":
        if source.sensor or source.laser_off or source.mask:
            raise InputError(f"{source.path} is a profile already: --sensor, --laser-off and --mask belong to an image")
        return read_profile_csv(source.path)
    if source.sensor is None:
        raise InputError(f"{source.path} is an image, not a profile's CSV: it needs --sensor FILE")
    sensor = read_sensor(source.sensor)
    image = read_image(source.path, sensor, remark, lossy=True)
    off = None if source.laser_off is None else read_image(source.laser_off, sensor, remark, lossy=True)
    mask = None if source.mask is None else read_image(source.mask, sensor, lossy=True) > 0
    return extract_profile(image, sensor, source.settings.stripe, off, mask)
