"""The chain over a dataset: every frame's spots, then calibration. A frame that fails does not stop the others."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from calib import CalibConfig, CalibrationResult, calibrate
from extraction import ExtractionConfig, FeatureConfig, StripeConfig
from geometry import Frame, InputError, Sensor, Surface, SurfacePoints, Target, target_at
from jig_cad import Jig
from workbench.cell.remarks import (
    beside_the_camera,
    beyond_labelling,
    merged,
    out_of_limits,
    remarks,
    with_complaints,
)
from workbench.files import Cell, Settings, read_image

if TYPE_CHECKING:
    from extraction import Profile, TargetPoints
    from workbench.cell.on_surface import OnSurface

# what finds spots, stripes or targets is imported where a dataset of that kind is measured
Progress = Callable[[int, int], None]
FEWEST_TO_SEARCH = 20  # given points of a surface; fewer were chosen by whoever wrote them
WORKERS = 2  # decoding and OpenCV release the interpreter's lock; more threads than cores would only wait


@dataclass(frozen=True)
class ProfileSettings:
    """How a stripe is found, and a target in its profile."""

    stripe: StripeConfig = field(default_factory=StripeConfig)
    feature: FeatureConfig = field(default_factory=FeatureConfig)

    @classmethod
    def of(cls, settings: Settings) -> ProfileSettings:
        """What a settings file says of them."""
        return cls(settings.stripe, settings.feature)


@dataclass(frozen=True, eq=False)
class Observed:
    """A cell's frames as measured.

    complaints: one sentence for each frame whose image could not be used. remarks: doubts about others.
    """

    frames: tuple[Frame, ...]
    complaints: dict[int, str]
    remarks: tuple[str, ...] = ()


def observe(
    cell: Cell,
    config: ExtractionConfig | None = None,
    progress: Progress | None = None,
    profile: ProfileSettings | None = None,
) -> Observed:
    """Measure every frame of ``cell``: the spots of its image, the points of its profile on the target, or its rows
    of points.csv.

    Parameters
    ----------
    cell
        The dataset.
    config
        Of extraction; None: its defaults, the speckle learnt from the dataset.
    progress
        Told the frames done and the frames in all.
    profile
        Of the stripe and of the target in it, for targets other than strings; None: the defaults.

    Returns
    -------
    Observed
        All frames, those that can not be used with a reason, and a sentence for each bad image.

    """
    from workbench.cell.on_surface import dataset_remarks

    frames: list[Frame] = []
    complaints: dict[int, str] = {}
    said: list[str] = []
    found: list[TargetPoints] = []
    for measured in _measured(cell, config or ExtractionConfig(), profile or ProfileSettings()):
        frames.append(measured.frame)
        said += measured.remarks
        found += [] if measured.found is None else [measured.found]
        if measured.complaint:
            complaints[measured.frame.number] = measured.complaint
        if progress:
            progress(len(frames), len(cell.frames))
    return Observed(tuple(frames), complaints, (*merged(said), *dataset_remarks(found, cell.sensor)))


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
    beside = tuple(beside_the_camera(cell))
    result = calibrate(
        observed.frames,
        cell.target,
        cell.robot,
        cell.sensor,
        cell.T_hand_sensor_design,
        # what is given of a surface's place decides nothing: it has no half turn
        {n: T for n, T in cell.T_base_jig.items() if isinstance(_target(cell, n), Jig)},
        config,
        cell.mount,
        cell.evidence,
    )
    verdict = with_complaints(result.verdict, observed.complaints, cell.folder)
    notes = (
        *remarks(result),
        *out_of_limits(cell),
        *cell.remarks,
        *beside,
        *observed.remarks,
        *beyond_labelling(cell, observed.frames, config or CalibConfig()),
        *result.remarks,
    )
    return replace(result, verdict=verdict, remarks=notes)


def _target(cell: Cell, location: str) -> Target | None:
    known = not isinstance(cell.target, Mapping) or location in cell.target
    return target_at(cell.target, location) if known else None


class _Picture(NamedTuple):
    """A frame's image as read, and what is doubtful of its file."""

    image: NDArray[np.generic]
    said: list[str]


def _picture(cell: Cell, frame: Frame) -> _Picture:
    said: list[str] = []
    if not frame.image:
        raise InputError(f"line {frame.line} of the frames' file names no image")
    return _Picture(read_image(cell.folder / frame.image, cell.sensor, said.append), said)


def _readable(cell: Cell, some: list[int], pool: Executor, read: dict[int, _Picture]) -> Iterator[object]:
    """The images of some frames that can be read, decoded ahead and kept: a file is decoded once."""
    jobs = {k: pool.submit(_picture, cell, cell.frames[k]) for k in some}
    for k, job in jobs.items():
        with suppress(InputError):
            read[k] = job.result()
            yield read[k].image


@dataclass(frozen=True, eq=False)
class _Measured:
    frame: Frame
    complaint: str = ""
    remarks: tuple[str, ...] = ()
    found: TargetPoints | None = None


def _measured(cell: Cell, config: ExtractionConfig, profile: ProfileSettings) -> Iterator[_Measured]:
    if cell.points is not None:
        for frame in cell.frames:
            yield _Measured(_from_points(cell, frame))
        return
    if cell.sensor.profile is not None:
        yield from _from_profiles(cell, profile)
        return
    cell.sensor.require_camera()  # said once, not as every frame's complaint
    read: dict[int, _Picture] = {}
    with ThreadPoolExecutor(WORKERS) as pool:
        if any(isinstance(target, Jig) for target in cell.targets):
            from workbench.cell.speckle import dataset_config

            ranked = sorted(range(len(cell.frames)), key=lambda k: cell.frames[k].number)  # rows may stand in any order
            config = dataset_config(
                cell.sensor,
                config,
                len(ranked),
                lambda some: _readable(cell, [ranked[k] for k in some], pool, read),
            )
        yield from pool.map(
            lambda k: _from_image(cell, cell.frames[k], config, profile, read.pop(k, None)), range(len(cell.frames))
        )


def _from_image(
    cell: Cell, frame: Frame, config: ExtractionConfig, profile: ProfileSettings, read: _Picture | None
) -> _Measured:
    """Whatever an image holds, it does not end the run of the others. read: its image, where it was decoded before."""
    sensor: Sensor = cell.sensor
    try:
        image, said = read or _picture(cell, frame)
        target = target_at(cell.target, frame.location)
        if isinstance(target, Surface):
            from extraction import extract_profile, region_mask
            from workbench.cell.on_surface import on_surface

            mask = region_mask(config.region, image.shape)
            seen = extract_profile(image, sensor, profile.stripe, mask=mask)
            return _found(on_surface(frame, seen, target, sensor, profile.feature), said)
        from extraction import extract

        points = extract(image, sensor, config, lambda text: said.append(f"{cell.folder / frame.image}: {text}"))
    except (InputError, MemoryError) as error:
        why = str(error) or f"{frame.image}: not enough memory"
        return _Measured(replace(frame, reason="image_unreadable"), why)
    return _Measured(replace(frame, points=points), remarks=tuple(said))


def _from_profiles(cell: Cell, settings: ProfileSettings) -> Iterator[_Measured]:
    """A profile sensor's frames: files read once, then the target found in each profile."""
    output = cell.sensor.profile
    if output is None:
        raise TypeError("the sensor gives no profiles")
    from workbench.profiles import frame_profiles

    read = frame_profiles(cell.folder, cell.frames, output)
    said = read.remarks
    for frame in cell.frames:
        if frame.number not in read.profiles:
            yield _Measured(replace(frame, reason="no_profile"), read.complaints.get(frame.number, ""), said)
        else:
            yield _on_target(cell, frame, read.profiles[frame.number].profile, list(said), settings.feature)
        said = ()


def _on_target(cell: Cell, frame: Frame, profile: Profile, said: list[str], config: FeatureConfig) -> _Measured:
    from workbench.cell.on_surface import on_surface

    target = target_at(cell.target, frame.location)
    if isinstance(target, Surface):
        return _found(on_surface(frame, profile, target, cell.sensor, config), said)
    if not isinstance(target, Jig):
        raise InputError(f"location {frame.location}: this kind of target can not be found in a profile")
    from extraction.features import string_points

    return _Measured(replace(frame, points=string_points(profile, target.string_diameter_mm)), remarks=tuple(said))


def _found(on: OnSurface, said: Sequence[str]) -> _Measured:
    """What is wrong is the frame's complaint, what is doubtful a remark."""
    if on.frame.reason is not None:
        return _Measured(on.frame, on.text, tuple(said), on.found)
    doubts = [f"frame {on.frame.number}: {on.text}"] if on.text else []
    return _Measured(on.frame, "", (*said, *doubts), on.found)


def _from_points(cell: Cell, frame: Frame) -> Frame:
    given = (cell.points or {}).get(frame.number)
    if given is None:
        return replace(frame, reason="no_spots")
    target = target_at(cell.target, frame.location)
    if isinstance(target, Surface) and given.axis is None:
        return _surface_points(frame, given.points, target, cell.sensor)
    measured = replace(frame, points=given.points)
    return measured if given.axis is None else replace(measured, axis=given.axis, labels_given=True)


def _surface_points(frame: Frame, points: SurfacePoints, target: Surface, sensor: Sensor) -> Frame:
    """Given points of a surface: what of them is the target where they are many, else all of them."""
    if len(points) < FEWEST_TO_SEARCH or target.kind == "edge":
        return replace(frame, points=points, n_points=len(points))
    from extraction import Profile
    from workbench.cell.on_surface import on_surface

    return on_surface(frame, Profile.of_points(points.yz_mm, points.cov_yz_mm2), target, sensor).frame
