"""The chain over a dataset: every frame's spots, then calibration. A frame that fails does not stop the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, replace

from calib import CalibConfig, CalibrationResult, calibrate
from extraction import ExtractionConfig, extract
from geometry import Frame, InputError, Sensor
from workbench.cell.remarks import merged, out_of_limits, remarks, with_complaints
from workbench.cell.speckle import dataset_config
from workbench.files import Cell, read_image

Progress = Callable[[int, int], None]
WORKERS = 2  # decoding and OpenCV release the interpreter's lock; more threads than cores would only wait


@dataclass(frozen=True, eq=False)
class Observed:
    """A cell's frames as measured.

    complaints: one sentence for each frame whose image could not be used. remarks: doubts about others.
    """

    frames: tuple[Frame, ...]
    complaints: dict[int, str]
    remarks: tuple[str, ...] = ()


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
    said: list[str] = []
    for measured in _measured(cell, config or ExtractionConfig()):
        frames.append(measured.frame)
        said += measured.remarks
        if measured.complaint:
            complaints[measured.frame.number] = measured.complaint
        if progress:
            progress(len(frames), len(cell.frames))
    return Observed(tuple(frames), complaints, merged(said))


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
    verdict = with_complaints(result.verdict, observed.complaints, cell.folder)
    notes = (*remarks(result), *out_of_limits(cell), *cell.remarks, *observed.remarks, *result.remarks)
    return replace(result, verdict=verdict, remarks=notes)


def _readable(cell: Cell, frames: list[int]) -> Iterator[object]:
    for k in frames:
        with suppress(InputError):
            yield read_image(cell.folder / cell.frames[k].image, cell.sensor)


@dataclass(frozen=True, eq=False)
class _Measured:
    frame: Frame
    complaint: str = ""
    remarks: tuple[str, ...] = ()


def _measured(cell: Cell, config: ExtractionConfig) -> Iterator[_Measured]:
    if cell.points is not None:
        for frame in cell.frames:
            yield _Measured(_from_points(cell, frame))
        return
    cell.sensor.require_camera()  # said once, not as every frame's complaint
    config = dataset_config(cell.sensor, config, len(cell.frames), lambda frames: _readable(cell, frames))
    with ThreadPoolExecutor(WORKERS) as pool:
        jobs = pool.map(lambda frame: _from_image(cell, frame, config), cell.frames)
        yield from jobs


def _from_image(cell: Cell, frame: Frame, config: ExtractionConfig) -> _Measured:
    """Whatever an image holds, it does not end the run of the others."""
    sensor: Sensor = cell.sensor
    said: list[str] = []
    try:
        if not frame.image:
            raise InputError(f"line {frame.line} of the frames' file names no image")
        image = read_image(cell.folder / frame.image, sensor, said.append)
        points = extract(image, sensor, config)
    except (InputError, MemoryError) as error:
        why = str(error) or f"{frame.image}: not enough memory"
        return _Measured(replace(frame, reason="image_unreadable"), why)
    return _Measured(replace(frame, points=points), remarks=tuple(said))


def _from_points(cell: Cell, frame: Frame) -> Frame:
    given = (cell.points or {}).get(frame.number)
    if given is None:
        return replace(frame, reason="no_spots")
    measured = replace(frame, points=given.points)
    return measured if given.axis is None else replace(measured, axis=given.axis, labels_given=True)
