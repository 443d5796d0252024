"""One opened folder: its images, the engine, truth, and the answers that were computed lately."""

from __future__ import annotations

import secrets
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from geometry import PerceptronEmuError
from workbench.compare import Comparison, TrueString, match, named_points
from workbench.opened import ImageInfo, ImageRequest, Pictures, ProfileRecords, Stamp
from workbench.window.calibrator import Calibrator, Search
from workbench.window.engine import Engine, ImageAnswer, as_json, process
from workbench.window.parameters import HashedConfig
from workbench.window.truth import comparison_json

_Key = tuple[int, str, int, Stamp]  # image, parameters, epoch of the engine, state of the file
KEPT_OUTCOMES = 8  # with their stage images, some 12 MB each


@dataclass(frozen=True, eq=False)
class Opened:
    """Everything about the folder that does not change while the window is open.

    calibrator: runs calibrations; None where there can be none, and ``no_calibration`` says why. search: looks for
    better parameters; None where it can not. reopen: opens another folder.
    to_toml, from_toml: the settings file that the other commands take. command: the equivalent command line.
    prepare: slow work that makes labels better, done in the background first. look: the images that came meanwhile.
    skipped: files that were left out, a sentence each. plane_known: whether pixels can be carried into the laser plane.
    """

    title: str
    pictures: Pictures | ProfileRecords
    engine: Engine
    frames: tuple[ImageInfo, ...]
    truth: Mapping[int, tuple[TrueString, ...]]
    start: BaseModel
    settings_folder: Path
    to_toml: Callable[[BaseModel], str]
    from_toml: Callable[[str, str], BaseModel]
    command: Callable[[str, str], str]
    calibrator: Calibrator | None = None
    no_calibration: str = ""
    prepare: Callable[[], None] | None = None
    look: Callable[[], list[Path]] | None = None
    skipped: tuple[str, ...] = ()
    plane_known: bool = True
    search: Search | None = None
    reopen: Callable[[ImageRequest], Opened] | None = None


@dataclass(eq=False)
class Session:
    """The opened folder and its recent answers; safe to use from several threads."""

    opened: Opened
    id: str = field(default_factory=lambda: secrets.token_hex(8))  # tells pages of this folder from those of another
    _lock: threading.Lock = field(default_factory=threading.Lock)
    _kept: OrderedDict[_Key, ImageAnswer] = field(default_factory=OrderedDict)
    _one_at_a_time: threading.Lock = field(default_factory=threading.Lock)
    first_answer: threading.Event = field(default_factory=threading.Event)
    _waiting: int = 0
    _last_interactive: float = 0.0

    @contextmanager
    def interactive(self) -> Iterator[None]:
        """Mark work that a person waits for; background work stands aside meanwhile."""
        with self._lock:
            self._waiting += 1
        try:
            yield
        finally:
            with self._lock:
                self._waiting -= 1
                self._last_interactive = time.monotonic()
            self.first_answer.set()

    def idle_for(self) -> float:
        """Seconds since the last interactive work ended; 0 while some is under way."""
        with self._lock:
            return 0.0 if self._waiting else time.monotonic() - self._last_interactive

    def outcome(self, index: int, configuration: HashedConfig) -> ImageAnswer:
        """Process one image for the screen, or give the kept answer; equal questions at one time are worked on once."""
        with self._one_at_a_time:
            return self._outcome(index, configuration, keep=True)

    def warm(self) -> None:
        """Go through the first image, so that the kernels are there when the page asks for it."""
        with self._one_at_a_time:
            self._outcome(0, HashedConfig(self.opened.start, ""), keep=False)

    def background_outcome(self, index: int, configuration: HashedConfig) -> ImageAnswer:
        """As `outcome`, but nothing is kept and nobody waits for it."""
        return self._outcome(index, configuration, keep=False)

    def _outcome(self, index: int, configuration: HashedConfig, keep: bool) -> ImageAnswer:
        """The outcome; an image that can not be processed gives its error as one."""
        opened = self.opened
        try:
            stamp, image = opened.pictures.stamped(index)
            key = (index, configuration.hash, opened.engine.epoch, stamp)
            with self._lock:
                if key in self._kept:
                    self._kept.move_to_end(key)
                    return self._kept[key]
            outcome = process(opened.engine, image, configuration.model, index, configuration.hash)
            outcome = replace(outcome, stamp=str(stamp))
        except PerceptronEmuError as error:
            return ImageAnswer(index, configuration.hash, None, None, str(error), 0.0, self.state_of(index))
        except Exception as error:  # noqa: BLE001 - a fault on one image must not end the work on the others
            text = f"fault of the program: {type(error).__name__}: {error}"
            return ImageAnswer(index, configuration.hash, None, None, text, 0.0, self.state_of(index))
        if keep:
            self._keep(key, outcome)
        return outcome

    def images(self, since: int = 0) -> list[dict[str, Any]]:
        """What the page is told of each image from the ``since``-th on, those that came meanwhile included."""
        frames, pictures = self.opened.frames, self.opened.pictures
        known = [frames[i] if i < len(frames) else ImageInfo(i) for i in range(since, len(pictures))]
        return [
            {"name": pictures.name(since + i), "frame": f.frame, "location": f.location, "role": f.role}
            for i, f in enumerate(known)
        ]

    def take_in(self) -> None:
        """Take in the images that came into a watched folder."""
        if self.opened.look is not None:
            with self._lock:
                self.opened.pictures.add(self.opened.look())

    def state_of(self, index: int) -> str:
        """The state of the image's file now, "" where it is gone."""
        return self.opened.pictures.state(index)

    def _keep(self, key: _Key, outcome: ImageAnswer) -> None:
        with self._lock:
            self._kept[key] = outcome
            while len(self._kept) > KEPT_OUTCOMES:
                self._kept.popitem(last=False)

    def comparison(self, outcome: ImageAnswer) -> Comparison | None:
        """The outcome against the image's truth, where both exist."""
        strings = self.opened.truth.get(outcome.index)
        if strings is None or outcome.view is None:
            return None
        axis = None if outcome.labels is None else outcome.labels.axis
        return match(strings, named_points(outcome.view.points, axis), labelled=axis is not None)

    def row(self, outcome: ImageAnswer) -> dict[str, Any]:
        """The outcome and its comparison with truth for the page."""
        compared = self.comparison(outcome)
        truth = comparison_json(compared) if compared else None
        pictures = self.opened.pictures
        remarks = [] if outcome.error or isinstance(pictures, ProfileRecords) else pictures.remarks(outcome.index)
        return as_json(outcome, self.opened.engine.strings) | {"truth": truth, "remarks": remarks}
