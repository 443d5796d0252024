"""Which stripe has the point of a section where several do: by light, by place, by length, or all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from extraction.config import StripeConfig
from extraction.stripe.places import Places, StripeFacts

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_ALIKE = 0.05  # of the longest stripe, that two lengths may differ


def select(config: StripeConfig, stripes: list[StripeFacts], places: Places, place: Array, height: Array) -> Indices:
    """Indices of the chosen points: one a section, or both of a pair with "stripe", or all with "all".

    place: position along the section [px]. height: amplitude [DN]. A whole stripe is preferred to another, not a point
    to a point, and a ghost never: it is chosen where nothing else is.
    """
    rule = config.select
    everything = np.arange(len(places))
    if rule == "all" or len(places) == 0 or np.all(places.section[1:] > places.section[:-1]):
        return everything
    ghost = np.array([s.ghost for s in stripes])[places.stripe]
    if rule in ("first", "last"):
        key = place if rule == "first" else -place
    else:
        key = _order(stripes, places, height, longest=rule == "continuous")[places.stripe]
    order = np.lexsort((key, ghost, places.section))
    first = np.r_[True, places.section[order][1:] != places.section[order][:-1]]
    if rule != "stripe":
        return np.asarray(order[first])
    pair = np.array([s.pair for s in stripes])[places.stripe]
    best = pair[order[first]][np.cumsum(first) - 1]  # that of the section's best, for each in order
    return np.asarray(np.sort(order[pair[order] == best]))


def _order(stripes: list[StripeFacts], places: Places, height: Array, longest: bool) -> Array:
    """A number for each stripe, smaller for the one that is preferred: the brighter, or the longer.

    Lengths within a twentieth of the longest count as alike; then the brighter is preferred.
    """
    sections = np.bincount(places.stripe, minlength=len(stripes)).astype(float)
    light = np.bincount(places.stripe, weights=height, minlength=len(stripes))
    if not longest:
        return np.round(-light, 6)
    steps = np.floor(sections / max(float(sections.max()), 1.0) / _ALIKE)
    return np.asarray(-steps - light / (2 * max(float(light.max()), 1.0)))
