"""Which ridges are stripe: joined, ended, judged against each other by light, width, length, shape and contrast."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from extraction.stripe.ridges import Chain
from extraction.stripe.verdict.measure import measure, middle
from extraction.stripe.verdict.track import Bumps, Track

Array = NDArray[np.float64]

# A ridge is held against the one with the most light (its light times its length) of the image.
PART = 0.09  # of that light, below which a ridge is texture, glare or a scratch
PART_JOINED = 0.004  # the same for one that goes on where the other ends
DIMMER = 0.22  # of the best ridge's own height, below which a ridge elsewhere is no stripe of the same laser
LEAST_CONTRAST, ENOUGH_CONTRAST = 0.65, 12.0  # of the best's response over its noise, that counted up to the second
LEAST_ASPECT = 6.0  # its length over its full width
CLEAR_ASPECT = 4.0  # the same of a ridge that stands out as the best one does, section by section and as a whole
NARROW = 0.5  # of a clear stripe's significance, that a ridge has at least which narrow rows alone show
FLAT = 0.6  # flatness of an unclipped profile from which it is a lit face with borders, not a pulse of light
FLAT_FROM_PX = 2.6  # Gaussian σ from which flatness shows: blur rounds what is narrower
CROWD = 2.6  # ridges of like light beside one another, on average: a pattern, not stripes
CROWD_PART = 0.15  # of the best's height times length, that such a ridge has at least
# of a short ridge's significance, from which refused ones are its like, and how many such make it one of the texture:
# the best of a dozen chance ridges is 1.4 times the middle one, a piece of a stripe among them 2 to 4 times
TEXTURE_LIKE, TEXTURE = 0.6, 6
# of the stripe's width, at most, where it is dark, and noise on it: a border's glow is wider; and of its width where it
# is clipped, which is that of its foot
DARK_WIDTH, DARK_CLIPPED = 1.15, 0.75
# of the best ridge's width, and pixels beside, from which another is no stripe of the same laser out of focus, unless
# it is brighter by that factor: clipped light is wide
WIDER, WIDER_PX, BRIGHTER = 2.0, 1.0, 1.3
FILLS = 0.6  # of the best ridge's height, that a short one in a gap of the stripe has, and of its own, that none has
LEAST_JOINED, ASKED_JOINED = 3.0, 0.8  # contrast of a ridge that goes on where a stripe ends; of that asked elsewhere
LIKE = 0.45  # of a ridge's light and height, from which another is its like
GHOST_LIGHT = 0.2  # of a brighter ridge's height, from which a longer one is the stripe and the brighter its ghost
GHOST_TOTAL = 0.6  # of the brighter one's height times length, that the longer one has at least
GHOST_LONGER = 0.1  # of the shorter ridge's length, that the longer one goes on for
SAME_PX = 1.0  # beside a stripe's σ, within which another track is the same
JOIN_GAP, JOIN_PX = 60.0, 3.0  # sections between two pieces of one stripe, and how far off their lines may pass
JOIN_ABOUT_PX = 24.0  # between two ends that may be one stripe's, beside twice the gap


@dataclass(frozen=True, eq=False)
class Stripe:
    """One ridge that may be stripe.

    track: at every section from its first to its last. chain: the ridge it came from. bumps: of its mean profile; with
    two, the track runs between or on one of them. height: of the mean profile [DN]. light: height times sections.
    dark: whether it lies between two lit pieces of
    one ridge. least: sections from which it may stand alone. rivals: whether another of like light shares its
    sections. ghost: whether a longer one does.
    """

    track: Track
    chain: Chain
    bumps: Bumps
    height: float
    rivals: bool = False
    ghost: bool = False
    joined: bool = False
    least: int = 20
    dark: bool = False

    @property
    def light(self) -> float:
        """Height times length."""
        return self.height * len(self.track.place)


@dataclass(frozen=True, eq=False)
class StripeVerdict:
    """The stripes, most light first; ridges that were measured and refused; how many were for each reason."""

    stripes: list[Stripe]
    others: list[Stripe]
    refused: dict[str, int]


def judge(grey: NDArray[Any], chains: list[Chain], clip: float, max_width: float, least_sections: int) -> StripeVerdict:
    """The stripes among the ridges of one direction. grey: sections are columns."""
    refused: dict[str, int] = {}

    def refuse(reason: str, n: int = 1) -> None:
        if n:
            refused[reason] = refused.get(reason, 0) + n

    if not chains:
        return StripeVerdict([], [], refused)
    least = PART_JOINED * chains[0].evidence
    measured: list[Stripe] = []
    flat: list[Stripe] = []
    for chain in chains:
        weak = chain.evidence < PART * chains[0].evidence and chain.light < chains[0].light
        if chain.evidence < least or (weak and not any(_near_end(chain, k.chain) for k in measured)):
            refuse("faint")
            continue
        pieces = _measure(grey, chain, clip, least_sections)
        if not pieces:
            refuse("no_peak")
        for piece in pieces:
            if piece.bumps.width > max_width:
                refuse("too_wide")
            elif piece.bumps.flat > FLAT and piece.bumps.width > FLAT_FROM_PX:
                refuse("flat")
                flat.append(piece)
            else:
                measured.append(piece)
    measured = _each_once(sorted(measured, key=lambda s: (s.dark, -round(s.light, 3), s.track.first)))
    measured = _ghosts(measured)
    best = next((s for s in measured if not (s.ghost or s.dark) and _stands_alone(s)), None)
    if best is None:
        refuse("short", len(measured))
        return StripeVerdict([], [], refused)
    if _crowding(best, measured + flat) >= CROWD:
        refuse("one_of_many", len(measured))
        return StripeVerdict([], [], refused)
    kept: list[Stripe] = [best]
    asked = _asked_contrast(best)
    waiting = [s for s in measured if s is not best]

    def bright(s: Stripe) -> bool:
        enough = s.light >= PART * best.light and s.height >= DIMMER * best.height and s.chain.contrast >= asked
        clear = s.chain.contrast >= best.chain.contrast and 2 * s.chain.significance >= best.chain.significance
        # what narrow rows alone show has another noise: beside a clear stripe its contrast says little
        alike = best.chain.narrow or not s.chain.narrow or s.chain.significance >= NARROW * best.chain.significance
        alike &= not s.dark and not _wider(s, best)
        return enough and alike and _stands_alone(s, CLEAR_ASPECT if clear else LEAST_ASPECT)

    texture = [s for s in waiting + flat if not bright(s)]
    changed = True
    while changed:
        changed = False
        for s in list(waiting):
            joined = any(_continues(s, k) for k in kept if not k.ghost)
            joined &= not _wider(s, best) and (not s.dark or _dark_part(s, kept))
            alike = sum(
                k.chain.significance >= TEXTURE_LIKE * s.chain.significance and not _wider(k, s) for k in texture
            )
            if (joined and s.chain.contrast >= max(LEAST_JOINED, ASKED_JOINED * asked)) or (
                alike < TEXTURE and (bright(s) or (s.chain.contrast >= asked and _fills(s, best, kept, waiting)))
            ):
                kept.append(replace(s, joined=True) if joined else s)
                waiting.remove(s)
                changed = True
    refuse("weak_beside_the_stripe", len(waiting))
    return StripeVerdict(sorted(_rivalry(kept), key=lambda s: -s.light), waiting + flat, refused)


def _wider(s: Stripe, best: Stripe) -> bool:
    """Whether a ridge is far wider than the best one, and no brighter: a lit face, or a border's glow."""
    return s.height <= BRIGHTER * best.height and s.bumps.width > WIDER * best.bumps.width + WIDER_PX


def _fills(s: Stripe, best: Stripe, kept: list[Stripe], waiting: list[Stripe]) -> bool:
    """Whether a short ridge, as high and as wide as the best, is the only one in a gap between pieces of the stripe."""
    if s.dark or s.ghost or _wider(s, best) or _wider(best, s) or not _stands_alone(s, CLEAR_ASPECT):
        return False
    pieces, length = [k for k in kept if not k.ghost], len(s.track.place)
    inside = any(k.track.stop <= s.track.first for k in pieces) and any(k.track.first >= s.track.stop for k in pieces)
    if not inside or s.height < FILLS * best.height or any(_overlap(s, k) > 0.2 * length for k in pieces):
        return False
    return all(k is s or k.height < FILLS * s.height or _overlap(s, k) < 0.5 * length for k in waiting)


def _dark_part(s: Stripe, kept: list[Stripe]) -> bool:
    """Whether what is dark of a ridge shows by itself, as narrow as its lit pieces, and narrower than clipped ones."""
    lit = [k for k in kept if k.chain is s.chain and not k.dark]
    if not lit or s.bumps.peaks != 1:
        return False
    share = s.height / max(k.height for k in lit)
    widest = max((DARK_WIDTH if k.bumps.flat > 0 else DARK_CLIPPED) * k.bumps.width for k in lit)
    return share * s.chain.contrast >= LEAST_JOINED and s.bumps.width <= widest


def _near_end(chain: Chain, k: Chain) -> bool:
    """Whether a chain begins or ends about where a longer one does: worth a look whether it goes on there."""
    if k.evidence < chain.evidence:
        return False
    for a, b in ((chain, k), (k, chain)):
        gap = float(b.section[0] - a.section[-1])
        if -2 * b.step <= gap <= JOIN_GAP and abs(float(b.place[0] - a.place[-1])) <= JOIN_ABOUT_PX + 2 * abs(gap):
            return True
    return False


def _asked_contrast(best: Stripe) -> float:
    return LEAST_CONTRAST * min(best.chain.contrast, ENOUGH_CONTRAST)


def _crowding(best: Stripe, everything: list[Stripe]) -> float:
    """How many ridges not far below the best one lie beside one another, on average over the sections they cover.

    Those that the best one goes on beside do not count: a stripe beside a pattern is a stripe.
    """
    alike = [
        s
        for s in everything
        if s is best
        or (
            s.height >= LIKE * best.height
            and s.light >= CROWD_PART * best.light
            and not _goes_on(best, s, _ridge_of(s, everything))
        )
    ]
    covered = np.zeros(max(s.track.stop for s in alike))
    for s in alike:
        covered[s.track.first : s.track.stop] += 1
    return float(covered.sum() / np.count_nonzero(covered))


def _measure(grey: NDArray[Any], chain: Chain, clip: float, least: int) -> list[Stripe]:
    """A chain's pieces, each a track with its ends."""
    track, found = measure(grey, chain, clip)
    pieces = []
    for piece in found:
        own, (a, b) = track.width[piece.start : piece.stop], middle(0, piece.stop - piece.start)
        width = own * (piece.bumps.width / float(own[a:b].mean()))
        place = Track(track.first + piece.start, track.place[piece.start : piece.stop], width)
        pieces.append(Stripe(place, chain, piece.bumps, piece.bumps.height, least=least, dark=piece.dark))
    return pieces


def _stands_alone(s: Stripe, aspect: float = LEAST_ASPECT) -> bool:
    length = len(s.track.place)
    return length >= s.least and length >= aspect * 2.3548 * s.bumps.width


def _overlap(a: Stripe, b: Stripe) -> int:
    return max(0, min(a.track.stop, b.track.stop) - max(a.track.first, b.track.first))


def _each_once(stripes: list[Stripe]) -> list[Stripe]:
    """Without those that lie on a brighter one's track over half of their sections, and the rest less what lies there.

    Chains of one ridge may meet only in part, and a ridge that is followed beyond its end may run onto another.
    """
    out: list[Stripe] = []
    for s in stripes:
        on = np.zeros(len(s.track.place), np.bool_)
        for k in out:
            start, stop = max(s.track.first, k.track.first), min(s.track.stop, k.track.stop)
            if stop > start:
                mine = s.track.place[start - s.track.first : stop - s.track.first]
                theirs = k.track.place[start - k.track.first : stop - k.track.first]
                near = np.abs(mine - theirs) < SAME_PX + max(s.bumps.width, k.bumps.width)
                on[start - s.track.first : stop - s.track.first] |= near
        if not on.any():
            out.append(s)
        elif np.count_nonzero(on) < 0.5 * len(on):
            out.append(_cut_to(s, *_longest_free(on)))
    return out


def _longest_free(on: NDArray[np.bool_]) -> tuple[int, int]:
    """The stretch start … stop - 1 with the most sections that are free over those that are not."""
    total = np.concatenate([[0], np.cumsum(np.where(on, -1, 1))])
    least = np.minimum.accumulate(total)
    stop = int(np.argmax(total - least))
    return int(np.argmin(total[: stop + 1])), stop


def _cut_to(s: Stripe, start: int, stop: int) -> Stripe:
    track = Track(s.track.first + start, s.track.place[start:stop], s.track.width[start:stop])
    return replace(s, track=track)


def _ghosts(stripes: list[Stripe]) -> list[Stripe]:
    """Ridges marked as ghost: they begin or end beside one that goes on."""
    reach = [_ridge_of(b, stripes) for b in stripes]
    return [
        replace(b, ghost=True) if any(a is not b and _goes_on(a, b, r) for a in stripes) else b
        for b, r in zip(stripes, reach, strict=True)
    ]


class _Ridge(NamedTuple):
    """A ridge from end to end: sections first … stop - 1, how many of them its lit pieces hold, and their light."""

    first: int
    stop: int
    sections: int
    light: float


def _ridge_of(s: Stripe, stripes: list[Stripe]) -> _Ridge:
    """The ridge that a piece is of: a shadow cuts it, and a black square, but it goes on behind."""
    own = [s] if s.dark else [k for k in stripes if k.chain is s.chain and not k.dark]
    first, stop = min(k.track.first for k in own), max(k.track.stop for k in own)
    return _Ridge(first, stop, sum(len(k.track.place) for k in own), sum(k.light for k in own))


def _goes_on(a: Stripe, b: Stripe, ridge: _Ridge) -> bool:
    """Whether ``a`` is a stripe that goes on where ``b`` beside it begins or ends. ridge: that b is of."""
    if a.chain is b.chain or len(a.track.place) <= ridge.sections:
        return False
    if a.chain.contrast < _asked_contrast(b) or not _stands_alone(a):
        return False
    if a.height < GHOST_LIGHT * b.height or a.light < GHOST_TOTAL * ridge.light:
        return False
    before, after = ridge.first - a.track.first, a.track.stop - ridge.stop
    inside = _overlap(a, b) >= 0.8 * len(b.track.place)
    return inside and max(before, after) >= max(GHOST_LONGER * ridge.sections, 12)


def _continues(s: Stripe, k: Stripe) -> bool:
    """Whether s begins where k ends, or the other way round, on its line."""
    for a, b in ((s, k), (k, s)):
        gap = b.track.first - a.track.stop
        if -4 <= gap <= JOIN_GAP:
            n, m = min(24, len(a.track.place)), min(24, len(b.track.place))
            slope_a = (a.track.place[-1] - a.track.place[-n]) / max(n - 1, 1)
            slope_b = (b.track.place[m - 1] - b.track.place[0]) / max(m - 1, 1)
            step = b.track.place[0] - a.track.place[-1]
            off = min(abs(step - slope_a * (gap + 1)), abs(step - slope_b * (gap + 1)))
            if off <= JOIN_PX + 0.15 * max(gap, 0) + s.bumps.width:
                return True
    return False


def courses(stripes: list[Stripe]) -> list[int]:
    """A number for each stripe, the same for pieces each of which goes on on the line of another."""
    out = list(range(len(stripes)))
    for i, s in enumerate(stripes):
        for j in range(i):
            if out[i] != out[j] and not (s.ghost or stripes[j].ghost) and _continues(s, stripes[j]):
                out = [min(out[i], out[j]) if k in (out[i], out[j]) else k for k in out]
    return out


def bridged(stripes: list[Stripe]) -> list[Stripe]:
    """The stripes, each piece with the gap before the next one of its course, straight across."""
    number = courses(stripes)
    out = []
    for s, course in zip(stripes, number, strict=True):
        others = [
            k.track for k, c in zip(stripes, number, strict=True) if c == course and k.track.first >= s.track.stop
        ]
        after = min(others, key=lambda t: t.first, default=None)
        if s.ghost or after is None or not 0 < after.first - s.track.stop <= JOIN_GAP:
            out.append(s)
            continue
        n = after.first - s.track.stop
        gap = np.linspace(s.track.place[-1], after.place[0], n + 2)[1:-1]
        place = np.concatenate([s.track.place, gap])
        width = np.concatenate([s.track.width, np.full(n, s.track.width[-1])])
        out.append(replace(s, track=Track(s.track.first, place, width)))
    return out


def _rivalry(kept: list[Stripe]) -> list[Stripe]:
    """Stripes of like light beside each other, marked."""
    return [replace(s, rivals=True) if s.bumps.peaks == 2 or _neighbours(s, kept) > 0 else s for s in kept]


def _neighbours(s: Stripe, kept: list[Stripe]) -> int:
    """How many others of like light lie beside it, over half of it or of themselves."""
    n = 0
    for k in kept:
        if k is s or k.ghost or (k.track.first == s.track.first and k.track.place is s.track.place):
            continue
        shared = _overlap(s, k)
        alike = k.height >= LIKE * s.height and k.light >= LIKE * s.light
        n += shared >= 0.5 * min(len(s.track.place), len(k.track.place)) and alike
    return n
