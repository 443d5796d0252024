"""Extraction over a dataset or bare images."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from extraction import ExtractionConfig, extract
from geometry import Frame, InputError, Sensor
from jig_cad import Jig
from workbench.cell.inputs import BareImages, read_inputs
from workbench.cell.labels import label_alone, label_dataset
from workbench.cell.pipeline import ProfileSettings, observe
from workbench.cell.remarks import merged
from workbench.cell.speckle import with_known_grain
from workbench.files import Cell, Settings, read_image

Progress = Callable[[int, int], None]


@dataclass(frozen=True, eq=False)
class Extracted:
    """Spots and labels by frame.

    paths: the images. complaints: a sentence for each image that could not be used. remarks: doubts about others.
    """

    frames: tuple[Frame, ...]
    sensor: Sensor
    paths: dict[int, Path]
    complaints: dict[int, str]
    remarks: tuple[str, ...] = ()


def extract_inputs(
    inputs: Sequence[Path], sensor: Path | None, jig: Path | None, settings: Settings, progress: Progress
) -> Extracted:
    """Extract a dataset (one folder with cell.toml, or that file) or image files and folders of them."""
    found = read_inputs(inputs, sensor, jig)
    if isinstance(found, BareImages):
        config = with_known_grain(found.sensor, settings.extraction)
        return _images(found.paths, found.sensor, found.jig, config, progress)
    return _dataset(found, settings, progress)


def _dataset(cell: Cell, settings: Settings, progress: Progress) -> Extracted:
    observed = observe(cell, settings.extraction, progress, ProfileSettings.of(settings))
    paths = {} if cell.points is not None else {f.number: cell.folder / f.image for f in cell.frames}
    return Extracted(
        label_dataset(cell, observed, settings.calib), cell.sensor, paths, observed.complaints, observed.remarks
    )


def _images(
    files: Sequence[Path], sensor: Sensor, jig: Jig | None, config: ExtractionConfig, progress: Progress
) -> Extracted:
    frames: list[Frame] = []
    complaints = {}
    said: list[str] = []
    for number, path in enumerate(files):
        frame = Frame(number, "", image=path.name)
        try:
            image = read_image(path, sensor, said.append)
            left_out: list[str] = []
            frame = replace(frame, points=extract(image, sensor, config, left_out.append))
            said += [f"{path}: {text}" for text in left_out]
            frame = frame if jig is None else label_alone(frame, jig, sensor)
        except InputError as error:
            complaints[number], frame = str(error), replace(frame, reason="image_unreadable")
        frames.append(frame)
        progress(number + 1, len(files))
    if len(complaints) == len(files):
        raise InputError(next(iter(complaints.values())))
    return Extracted(tuple(frames), sensor, dict(enumerate(files)), complaints, merged(said))
