"""Images or profiles to tune measuring on, with what is known of them: a dataset's, bare ones, pictures of a board."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from calib import CalibrationResult
from extraction import ExtractionConfig
from geometry import Board, InputError, Sensor, Sheet, Surface, Target, target_at
from geometry.sensor import ProfileOutput
from jig_cad import Jig, Sphere
from workbench.cell import (
    BareImages,
    Observed,
    ProfileSettings,
    find_sensor,
    is_profile_file,
    observe,
    poses_in_sensor,
    read_inputs,
    solve,
)
from workbench.compare import TrueString, true_strings
from workbench.files import (
    LOSSY_SUFFIXES,
    Cell,
    MeasureConfig,
    Recipe,
    Settings,
    What,
    files_of,
    find_views,
    picture_sensor,
    read_board,
    read_settings,
    sensor_of_picture,
)
from workbench.opened.labeller import Labeller
from workbench.opened.pictures import Pictures
from workbench.opened.profile_files import ProfileRecords, bare_profiles, cell_profiles
from workbench.opened.watched import WatchedFolder
from workbench.profiles import SUFFIXES as PROFILE_SUFFIXES

MAX_IMAGES = 20_000  # of one window: its strip and its survey hold a row each
BOARD_FILE = "board.toml"
PROFILE_ENDS = (*dict.fromkeys(PROFILE_SUFFIXES.values()), ".yaml", ".pcd", ".dat")


@dataclass(frozen=True)
class ImageRequest:
    """What the command line was given. out: for saved settings, else the opened folder. watch: take in what comes.

    what: strings or stripe, else told from the data. board: pictures are of this board.
    """

    inputs: tuple[Path, ...]
    sensor: Path | None = None
    jig: Path | None = None
    config: tuple[Path, ...] = ()
    out: Path | None = None
    watch: bool = False
    what: What | None = None
    board: Path | None = None


@dataclass(frozen=True)
class ImageInfo:
    """What the dataset says of one image."""

    frame: int
    location: str = ""
    role: str = ""


@dataclass(frozen=True, eq=False)
class ImageSet:
    """The images or profiles and all that is known of them.

    labeller: with the jig, where there is one. truth: by image index, empty where there is none. cell: the dataset,
    None of bare images. folder: where settings are saved. watched: the folder whose new images are taken in.
    board: what the pictures show in place of a target, board_of: the index of the picture with the board for each with
    a stripe. plane_known: whether the images' sensor is known. skipped: a sentence for each file that was left out.
    """

    title: str
    pictures: Pictures | ProfileRecords
    labeller: Labeller
    images: tuple[ImageInfo, ...]
    truth: Mapping[int, tuple[TrueString, ...]]
    settings: Settings
    folder: Path
    cell: Cell | None = None
    watched: WatchedFolder | None = None
    board: Board | None = None
    board_of: Mapping[int, int] | None = None
    plane_known: bool = True
    skipped: tuple[str, ...] = ()

    @property
    def sensor(self) -> Sensor:
        """The sensor that took the images."""
        return self.labeller.sensor

    @property
    def has_images(self) -> bool:
        """Whether there are images, not profiles alone."""
        return isinstance(self.pictures, Pictures)

    @property
    def recipe(self) -> Recipe:
        """The recipe that they are opened with: what is looked for is said."""
        recipe = self.settings.recipe
        return recipe.model_copy(update={"what": recipe.what or ("strings" if self.labeller.strings else "stripe")})

    def calibrate(self, recipe: ExtractionConfig) -> tuple[Observed, CalibrationResult]:
        """Solve the dataset's chain; from then on labels follow the robot, where the solution can be trusted."""
        if self.cell is None:
            raise InputError(NO_CHAIN)
        settings = Settings.of(recipe) if isinstance(recipe, Recipe) else replace(self.settings, extraction=recipe)
        observed = self.observe(settings)
        result = solve(self.cell, observed, settings.calib)
        self.learn(result)
        return observed, result

    def observe(self, settings: Settings) -> Observed:
        """Measure every frame of the dataset."""
        if self.cell is None:
            raise InputError(NO_CHAIN)
        return observe(self.cell, settings.extraction, None, ProfileSettings.of(settings))

    def learn(self, result: CalibrationResult) -> None:
        """Have labels follow the robot, where the solution can be trusted."""
        poses = poses_in_sensor(result) if self.labeller.strings else {}
        if poses:
            index = {image.frame: i for i, image in enumerate(self.images)}
            self.labeller.learn({index[frame]: pose for frame, pose in poses.items()})

    @property
    def target_words(self) -> dict[str, str]:
        """What stands at each location, in a word."""
        if self.cell is None:
            return {}
        found = {row.location: target_at(self.cell.target, row.location) for row in self.cell.frames}
        return {name: t.kind if isinstance(t, Surface) else "strings" for name, t in found.items()}

    def learn_chain(self) -> None:
        """Solve the chain once with the parameters as opened; does nothing for bare images and other targets."""
        if self.cell is not None and self.labeller.strings:
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
    if request.what is not None:
        settings = replace(settings, what=request.what)
    first = request.inputs[0]
    if request.board is not None or (first.is_dir() and (first / BOARD_FILE).is_file()):
        return _of_board(request, settings)
    profiles = _profile_files(request)
    if profiles:
        return _profiles(profiles, request, settings)
    if request.sensor is None and first.suffix != ".toml" and not (first / "cell.toml").exists():
        return _bare(_pixels_only(request), request, settings, plane_known=False)
    found = read_inputs(request.inputs, request.sensor, request.jig, lossy=True)
    if isinstance(found, BareImages):
        found.sensor.require_camera()
        return _bare(found, request, settings)
    return _of_cell(found, request, settings)


def _of_cell(cell: Cell, request: ImageRequest, settings: Settings) -> ImageSet:
    if request.watch:
        raise InputError(f"{cell.folder}: --watch takes a folder of images, not a dataset")
    if cell.points is not None:
        raise InputError(f"{cell.folder}: holds points.csv in place of images, there is nothing to tune detection on")
    sensor = cell.sensor
    index = {row.number: i for i, row in enumerate(cell.frames)}
    known = cell.truth.frames if cell.truth is not None else ()
    if sensor.profile is None:
        paths = [cell.folder / row.image for row in cell.frames]
        pictures: Pictures | ProfileRecords = Pictures(cell.folder, paths, sensor)
    else:
        pictures = cell_profiles(cell)
    targets = [target_at(cell.target, row.location) for row in cell.frames[:1]]
    return ImageSet(
        title=cell.name or cell.folder.resolve().name,
        pictures=pictures,
        labeller=Labeller(sensor, cell.target if isinstance(cell.target, Jig) else None, settings.calib),
        images=tuple(ImageInfo(row.number, row.location, row.role) for row in cell.frames),
        truth={index[f.frame]: true_strings(f.points) for f in known if f.frame in index and f.points},
        settings=_for_target(settings, targets),
        folder=request.out or cell.folder,
        cell=cell,
    )


def _for_target(settings: Settings, targets: list[Target]) -> Settings:
    """With the feature that the target is, where the recipe asks for none."""
    target = targets[0] if targets else None
    if settings.measure != MeasureConfig() or not isinstance(target, Surface):
        return settings
    if isinstance(target, Sphere):
        return replace(settings, measure=MeasureConfig(feature="sphere", diameter_mm=_diameter(target)))
    kinds = ("plane", "edge", "wedge")
    kind = next((k for k in kinds if k == target.kind), None)
    return settings if kind is None else replace(settings, measure=MeasureConfig(feature=kind))


def _diameter(ball: Sphere) -> float | None:
    return ball.diameter_mm if ball.known else None


def _bare(found: BareImages, request: ImageRequest, settings: Settings, plane_known: bool = True) -> ImageSet:
    for path in request.inputs:
        if not path.exists():
            raise InputError(f"{path}: no such file or folder")
    if len(found.paths) > MAX_IMAGES:
        raise InputError(f"{len(found.paths)} images are more than the {MAX_IMAGES} that one window holds")
    folder = _common_folder(found.paths)
    if request.watch and (len(request.inputs) != 1 or not request.inputs[0].is_dir()):
        raise InputError("--watch takes one folder of images")
    sensor = found.sensor
    return ImageSet(
        watched=WatchedFolder(request.inputs[0], LOSSY_SUFFIXES, {p.name for p in found.paths})
        if request.watch
        else None,
        title=folder.name,
        pictures=Pictures(folder, found.paths, sensor if plane_known else None),
        labeller=Labeller(sensor, found.jig, settings.calib),
        images=tuple(ImageInfo(i) for i in range(len(found.paths))),
        truth={},
        settings=settings,
        folder=request.out or folder,
        plane_known=plane_known,
        skipped=_skipped(request, found.paths),
    )


def _pixels_only(request: ImageRequest) -> BareImages:
    """Images whose sensor nobody named: their own sizes and levels are all that is known."""
    paths = _listed(request, LOSSY_SUFFIXES)
    if not paths:
        raise InputError(f"{request.inputs[0]}: the folder holds no PNG, TIFF or BMP images")
    if request.jig is not None or request.what == "strings":
        raise InputError("strings are named in the laser plane: they need --sensor FILE")
    return BareImages(tuple(paths), sensor_of_picture(paths[0]), None)


def _common_folder(paths: Sequence[Path]) -> Path:
    return Path(os.path.commonpath([Path(folder).resolve() for folder in {os.path.dirname(p) for p in paths}]))


def _listed(request: ImageRequest, suffixes: tuple[str, ...]) -> list[Path]:
    out: list[Path] = []
    for path in request.inputs:
        if not path.exists():
            raise InputError(f"{path}: no such file or folder")
        inside = files_of(path) if path.is_dir() else [path]
        out += [p for p in inside if p.suffix.lower() in suffixes]
    return out


def _skipped(request: ImageRequest, taken: tuple[Path, ...]) -> tuple[str, ...]:
    """A sentence for each file of the folders that is no image, settings aside."""
    known = {*map(str, taken)}
    inside = [p for folder in request.inputs if folder.is_dir() for p in files_of(folder)]
    others = [p for p in inside if str(p) not in known and p.suffix.lower() != ".toml"]
    return tuple(f"{p.name}: is no image by its name, left out" for p in others[:100])


def _profile_files(request: ImageRequest) -> list[Path]:
    """Profile files where no image is named: those given, or those of the folders given."""
    first = request.inputs[0]
    if first.suffix == ".toml" or (first / "cell.toml").exists():
        return []
    out: list[Path] = []
    for path in request.inputs:
        if path.is_dir():
            inside = files_of(path)
            if any(p.suffix.lower() in LOSSY_SUFFIXES for p in inside):
                return []
            out += [p for p in inside if p.suffix.lower() in PROFILE_ENDS]
        elif path.is_file() and is_profile_file(path):
            out.append(path)
        else:
            return []
    return out


def _profiles(paths: list[Path], request: ImageRequest, settings: Settings) -> ImageSet:
    if len(paths) > MAX_IMAGES:
        raise InputError(f"{len(paths)} profiles are more than the {MAX_IMAGES} that one window holds")
    if request.watch:
        raise InputError("--watch takes one folder of images")
    sensor = Sensor(Sheet(), profile=ProfileOutput()) if request.sensor is None else find_sensor(str(request.sensor))
    folder = _common_folder(paths)
    records = bare_profiles(folder, paths, request.sensor, sensor)
    return ImageSet(
        title=folder.name,
        pictures=records,
        labeller=Labeller(sensor, None, settings.calib),
        images=tuple(ImageInfo(i) for i in range(len(records))),
        truth={},
        settings=replace(settings, what="stripe"),
        folder=request.out or folder,
    )


def _of_board(request: ImageRequest, settings: Settings) -> ImageSet:
    folder = request.inputs[0]
    if len(request.inputs) != 1 or not folder.is_dir():
        raise InputError("pictures of a board are opened as one folder")
    said: list[str] = []
    board = read_board(request.board or folder / BOARD_FILE)
    views = find_views(folder, said.append)
    paths = list(dict.fromkeys(p for v in views for p in (v.board, v.stripe) if p is not None))
    index = {path: i for i, path in enumerate(paths)}
    names = {index[p]: v.name for v in views for p in (v.board, v.stripe) if p is not None}
    known = None if request.sensor is None else find_sensor(str(request.sensor))
    sensor = known or picture_sensor(tuple(paths[:1]))
    return ImageSet(
        title=folder.resolve().name,
        pictures=Pictures(folder, paths, sensor),
        labeller=Labeller(sensor, None, settings.calib),
        images=tuple(ImageInfo(i, names[i]) for i in range(len(paths))),
        truth={},
        settings=replace(settings, what="stripe"),
        folder=request.out or folder,
        board=board,
        board_of={index[v.stripe]: index[v.board] for v in views if v.stripe is not None},
        plane_known=known is not None,
        skipped=tuple(said),
    )
