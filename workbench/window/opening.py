"""Open what the user named, a cell dataset or bare images, as a window session."""

from __future__ import annotations

import os
import shlex
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from calib import CalibrationResult
from geometry import InputError, Pose
from workbench.cell.extracting import image_files
from workbench.cell.pipeline import observe, solve
from workbench.files import Cell, read_cell, read_jig_file, read_sensor
from workbench.files.settings_file import Settings, read_settings
from workbench.report.as_json import calibration_object, clean
from workbench.window.detector import Detector
from workbench.window.pictures import MAX_IMAGES, Pictures
from workbench.window.session import FrameInfo, Opened
from workbench.window.settings_text import parse_settings, settings_toml
from workbench.window.truth import TrueString


@dataclass(frozen=True)
class Request:
    """What the command line was given."""

    inputs: tuple[Path, ...]
    sensor: Path | None = None
    jig: Path | None = None
    config: tuple[Path, ...] = ()
    out: Path | None = None  # folder for saved settings; default: the opened folder


def open_session(request: Request) -> Opened:
    """The session of a dataset (folder with cell.toml, or that file) or of images; InputError says what is missing."""
    settings = read_settings(request.config)
    first = request.inputs[0]
    if first.suffix == ".toml" or (first / "cell.toml").exists():
        if len(request.inputs) > 1:
            raise InputError(f"{first} is a dataset; give one dataset, or images only")
        return _open_cell(request, settings)
    return _open_images(request, settings)


def _open_cell(request: Request, settings: Settings) -> Opened:
    cell = _with_files(read_cell(request.inputs[0]), request)
    if cell.points is not None:
        raise InputError(f"{cell.folder}: holds points.csv in place of images, there is nothing to tune detection on")
    sensor = cell.sensor
    sensor.require_camera()
    detector = Detector(sensor, cell.jig, settings.calib)
    paths = [cell.folder / row.image for row in cell.frames]
    frames = tuple(FrameInfo(row.frame, row.location, row.role) for row in cell.frames)
    index = {row.frame: i for i, row in enumerate(cell.frames)}
    return Opened(
        title=cell.name or cell.folder.resolve().name,
        pictures=Pictures(cell.folder, paths, sensor),
        engine=detector,
        frames=frames,
        truth=_truth(cell, index),
        start=settings.extraction,
        settings_folder=request.out or cell.folder,
        to_toml=settings_toml,
        from_toml=parse_settings,
        command=_command(request),
        calibrate=_calibration(cell, settings, detector),
        prepare=_preparation(cell, settings, detector),
    )


def _with_files(cell: Cell, request: Request) -> Cell:
    from dataclasses import replace

    if request.sensor is not None:
        cell = replace(cell, sensor=read_sensor(request.sensor))
    if request.jig is not None:
        cell = replace(cell, jig=read_jig_file(request.jig))
    return cell


def _open_images(request: Request, settings: Settings) -> Opened:
    if request.sensor is None:
        raise InputError(f"{request.inputs[0]} is no cell dataset (no cell.toml); bare images need --sensor FILE")
    sensor = read_sensor(request.sensor)
    sensor.require_camera()
    files = _files(request.inputs)
    folder = _common_folder(files)
    detector = Detector(sensor, read_jig_file(request.jig) if request.jig else None, settings.calib)
    return Opened(
        title=folder.name,
        pictures=Pictures(folder, files, sensor),
        engine=detector,
        frames=tuple(FrameInfo(i) for i in range(len(files))),
        truth={},
        start=settings.extraction,
        settings_folder=request.out or folder,
        to_toml=settings_toml,
        from_toml=parse_settings,
        command=_command(request),
        no_calibration="Bare images have no joint readings: open a cell dataset to calibrate.",
    )


def _files(inputs: Sequence[Path]) -> list[Path]:
    for path in inputs:
        if not path.exists():
            raise InputError(f"{path}: no such file or folder")
    files = image_files(inputs)
    if len(files) > MAX_IMAGES:
        raise InputError(f"{len(files)} images are more than the {MAX_IMAGES} that one window holds")
    return files


def _common_folder(files: Sequence[Path]) -> Path:
    return Path(os.path.commonpath([f.parent.resolve() for f in files]))


def _truth(cell: Cell, index: dict[int, int]) -> dict[int, tuple[TrueString, ...]]:
    """True strings by image index; those outside the image or the sheet are left out."""
    if cell.truth is None:
        return {}
    out = {}
    for frame in cell.truth.frames:
        if frame.frame in index:
            out[index[frame.frame]] = tuple(
                TrueString(p.label, p.axis_mm, p.surface_mm, p.image_px, p.visible_fraction)
                for p in frame.points
                if p.axis_mm is not None and p.surface_mm is not None and p.image_px is not None
            )
    return out


def _calibration(cell: Cell, settings: Settings, detector: Detector) -> Callable[[BaseModel], dict[str, Any]]:
    def run(config: BaseModel) -> dict[str, Any]:
        from extraction import ExtractionConfig

        observed = observe(cell, ExtractionConfig.model_validate(config.model_dump()))
        result = solve(cell, observed, settings.calib)
        _learn(cell, result, detector)
        answer: dict[str, Any] = clean(calibration_object(result, observed.complaints))
        return answer

    return run


def _preparation(cell: Cell, settings: Settings, detector: Detector) -> Callable[[], None]:
    """Solve the chain once with the parameters as opened, so that labels follow the robot."""

    def prepare() -> None:
        observed = observe(cell, settings.extraction)
        _learn(cell, solve(cell, observed, settings.calib), detector)

    return prepare


def _learn(cell: Cell, result: CalibrationResult, detector: Detector) -> None:
    if result.verdict.trustworthy and result.T_hand_sensor is not None:
        detector.learn(_poses_in_sensor(cell, result, result.T_hand_sensor))


def _poses_in_sensor(cell: Cell, result: CalibrationResult, T_hand_sensor: Pose) -> dict[int, Pose]:
    """T_sensor_jig by image index, through the solved robot chain."""
    poses = {}
    for i, row in enumerate(cell.frames):
        place = result.locations.get(row.location)
        joints, robot = row.joints_rad, result.robot
        hand = robot.hand_pose(joints) if joints is not None and robot is not None else row.T_base_hand
        if place is not None and place.T_base_jig is not None and hand is not None:
            poses[i] = (hand @ T_hand_sensor).inverse() @ place.T_base_jig
    return poses


def _command(request: Request) -> Callable[[str], str]:
    """The command line that extracts the same points, given the settings file's name."""
    folder = request.out

    def command(name: str) -> str:
        first = request.inputs[0]
        base = folder or (first if first.is_dir() else first.parent)
        parts = ["perceptron-emu", "extract", *map(str, request.inputs)]
        for option, path in (("--sensor", request.sensor), ("--jig", request.jig)):
            parts += [option, str(path)] if path else []
        parts += ["--config", str(base / name), "--csv", "points.csv"]
        return shlex.join(parts)

    return command
