"""The search for stripes in an image: ridges of all scales, along columns or rows, each ridge once."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from extraction.stripe.ridges.chain import CHAIN, Chain, Ridges, follow, ridges_of
from extraction.stripe.ridges.ridge import Level, fall_on, find_nodes, halve
from geometry.compiled import kernel

Array = NDArray[np.float64]

NODE_SIGMA, FAINT_NODE_SIGMA = 2.5, 1.5  # of a node: the chain decides, not the node
_NARROW = 4  # sections by one row
# rows of a mean that keeps blotches and loses a stripe, and of one that loses both: the stripe's σ is 1 to 3 px
_BLOTCH, _SHADE = 9, 41
_LEAST_ROWS = 6  # of a level that can show a ridge
_NOTHING = Ridges(np.empty(0, CHAIN), np.empty(0), np.empty(0), np.empty(0))


@dataclass(frozen=True)
class RidgeSearch:
    """What was found along one direction: chains, best first; whether a section is an image row."""

    chains: list[Chain]
    turned: bool

    @property
    def evidence(self) -> float:
        """The light of all chains, the largest counting most: many small ones are texture."""
        return math.sqrt(sum(c.evidence**2 for c in self.chains))


class Pyramid:
    """Levels of one image, made when they are asked for; both directions share them."""

    def __init__(self, grey: NDArray[Any]) -> None:
        self._grey = grey
        self._levels: list[Level] = []

    def level(self, scale: int, turned: bool) -> Level:
        """The means of scale × scale pixels, sections as columns."""
        while 2 ** len(self._levels) < scale:
            self._levels.append(halve(self._levels[-1] if self._levels else self._grey))
        level = self._levels[scale.bit_length() - 2]
        return np.asarray(cv2.transpose(level), dtype=np.float32) if turned and level.size else level

    def narrow(self, step: int, turned: bool) -> Level:
        """The means of ``step`` sections, row by row: for faint stripes on a ground that is rough at larger scales."""
        grey = np.ascontiguousarray(self._grey.T) if turned else self._grey
        out = np.empty((grey.shape[0], grey.shape[1] // step), np.float32)
        _mean_of_sections(grey, step, out)
        return out


def search(pyramid: Pyramid, scales: tuple[int, ...], turned: bool, threshold: float = NODE_SIGMA) -> list[Ridges]:
    """The ridges of these scales along one direction."""
    return [_of_level(pyramid.level(scale, turned), scale, scale, threshold) for scale in scales]


def search_faint(pyramid: Pyramid, scales: tuple[int, ...], turned: bool) -> list[Ridges]:
    """The same down to nodes in the noise, and at one row by some sections, which shows more on a rough ground."""
    found = search(pyramid, scales, turned, FAINT_NODE_SIGMA)
    narrow = pyramid.narrow(_NARROW, turned)
    found.append(_of_level(narrow, 1, _NARROW, FAINT_NODE_SIGMA))
    if min(narrow.shape) >= _LEAST_ROWS:
        nodes = find_nodes(_without_blotches(narrow), math.sqrt(_NARROW), FAINT_NODE_SIGMA)
        fall_on(narrow, nodes)
        found.append(follow(nodes, 1, _NARROW, _NOTHING.chains))
    return found


def _without_blotches(level: Level) -> Level:
    """The level (H, W) less what its rows have between the means over _BLOTCH and over _SHADE of them.

    What is left is narrow, or as wide as a change of light: the response to it is noise more than ground.
    """
    return np.asarray(level - (_mean_of_rows(level, _BLOTCH) - _mean_of_rows(level, _SHADE)), np.float32)


def _mean_of_rows(level: Level, rows: int) -> Array:
    """Means over so many rows, twice: of what is beyond the border, its last rows again."""
    out, once = np.empty(level.shape), np.empty(level.shape)
    _means(level.astype(float), rows // 2, once)
    _means(once, rows // 2, out)
    return out


@kernel
def _means(values: Array, half: int, out: Array) -> None:
    """Means over 2 half + 1 rows (H, W), by running sums down the columns: row by row, as memory lies."""
    rows, columns = values.shape
    total = np.zeros((rows + 2 * half + 2, columns))  # of what lies before each row, the borders' copies with it
    for r in range(rows + 2 * half + 1):
        row, before, here = values[min(max(r - half - 1, 0), rows - 1)], total[r], total[r + 1]
        for c in range(columns):
            here[c] = before[c] + row[c]
    for r in range(rows):
        low, high = total[r + 1], total[r + 2 * half + 2]
        for c in range(columns):
            out[r, c] = (high[c] - low[c]) / (2 * half + 1)


def _of_level(level: Level, scale: int, step: int, threshold: float) -> Ridges:
    if level.shape[0] < _LEAST_ROWS or level.shape[1] < 1:
        return _NOTHING
    return ridges_of(level, scale, step, threshold, _NOTHING.chains)


@kernel
def _mean_of_sections(grey: NDArray[Any], step: int, out: Level) -> None:
    rows, sections = out.shape
    share = np.float32(1.0 / step)
    for r in range(rows):
        for c in range(sections):
            total = np.float32(0.0)
            for k in range(step):
                total += np.float32(grey[r, c * step + k])
            out[r, c] = share * total
