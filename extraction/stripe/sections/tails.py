"""Tails: the sections beyond an end of a stripe that still hold light of it.

An end is where the light has fallen to half. On a surface that turns away it falls over many sections, and the lens
blurs every end over some: those sections are no stripe of their own, but they tell where the surface ends.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.order import median_of
from extraction.stripe.sections.model import Records
from extraction.stripe.view import IntArray
from geometry.compiled import kernel

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

_FEWEST, _INSIDE = 8, 20  # points of a piece that may have a tail; whose light a tail does not reach
_FARTHEST = 40  # sections beyond an end: a bend's flank at a tenth of its face's light has some twenty
_MISSED = 2  # dark sections in a row that end a tail: a grain of speckle hides one
_DIRECTION, _STEEPEST = 4, 4.0  # sections that point the way; px a section at most
_SHIFTS = 3  # of a section's place to the centre of its light: a bend's flank sets on at an angle
_LIT = 3.0  # of a section's light over its own noise
_LEAST_SNR = 3.0  # of a fitted section: fainter ones are taken for bright by chance
_NEAR_PX, _NEAR_WIDTHS = 1.0, 0.8  # from the walk, that a section's fit may end
_APART = 3.0  # widths from another stripe's point in the section, from which the walk is still on its own


class SectionPoints(NamedTuple):
    """Points of stripes (N,), by section: section, centre [px], Gaussian σ [px], light [DN px], piece."""

    section: IntArray
    centre: Array
    width: Array
    light: Array
    piece: IntArray


class TailPlaces(NamedTuple):
    """Sections beyond ends (M,), outwards end by end: section, about where and how wide [px], the end's index among
    the points, the light inside [DN px].
    """

    section: IntArray
    centre: Array
    width: Array
    end: Indices
    inside: Array


@kernel
def walk_tails(grey: NDArray[Any], points: SectionPoints, noise_dn: float) -> TailPlaces:
    """Where light goes on beyond the ends of every piece, section by section. noise_dn: σ of a dark pixel."""
    section, centre, width, light, piece = points
    n, sections = len(section), grey.shape[1]
    pieces = 0
    for k in piece:
        pieces = max(pieces, k + 1)
    room = 2 * pieces * _FARTHEST
    out = TailPlaces(
        np.empty(room, np.int32), np.empty(room), np.empty(room), np.empty(room, np.int64), np.empty(room)
    )  # fmt: skip
    own, some, track = np.empty(n, np.int64), np.empty(_INSIDE), np.empty(_FARTHEST + _DIRECTION + 1)
    total = 0
    for k in range(pieces):
        count = 0
        for i in range(n):
            if piece[i] == k:
                own[count] = i
                count += 1
        if count < _FEWEST:
            continue
        for side in (-1, 1):
            last = own[count - 1] if side > 0 else own[0]
            m, wide = min(count, _INSIDE), 0.0
            for j in range(m):
                some[j] = light[own[count - 1 - j] if side > 0 else own[j]]
            inside = median_of(some, 0, m)
            for j in range(_DIRECTION + 1):  # oldest first
                i = own[count - 1 - _DIRECTION + j] if side > 0 else own[_DIRECTION - j]
                track[j] = centre[i]
            slope = (track[_DIRECTION] - track[0]) / _DIRECTION
            for j in range(_DIRECTION):
                wide += width[own[count - 1 - j] if side > 0 else own[j]] / _DIRECTION
            wide /= math.sqrt(1.0 + slope * slope)
            at, lit_until, dark = _DIRECTION, total, 0
            for step in range(1, _FARTHEST + 1):
                s = section[last] + side * step
                if s < 0 or s >= sections or dark > _MISSED:
                    break
                slope = min(max((track[at] - track[at - _DIRECTION]) / _DIRECTION, -_STEEPEST), _STEEPEST)
                here = wide * math.sqrt(1.0 + slope * slope)
                place, lit = _centre_of_light(grey, s, track[at] + slope, here, noise_dn)
                if not _alone(section, centre, s, place, _APART * here):
                    break
                at += 1
                track[at] = place
                j = total + step - 1
                out.section[j], out.centre[j], out.width[j] = s, place, here
                out.end[j], out.inside[j] = last, inside
                dark = 0 if lit else dark + 1
                if lit:
                    lit_until = j + 1
            total = lit_until
    return TailPlaces(out.section[:total], out.centre[:total], out.width[:total], out.end[:total], out.inside[:total])


@kernel
def _centre_of_light(grey: NDArray[Any], s: int, c: float, width: float, noise_dn: float) -> tuple[float, bool]:
    """The place ``c`` of a section drawn to the centre of the light about it, as far as it is sure, and whether there
    is any.
    """
    rows, half, place = grey.shape[0], 2.0 * width + 0.5, c
    total, least = 0.0, 1.0
    for _ in range(_SHIFTS):
        low, high = math.ceil(place - half), math.floor(place + half)
        if low - 2 < 0 or high + 2 > rows - 1:
            return c, False
        base = 0.25 * (float(grey[low - 1, s]) + float(grey[low - 2, s]))
        base += 0.25 * (float(grey[high + 1, s]) + float(grey[high + 2, s]))
        total, moment, n = 0.0, 0.0, high - low + 1
        for r in range(low, high + 1):
            g = float(grey[r, s]) - base
            total, moment = total + g, moment + g * (r - place)
        least = _LIT * noise_dn * math.sqrt(n + 0.25 * n * n)
        if not total > 0.5 * least:
            return c, False
        place += min(max(moment / total, -width), width)
    if not total > least:
        return c, False
    return c + (place - c) * total * total / (total * total + least * least), True


@kernel
def _alone(section: IntArray, centre: Array, s: int, place: float, apart: float) -> bool:
    """Whether no point of a stripe in section ``s`` lies within ``apart`` of the place."""
    i = np.searchsorted(section, s)
    while i < len(section) and section[i] == s:
        if abs(centre[i] - place) < apart:
            return False
        i += 1
    return True


@kernel
def tails_kept(places: TailPlaces, fits: Records, least_snr: float, least_amplitude: float) -> Indices:
    """Indices of the fitted tail sections (M,) that hold the stripe's light, as far out as they do."""
    out, kept, missed = np.empty(len(fits), np.int64), 0, 0
    for i in range(len(fits)):
        if i == 0 or places.end[i] != places.end[i - 1] or abs(places.section[i] - places.section[i - 1]) != 1:
            missed = 0
        row = fits[i]
        near = abs(row.centre - places.centre[i]) <= _NEAR_PX + _NEAR_WIDTHS * max(row.width, places.width[i])
        seen = row.amplitude >= least_amplitude and row.snr >= max(least_snr, _LEAST_SNR)
        fainter = row.amplitude * row.width <= places.inside[i]
        if row.converged and near and seen and fainter and np.isfinite(row.variance) and missed <= _MISSED:
            out[kept] = i
            kept, missed = kept + 1, 0
        else:
            missed += 1
    return out[:kept]
