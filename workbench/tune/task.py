"""What is tuned: the images in memory, split into a part to train on and a part held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from pydantic import BaseModel

from geometry import InputError, PerceptronEmuError
from workbench.files.images import Image
from workbench.tune.score import FrameScore, against_truth, by_consistency
from workbench.window.detector import Detector
from workbench.window.session import Opened

LEAST_IMAGES = 4


@dataclass(frozen=True, eq=False)
class Task:
    """Images by index, which of them to train on and which are held out; ``skipped``: why an image is in neither."""

    opened: Opened
    detector: Detector
    images: dict[int, Image]
    train: tuple[int, ...]
    held_out: tuple[int, ...]
    skipped: dict[int, str]

    @property
    def has_truth(self) -> bool:
        """Whether errors are against truth."""
        return bool(self.opened.truth)

    def score(self, index: int, config: BaseModel) -> FrameScore:
        """Extract and label one image, and score it."""
        view = self.detector.stages(self.images[index], config)
        labels = self.detector.label(index, view.points) if self.detector.strings else None
        if self.has_truth:
            return against_truth(self.opened.truth[index], view.points, labels)
        if labels is None or self.detector.jig is None:
            raise InputError("without truth.json a search needs the jig's geometry: give --jig FILE")
        return by_consistency(self.detector.jig, labels)

    def scores(self, part: Sequence[int], config: BaseModel) -> list[FrameScore]:
        """Every image of a part."""
        return [self.score(i, config) for i in part]


def make_task(opened: Opened, seed: int) -> Task:
    """Read the images and split them evenly, each location for itself, by ``seed``."""
    images, skipped = _images(opened)
    if len(images) < LEAST_IMAGES:
        why = f" ({next(iter(skipped.values()))})" if skipped else ""
        raise InputError(f"only {len(images)} images can be used, a search needs at least {LEAST_IMAGES}{why}")
    if opened.truth:
        for i in [i for i in images if i not in opened.truth]:
            skipped[i] = f"{opened.pictures.name(i)}: is not in truth.json"
            del images[i]
    if not opened.truth and not opened.engine.strings:
        raise InputError("without truth.json a search needs the jig's geometry: give --jig FILE")
    train, held_out = split([opened.frames[i].location for i in images], list(images), seed)
    return Task(opened, cast("Detector", opened.engine), images, train, held_out, skipped)


def _images(opened: Opened) -> tuple[dict[int, Image], dict[int, str]]:
    images: dict[int, Image] = {}
    skipped: dict[int, str] = {}
    for i in range(len(opened.pictures)):
        try:
            images[i] = opened.pictures.read(i)
        except PerceptronEmuError as error:
            skipped[i] = str(error)
    return images, skipped


def split(locations: Sequence[str], indices: Sequence[int], seed: int) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Two halves of ``indices``, each location dealt out in turn after a shuffle by ``seed``."""
    rng = np.random.default_rng(seed)
    shuffled = rng.permutation(len(indices))
    ordered = sorted(shuffled, key=lambda k: locations[k])
    train = tuple(sorted(indices[k] for k in ordered[0::2]))
    return train, tuple(sorted(indices[k] for k in ordered[1::2]))
