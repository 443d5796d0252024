"""Extraction over a dataset or bare images: which files, which sensor, which jig."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from extraction import ExtractionConfig, extract
from geometry import AxisPoints, InputError, Sensor, SurfacePoints
from jig_cad import Jig
from workbench.cell.labels import label_dataset, label_image
from workbench.cell.pipeline import observe
from workbench.cell.points_table import FrameTable
from workbench.cell.speckle import with_known_grain
from workbench.files import read_cell, read_image, read_jig_file, read_sensor
from workbench.files.images import SUFFIXES
from workbench.files.settings_file import Settings

Progress = Callable[[int, int], None]
MAX_IMAGES = 100_000


@dataclass(frozen=True, eq=False)
class Extracted:
    """Spots and labels by frame. paths: the images. complaints: a sentence for each image that could not be used."""

    tables: list[FrameTable]
    sensor: Sensor
    paths: dict[int, Path]
    complaints: dict[int, str]


def extract_inputs(
    inputs: Sequence[Path], sensor: Path | None, jig: Path | None, settings: Settings, progress: Progress
) -> Extracted:
    """Extract a dataset (one folder with cell.toml, or that file) or image files and folders of them."""
    first = inputs[0]
    if first.suffix == ".toml" or (first / "cell.toml").exists():
        if len(inputs) > 1:
            raise InputError(f"{first} is a dataset; give one dataset, or images only")
        return _dataset(first, sensor, jig, settings, progress)
    if sensor is None:
        raise InputError(f"{first} is no cell dataset (no cell.toml); bare images need --sensor FILE")
    seen_by = read_sensor(sensor)
    config = with_known_grain(seen_by, settings.extraction)
    given = read_jig_file(jig) if jig is not None else None
    return _images(image_files(inputs), seen_by, given, config, progress)


def image_files(inputs: Sequence[Path]) -> list[Path]:
    """The files given, and the images of the folders given, sorted by name."""
    out: list[Path] = []
    for path in inputs:
        if path.is_dir():
            found = sorted(p for p in path.iterdir() if p.suffix.lower() in SUFFIXES and p.is_file())
            if not found:
                raise InputError(f"{path}: the folder holds no PNG or TIFF images")
            out += found
        else:
            out.append(path)
    if len(out) > MAX_IMAGES:
        raise InputError(f"{len(out)} images are more than the {MAX_IMAGES} of one call")
    return out


def _dataset(path: Path, sensor: Path | None, jig: Path | None, settings: Settings, progress: Progress) -> Extracted:
    cell = read_cell(path)
    if sensor is not None:
        cell = replace(cell, sensor=read_sensor(sensor))
    if jig is not None:
        cell = replace(cell, jig=read_jig_file(jig))
    observed = observe(cell, settings.extraction, progress)
    paths = {} if cell.points is not None else {row.frame: cell.folder / row.image for row in cell.frames}
    return Extracted(label_dataset(cell, observed, settings.calib), cell.sensor, paths, observed.complaints)


def _images(
    files: Sequence[Path], sensor: Sensor, jig: Jig | None, config: ExtractionConfig, progress: Progress
) -> Extracted:
    tables, complaints = [], {}
    for frame, path in enumerate(files):
        points, reason = SurfacePoints.empty(), None
        try:
            points = extract(read_image(path, sensor), sensor, config)
        except InputError as error:
            complaints[frame], reason = str(error), "image_unreadable"
        if jig is None or reason is not None:
            tables.append(FrameTable(frame, path.name, points, AxisPoints.empty(), reason))
        else:
            tables.append(label_image(frame, path.name, points, jig, sensor))
        progress(frame + 1, len(files))
    if len(complaints) == len(files):
        raise InputError(next(iter(complaints.values())))
    return Extracted(tables, sensor, dict(enumerate(files)), complaints)
