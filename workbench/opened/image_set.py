"""Images to tune detection on, with what is known of them: a dataset's, or bare ones with their sensor."""

from __future__ import annotations

import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from calib import CalibrationResult
from extraction import ExtractionConfig
from geometry import InputError, Sensor
from workbench.cell import BareImages, Observed, observe, poses_in_sensor, read_inputs, solve
from workbench.compare import TrueString, true_strings
from workbench.files import LOSSY_SUFFIXES, Cell, Settings, read_settings
from workbench.opened.labeller import Labeller
from workbench.opened.pictures import Pictures
from workbench.opened.watched import WatchedFolder

MAX_IMAGES = 20_000  # of one window: its strip and its survey hold a row each


@dataclass(frozen=True)
class ImageRequest:
    """What the command line was given. out: for saved settings, else the opened folder. watch: take in what comes."""

    inputs: tuple[Path, ...]
    sensor: Path | None = None
    jig: Path | None = None
    config: tuple[Path, ...] = ()
    out: Path | None = None
    watch: bool = False


@dataclass(frozen=True)
class ImageInfo:
    """What the dataset says of one image."""

    frame: int
    location: str = ""
    role: str = ""


@dataclass(frozen=True, eq=False)
class ImageSet:
    """The images and all that is known of them.

    labeller: with the jig, where there is one. truth: by image index, empty where there is none. cell: the dataset,
    None of bare images. folder: where settings are saved. watched: the folder whose new images are taken in.
    """

    title: str
    pictures: Pictures
    labeller: Labeller
    images: tuple[ImageInfo, ...]
    truth: Mapping[int, tuple[TrueString, ...]]
    settings: Settings
    folder: Path
    cell: Cell | None = None
    watched: WatchedFolder | None = None

    @property
    def sensor(self) -> Sensor:
        """The sensor that took the images."""
        return self.labeller.sensor

    def calibrate(self, config: ExtractionConfig) -> tuple[Observed, CalibrationResult]:
        """Solve the dataset's chain; from then on labels follow the robot, where the solution can be trusted."""
        if self.cell is None:
            raise InputError(NO_CHAIN)
        observed = observe(self.cell, config)
        result = solve(self.cell, observed, self.settings.calib)
        poses = poses_in_sensor(result)
        if poses:
            index = {image.frame: i for i, image in enumerate(self.images)}
            self.labeller.learn({index[frame]: pose for frame, pose in poses.items()})
        return observed, result

    def learn_chain(self) -> None:
        """Solve the chain once with the parameters as opened; does nothing for bare images."""
        if self.cell is not None:
            self.calibrate(self.settings.extraction)


NO_CHAIN = "Bare images have no joint readings: open a cell dataset to calibrate."


def open_images(request: ImageRequest) -> ImageSet:
    """The images of a dataset or bare ones, with all that is known of them.

    Parameters
    ----------
    request
        What the command line was given.

    Returns
    -------
    ImageSet
        Pictures are read when they are asked for.

    Raises
    ------
    InputError
        Saying what is missing, or that there are no images to tune on.

    """
    settings = read_settings(request.config)
    found = read_inputs(request.inputs, request.sensor, request.jig, lossy=True)
    found.sensor.require_camera()
    return _bare(found, request, settings) if isinstance(found, BareImages) else _of_cell(found, request, settings)


def _of_cell(cell: Cell, request: ImageRequest, settings: Settings) -> ImageSet:
    if request.watch:
        raise InputError(f"{cell.folder}: --watch takes a folder of images, not a dataset")
    if cell.points is not None:
        raise InputError(f"{cell.folder}: holds points.csv in place of images, there is nothing to tune detection on")
    sensor = cell.sensor
    index = {row.number: i for i, row in enumerate(cell.frames)}
    known = cell.truth.frames if cell.truth is not None else ()
    return ImageSet(
        title=cell.name or cell.folder.resolve().name,
        pictures=Pictures(cell.folder, [cell.folder / row.image for row in cell.frames], sensor),
        labeller=Labeller(sensor, cell.jig, settings.calib),
        images=tuple(ImageInfo(row.number, row.location, row.role) for row in cell.frames),
        truth={index[frame.frame]: true_strings(frame.points) for frame in known if frame.frame in index},
        settings=settings,
        folder=request.out or cell.folder,
        cell=cell,
    )


def _bare(found: BareImages, request: ImageRequest, settings: Settings) -> ImageSet:
    for path in found.paths:
        if not path.exists():
            raise InputError(f"{path}: no such file or folder")
    if len(found.paths) > MAX_IMAGES:
        raise InputError(f"{len(found.paths)} images are more than the {MAX_IMAGES} that one window holds")
    folder = Path(os.path.commonpath([path.parent.resolve() for path in found.paths]))
    if request.watch and (len(request.inputs) != 1 or not request.inputs[0].is_dir()):
        raise InputError("--watch takes one folder of images")
    sensor = found.sensor
    return ImageSet(
        watched=WatchedFolder(request.inputs[0], LOSSY_SUFFIXES, set(found.paths)) if request.watch else None,
        title=folder.name,
        pictures=Pictures(folder, found.paths, sensor),
        labeller=Labeller(sensor, found.jig, settings.calib),
        images=tuple(ImageInfo(i) for i in range(len(found.paths))),
        truth={},
        settings=settings,
        folder=request.out or folder,
    )
