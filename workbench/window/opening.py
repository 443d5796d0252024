"""Open what the user named, a cell dataset or bare images, as a window session."""

from __future__ import annotations

import shlex
from collections.abc import Callable
from typing import Any

from pydantic import BaseModel

from extraction import ExtractionConfig
from geometry import clean
from workbench.files import parse_settings, settings_toml
from workbench.opened import NO_CHAIN, ImageRequest, ImageSet, open_images
from workbench.report import calibration_object
from workbench.window.detector import Detector
from workbench.window.session import Opened


def open_session(request: ImageRequest) -> Opened:
    """The session of a dataset (folder with cell.toml, or that file) or of images; InputError says what is missing."""
    images = open_images(request)
    dataset = images.cell is not None
    return Opened(
        title=images.title,
        pictures=images.pictures,
        engine=Detector(images.labeller),
        frames=images.images,
        truth=images.truth,
        start=images.settings.extraction,
        settings_folder=images.folder,
        to_toml=settings_toml,
        from_toml=parse_settings,
        command=_command(request),
        calibrate=_calibration(images) if dataset else None,
        no_calibration="" if dataset else NO_CHAIN,
        prepare=images.learn_chain if dataset else None,
        look=images.watched.look if images.watched is not None else None,
    )


def _calibration(images: ImageSet) -> Callable[[BaseModel], dict[str, Any]]:
    def run(config: BaseModel) -> dict[str, Any]:
        observed, result = images.calibrate(ExtractionConfig.model_validate(config.model_dump()))
        answer: dict[str, Any] = clean(calibration_object(result, observed.complaints))
        return answer

    return run


def _command(request: ImageRequest) -> Callable[[str], str]:
    """The command line that extracts the same points, given the settings file's name."""

    def command(name: str) -> str:
        first = request.inputs[0]
        base = request.out or (first if first.is_dir() else first.parent)
        parts = ["perceptron-emu", "extract", *map(str, request.inputs)]
        for option, path in (("--sensor", request.sensor), ("--jig", request.jig)):
            parts += [option, str(path)] if path else []
        parts += ["--config", str(base / name), "--csv", "points.csv"]
        return shlex.join(parts)

    return command
