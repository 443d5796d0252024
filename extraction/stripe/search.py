"""The search for stripes in an image: ridges of all scales, along columns or rows, each ridge once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from extraction.stripe.chain import Chain, follow
from extraction.stripe.ridge import FLANK, Level, find_nodes, halve
from geometry.compiled import kernel

Array = NDArray[np.float64]

NODE_SIGMA = 1.5  # of a node: the chain decides, not the node
_LEAST_ROWS = 6  # of a level that can show a ridge
_SAME = 1.5  # level pixels between two chains on one ridge
_SHARE = 0.5  # of a chain's sections on another's ridge, from which it is the same
MOST_CHAINS = 48  # looked at, most light first; a lamp-lit board has a hundred


@dataclass(frozen=True)
class Search:
    """What was found along one direction: chains, best first; whether a section is an image row."""

    chains: list[Chain]
    turned: bool

    @property
    def evidence(self) -> float:
        """The light of all chains, the largest counting most: many small ones are texture."""
        return float(np.sqrt(sum(c.evidence**2 for c in self.chains)))


class Pyramid:
    """Levels of one image, made when they are asked for; both directions share them."""

    def __init__(self, grey: NDArray[Any]) -> None:
        self._grey = grey
        self._levels: list[Level] = []

    def level(self, scale: int) -> Level:
        """The means of scale × scale pixels."""
        while 2 ** len(self._levels) < scale:
            self._levels.append(halve(self._levels[-1] if self._levels else self._grey))
        return self._levels[scale.bit_length() - 2]

    def narrow(self, step: int, turned: bool) -> Level:
        """The means of ``step`` sections, row by row: for faint stripes on a ground that is rough at larger scales."""
        grey = np.ascontiguousarray(self._grey.T) if turned else self._grey
        out = np.empty((grey.shape[0], grey.shape[1] // step), np.float32)
        _mean_of_sections(grey, step, out)
        return out


def search(pyramid: Pyramid, scales: tuple[int, ...], turned: bool) -> Search:
    """The ridges of these scales along one direction, each once."""
    chains: list[Chain] = []
    for scale in scales:
        level = pyramid.level(scale)
        chains += _of_level(np.ascontiguousarray(level.T) if turned else level, scale, scale)
    return Search(each_once(chains), turned)


def search_faint(pyramid: Pyramid, found: Search) -> Search:
    """The same with chains at one row by some sections, where that shows more than squares do."""
    return Search(each_once(found.chains + _of_level(pyramid.narrow(4, found.turned), 1, 4)), found.turned)


def _of_level(level: Level, scale: int, step: int) -> list[Chain]:
    if level.shape[0] < _LEAST_ROWS or level.shape[1] < 1:
        return []
    return follow(find_nodes(level, np.sqrt(scale * step), NODE_SIGMA), scale, step)


def each_once(chains: list[Chain]) -> list[Chain]:
    """Chains without those that lie on the ridge of a better one, most light first.

    The better of two on one ridge has more light times significance: a plateau's middle beats its edges, and of two
    scales the one of better signal to noise gives place and ends.
    """
    kept: list[Chain] = []
    most = sorted(chains, key=lambda c: (-round(c.evidence, 6), c.scale, c.section[0], c.place[0]))[:MOST_CHAINS]
    for chain in sorted(most, key=lambda c: (-round(c.light * c.significance, 6), c.scale, c.section[0], c.place[0])):
        free = np.ones(len(chain.section), dtype=bool)
        for other in kept:
            inside = (chain.section >= other.section[0] - other.step) & (
                chain.section <= other.section[-1] + other.step
            )
            if inside.any():
                off = np.abs(chain.place - np.interp(chain.section, other.section, other.place))
                free &= ~inside | (off > _SAME * (1 + 0.25 * FLANK) * max(chain.scale, other.scale))
        if free.mean() > _SHARE:
            kept.append(chain)
    return sorted(kept, key=lambda c: -round(c.evidence, 6))


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
