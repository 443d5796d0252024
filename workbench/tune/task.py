"""What is tuned: the images in memory, split into a part to train on and a part held out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from extraction import ExtractionConfig, extract
from geometry import InputError, PerceptronEmuError
from workbench.compare import match, named_points
from workbench.files import Image
from workbench.opened import ImageSet
from workbench.tune.cost import FrameCost, against_truth, by_consistency

LEAST_IMAGES = 4  # two to train on, two held out
NO_JIG = "without truth.json a search needs the jig's geometry: give --jig FILE"


@dataclass(frozen=True, eq=False)
class Task:
    """Images by index, which of them to train on and which are held out; ``skipped``: why an image is in neither."""

    source: ImageSet
    images: dict[int, Image]
    train: tuple[int, ...]
    held_out: tuple[int, ...]
    skipped: dict[int, str]

    @property
    def has_truth(self) -> bool:
        """Whether errors are against truth."""
        return bool(self.source.truth)

    def score(self, index: int, config: ExtractionConfig) -> FrameCost:
        """Extract and label one image, and score it."""
        labeller = self.source.labeller
        points = extract(self.images[index], labeller.sensor, config)
        labels = labeller.label(index, points) if labeller.strings else None
        if self.has_truth:
            axis = None if labels is None else labels.axis
            named = named_points(points, axis)
            return against_truth(match(self.source.truth[index], named, labelled=axis is not None))
        if labels is None or labeller.jig is None:
            raise InputError(NO_JIG)
        return by_consistency(labeller.jig, labels)

    def scores(self, part: Sequence[int], config: ExtractionConfig) -> list[FrameCost]:
        """Every image of a part."""
        return [self.score(i, config) for i in part]


def make_task(source: ImageSet, seed: int) -> Task:
    """Read the images and split them evenly, each location for itself.

    Parameters
    ----------
    source
        Images with truth, or with a jig by whose geometry they are judged.
    seed
        Of the split.

    Returns
    -------
    Task
        Images in memory, half of them to train on, half held out.

    Raises
    ------
    InputError
        Where fewer than LEAST_IMAGES can be used, or neither truth nor jig is there.

    """
    images, skipped = _read(source)
    if len(images) < LEAST_IMAGES:
        why = f" ({next(iter(skipped.values()))})" if skipped else ""
        raise InputError(f"only {len(images)} images can be used, a search needs at least {LEAST_IMAGES}{why}")
    if source.truth:
        for i in [i for i in images if i not in source.truth]:
            skipped[i] = f"{source.pictures.name(i)}: is not in truth.json"
            del images[i]
    if not source.truth and not source.labeller.strings:
        raise InputError(NO_JIG)
    train, held_out = split([source.images[i].location for i in images], list(images), seed)
    return Task(source, images, train, held_out, skipped)


def _read(source: ImageSet) -> tuple[dict[int, Image], dict[int, str]]:
    images: dict[int, Image] = {}
    skipped: dict[int, str] = {}
    for i in range(len(source.pictures)):
        try:
            images[i] = source.pictures.read(i)
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
