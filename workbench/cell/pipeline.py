"""The chain over a dataset: every frame's spots, then calibration. A frame that fails does not stop the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace

from calib import CalibConfig, CalibrationResult, calibrate
from extraction import ExtractionConfig, extract
from geometry import Frame, InputError, Sensor
from workbench.cell.remarks import remarks
from workbench.cell.speckle import dataset_config
from workbench.files import Cell, read_image

Progress = Callable[[int, int], None]
WORKERS = 2  # decoding and OpenCV release the interpreter's lock; more threads than cores would only wait


@dataclass(frozen=True, eq=False)
class Observed:
    """A cell's frames as measured. complaints: one sentence for each frame whose image could not be used."""

    frames: tuple[Frame, ...]
    complaints: dict[int, str]


def observe(cell: Cell, config: ExtractionConfig | None = None, progress: Progress | None = None) -> Observed:
    """Measure every frame of ``cell``: its image's spots, or its rows of points.csv.

    Parameters
    ----------
    cell
        The dataset.
    config
        Of extraction; None: its defaults, the speckle learnt from the dataset.
    progress
        Told the frames done and the frames in all.

    Returns
    -------
    Observed
        All frames, those that can not be used with a reason, and a sentence for each bad image.

    """
    frames: list[Frame] = []
    complaints: dict[int, str] = {}
    for frame, complaint in _measured(cell, config or ExtractionConfig()):
        frames.append(frame)
        if complaint:
            complaints[frame.number] = complaint
        if progress:
            progress(len(frames), len(cell.frames))
    return Observed(tuple(frames), complaints)


def solve(cell: Cell, observed: Observed, config: CalibConfig | None = None) -> CalibrationResult:
    """Calibrate on what was observed; the notes say what looks wrong with the files.

    Parameters
    ----------
    cell
        The dataset.
    observed
        Its frames as `observe` measured them.
    config
        Of calibration; None: its defaults.

    Returns
    -------
    CalibrationResult
        With a verdict; without an SCP where none can be trusted.

    """
    result = calibrate(
        observed.frames,
        cell.jig,
        cell.robot,
        cell.sensor,
        cell.T_hand_sensor_design,
        cell.T_base_jig,
        config,
    )
    return replace(result, remarks=(*remarks(result), *cell.remarks, *result.remarks))


def _readable(cell: Cell, frames: list[int]) -> Iterator[object]:
    for k in frames:
        with suppress(InputError):
            yield read_image(cell.folder / cell.frames[k].image, cell.sensor)


def _measured(cell: Cell, config: ExtractionConfig) -> Iterator[tuple[Frame, str]]:
    if cell.points is not None:
        for frame in cell.frames:
            yield _from_points(cell, frame), ""
        return
    cell.sensor.require_camera()  # said once, not as every frame's complaint
    config = dataset_config(cell.sensor, config, len(cell.frames), lambda frames: _readable(cell, frames))
    with ThreadPoolExecutor(WORKERS) as pool:
        jobs = pool.map(lambda frame: _from_image(cell, frame, config), cell.frames)
        yield from jobs


def _from_image(cell: Cell, frame: Frame, config: ExtractionConfig) -> tuple[Frame, str]:
    sensor: Sensor = cell.sensor
    try:
        image = read_image(cell.folder / frame.image, sensor)
    except InputError as error:
        return replace(frame, reason="image_unreadable"), str(error)
    return replace(frame, points=extract(image, sensor, config)), ""


def _from_points(cell: Cell, frame: Frame) -> Frame:
    given = (cell.points or {}).get(frame.number)
    if given is None:
        return replace(frame, reason="no_spots")
    measured = replace(frame, points=given.points)
    return measured if given.axis is None else replace(measured, axis=given.axis, labels_given=True)
