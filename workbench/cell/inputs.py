"""What a user names on the command line: a cell dataset, or image files and folders of them with a sensor."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from geometry import InputError, Sensor
from jig_cad import Jig
from workbench.cell.presets import find_jig, find_sensor
from workbench.files import LOSSY_SUFFIXES, SUFFIXES, Cell, files_of, read_cell

MAX_IMAGES = 100_000  # of one call: more is a wrong folder


@dataclass(frozen=True, eq=False)
class BareImages:
    """Image files of a sensor, without a robot. jig: where one is given; without it nothing can be labelled."""

    paths: tuple[Path, ...]
    sensor: Sensor
    jig: Jig | None


def read_inputs(
    inputs: Sequence[Path], sensor: Path | None, jig: Path | None, *, lossy: bool = False
) -> Cell | BareImages:
    """What the paths name: the dataset of one folder with cell.toml, or of that file, else images.

    Parameters
    ----------
    inputs
        One dataset, or image files and folders of them.
    sensor, jig
        Files, or presets by name, that stand in place of the dataset's own; bare images need a sensor.
    lossy
        Whether a folder's JPEGs count as images.

    Returns
    -------
    Cell or BareImages
        Images are not opened.

    Raises
    ------
    InputError
        Saying what is missing.

    """
    first = inputs[0]
    if first.suffix == ".toml" or (first / "cell.toml").exists():
        if len(inputs) > 1:
            raise InputError(f"{first} is a dataset; give one dataset, or images only")
        cell = read_cell(first)
        cell = cell if sensor is None else replace(cell, sensor=find_sensor(str(sensor)))
        return cell if jig is None else replace(cell, target=find_jig(str(jig)))
    if sensor is None:
        raise InputError(f"{first} is no cell dataset (no cell.toml); bare images need --sensor FILE")
    seen_by, given = find_sensor(str(sensor)), find_jig(str(jig)) if jig is not None else None
    return BareImages(tuple(_image_files(inputs, LOSSY_SUFFIXES if lossy else SUFFIXES)), seen_by, given)


def _image_files(inputs: Sequence[Path], suffixes: Sequence[str]) -> list[Path]:
    """The files given, and the images of the folders given, sorted by name."""
    out: list[Path] = []
    for path in inputs:
        if path.is_dir():
            found = [p for p in files_of(path) if p.suffix.lower() in suffixes]
            if not found:
                raise InputError(f"{path}: the folder holds no PNG, TIFF or BMP images")
            out += found
        else:
            out.append(path)
    if len(out) > MAX_IMAGES:
        raise InputError(f"{len(out)} images are more than the {MAX_IMAGES} of one call")
    return out
