"""The points of a profile on a sphere, balls, a plane, an edge or a wedge; all else (stem, table, clamp) left out."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from extraction.config import FeatureConfig
from extraction.features.consensus import Agreement, Course, Curve, Valid, agree, course_of
from extraction.features.points import TargetPoints
from extraction.features.shapes import Circle, Circles, Line, Lines
from extraction.stripe import Profile
from geometry import InputError, did_you_mean, inside_polygon

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FEATURE_KINDS = ("sphere", "balls", "plane", "edge", "wedge")
_MOST_THINGS = 6  # looked for in a profile: two faces or some balls, and what stands around them
_MOST_STRETCHES = 3  # that can be an edge's plate: it, what lies behind it, a clamp
_STRAIGHT = ("plane", "wedge")
_END_SIGMAS = 2.0  # of the stripe's width, in sections: on a path-traced plate three are 0.02 to 0.05 mm off, no others
_BEYOND_PITCHES = 2.0  # an end this near the field's border is the field's, not the plate's
_BEYOND_POINTS = 8  # looked at beyond an end: more than strays, less than anything that stands there
_JUMP_SIGMAS = 8.0  # of the stretch's scatter: a step beyond an end by more is a jump
_LEAST_JUMP_MM = 0.3  # and by less none: burrs and rounded borders


@dataclass(frozen=True, eq=False)
class FeatureSearch:
    """What is asked of one profile; ``order``: the profile's points along y."""

    kind: str
    course: Course
    order: NDArray[np.intp]
    diameters_mm: tuple[float | None, ...]
    expected_mm: Array | None
    within_mm: float
    field_of_view_mm: Array | None
    towards_sensor: bool
    config: FeatureConfig
    rng: np.random.Generator

    def none(self, text: str, reason: str = "no_target") -> TargetPoints:
        """Nothing found."""
        return TargetPoints.none(self.kind, len(self.order), reason, text)

    def near_expected(self, places: Array) -> Mask:
        """Which places (..., 2) are near one where the target is expected; all where nothing is."""
        if self.expected_mm is None:
            return np.ones(np.shape(places)[:-1], dtype=bool)
        off = np.asarray(places)[..., None, :] - self.expected_mm
        return np.asarray(np.min(np.hypot(off[..., 0], off[..., 1]), axis=-1) <= self.within_mm)


def find_target_points(
    profile: Profile,
    kind: str,
    diameters_mm: Sequence[float | None] = (None,),
    *,
    expected_mm: Array | None = None,
    within_mm: float = 10.0,
    field_of_view_mm: Array | None = None,
    towards_sensor: bool = False,
    config: FeatureConfig | None = None,
    rng: np.random.Generator | None = None,
) -> TargetPoints:
    """The points of one profile that lie on a target.

    Parameters
    ----------
    profile
        Of an image or a file; points without covariance are taken as equally good.
    kind
        "sphere", "balls", "plane", "edge" or "wedge".
    diameters_mm
        Of a sphere or of all balls that may be in view; None where one is not known.
    expected_mm
        (K, 2) in {P}: where the target is expected. A sphere or ball: the centre of its section. A plane: a point on
        its line. An edge: its corner. A wedge: where its faces meet. Things farther off are left out.
    within_mm
        How far off.
    field_of_view_mm
        Polygon (N, 2) in {P}: where the sensor measures. An end of the profile at its border is no edge.
    towards_sensor
        Whether z counts towards the sensor: of two surfaces at a jump only the nearer one ends there.
    config
        The defaults where None.
    rng
        Of RANSAC's samples; None: the same for every profile.

    Returns
    -------
    TargetPoints
        With a reason where there is nothing to be found.

    Raises
    ------
    InputError
        Where the kind is unknown or a diameter impossible.
    """
    if kind not in FEATURE_KINDS:
        near = did_you_mean(kind, FEATURE_KINDS) or f" (known: {', '.join(FEATURE_KINDS)})"
        raise InputError(f'"{kind}" can not be found in a profile{near}')
    for diameter in diameters_mm:
        if diameter is not None and not 0 < diameter < np.inf:
            raise InputError(f"a ball's diameter must be positive and finite, not {diameter:g} mm")
    order = np.argsort(profile.yz_mm[:, 0], kind="stable")
    course = course_of(profile.yz_mm[order], profile.cov_yz_mm2[order])
    expected = None if expected_mm is None else np.asarray(expected_mm, dtype=float).reshape(-1, 2)
    search = FeatureSearch(
        kind, course, order, tuple(diameters_mm), expected, within_mm, field_of_view_mm, towards_sensor,
        config or FeatureConfig(), np.random.default_rng(0) if rng is None else rng,
    )  # fmt: skip
    if len(order) == 0:
        return search.none("the profile holds no points", "no_profile")
    found = _FINDERS[kind](search)
    return _off_the_ends(found, profile) if kind in _STRAIGHT else found


def _off_the_ends(found: TargetPoints, profile: Profile) -> TargetPoints:
    """The points of straight stretches without the sections next to their ends, where the stripe's light breaks off.

    A stripe is as blurred along as it is across: a section nearer an end than twice its σ has light of one side alone,
    or of another slope, and its centre is drawn there. Profiles of makers' sensors tell no width.
    """
    width = profile.peaks.width_px
    keep = np.ones(len(found), dtype=bool)
    for k in range(len(found.curves)):
        mine = found.feature == k
        place = found.index[mine]
        if not np.any(mine) or np.any(place < 0):
            continue
        section, lost = profile.peaks.section[place], _END_SIGMAS * float(np.median(width[place]))
        inside = (section - section.min() >= lost) & (section.max() - section >= lost)
        if np.isfinite(lost) and np.count_nonzero(inside) > len(inside) / 2:
            keep[mine] = inside
    if np.all(keep):
        return found
    columns = {name: getattr(found, name)[keep] for name in ("yz_mm", "cov_yz_mm2", "feature", "index")}
    return replace(found, **columns)


def _sphere(search: FeatureSearch) -> TargetPoints:
    arcs = _arcs(search, 2)
    if not arcs:
        return search.none(_no_arc(search))
    rivals = [a for a in arcs[1:] if _is_rival(search, a, arcs[0])]
    if rivals:
        first, second = (a.curve.centre_mm for a in (arcs[0], rivals[0]) if isinstance(a.curve, Circle))
        where = f"at (y, z) = ({first[0]:z.1f}, {first[1]:z.1f}) and ({second[0]:z.1f}, {second[1]:z.1f}) mm"
        text = f"two balls are in view, {where}, and nothing tells which one is meant"
        return replace(search.none(text), rivals=len(rivals))
    return _points(search, [arcs[0]])


def _balls(search: FeatureSearch) -> TargetPoints:
    arcs = _arcs(search, min(_MOST_THINGS, len(search.diameters_mm)))
    arcs = [a for i, a in enumerate(arcs) if i == 0 or _is_rival(search, a, arcs[0])]
    if not arcs:
        return search.none(_no_arc(search))
    arcs.sort(key=lambda a: float(a.curve.centre_mm[0]) if isinstance(a.curve, Circle) else 0.0)
    return _points(search, arcs)


def _arcs(search: FeatureSearch, most: int) -> list[Agreement]:
    """Arcs of balls, the one with most points first."""
    config, known = search.config, [d / 2 for d in search.diameters_mm if d is not None]
    whole = len(known) == len(search.diameters_mm) and bool(known)
    low = config.min_section * min(known) if whole else 0.0
    high = config.max_section * max(known) if whole else config.max_radius_mm

    return _arcs_between(search, low, high, most)


def _arcs_between(search: FeatureSearch, low: float, high: float, most: int) -> list[Agreement]:
    """Arcs of radii [mm] between two, the one with most points first."""

    def valid(curves: Circles | Lines) -> Mask:
        if not isinstance(curves, Circles):
            return np.zeros(len(curves), dtype=bool)
        return (low <= curves.radius_mm) & (curves.radius_mm <= high) & search.near_expected(curves.centre_mm)

    def arched(found: Agreement) -> bool:
        curve, yz = found.curve, search.course.yz_mm[found.inliers]
        return isinstance(curve, Circle) and curve.arc_rad(yz) >= np.deg2rad(search.config.min_arc_deg)

    return _things(search, Circle, valid, arched, most, search.config.rival_share)


def _no_arc(search: FeatureSearch) -> str:
    """What is said where there is no arc of the balls stated; a larger one is told, as of a radius for a diameter."""
    config, known = search.config, [d / 2 for d in search.diameters_mm if d is not None]
    of = f" of radius {config.min_section * min(known):.3g} … {max(known):.3g} mm" if known else ""
    where = "" if search.expected_mm is None else f" within {search.within_mm:g} mm of where it is expected"
    text = f"none of the {len(search.order)} points lie on an arc{of}{where}"
    if len(known) != len(search.diameters_mm) or search.expected_mm is not None:
        return text
    larger = _arcs_between(search, config.max_section * max(known), config.max_radius_mm, 1)
    if not larger or not isinstance(larger[0].curve, Circle):
        return text
    radius = larger[0].curve.radius_mm
    return f"{text}, but {np.count_nonzero(larger[0].inliers)} on one of {radius:.3g} mm: is the diameter stated right?"


def _is_rival(search: FeatureSearch, other: Agreement, first: Agreement) -> bool:
    """Whether a second arc can be a ball's as well: points enough, and wide enough for no stem."""
    share = np.count_nonzero(other.inliers) / np.count_nonzero(first.inliers)
    if not isinstance(other.curve, Circle) or not isinstance(first.curve, Circle):
        return False
    radii = [d / 2 for d in search.diameters_mm if d is not None] or [first.curve.radius_mm]
    wide = other.curve.radius_mm >= search.config.rival_section * min(radii)
    return bool(share >= search.config.rival_share and wide)


def _plane(search: FeatureSearch) -> TargetPoints:
    lines = _lines(search, 2)
    if not lines:
        return search.none(_no_line(search))
    found = _points(search, lines[:1])
    share = np.count_nonzero(lines[-1].inliers) / np.count_nonzero(lines[0].inliers)
    if len(lines) > 1 and share >= search.config.rival_share:
        text = "two straight stretches are in view; the one with more points was taken"
        found = replace(found, rivals=1, text=text)
    return found


def _lines(search: FeatureSearch, most: int) -> list[Agreement]:
    """Straight stretches, the one with most points first."""
    config, expected = search.config, search.expected_mm

    def valid(curves: Circles | Lines) -> Mask:
        if search.kind != "plane" or expected is None:
            return np.ones(len(curves), dtype=bool)
        return np.asarray(np.any(curves.near(expected, search.within_mm), axis=1))

    def straight(found: Agreement) -> bool:
        line, yz = found.curve, search.course.yz_mm[found.inliers]
        if not isinstance(line, Line):
            return False
        length = float(np.ptp(line.along(yz)))
        return length >= config.min_line_mm and abs(_bend(line, yz)[0]) <= config.max_bend * length

    return _things(search, Line, valid, straight, most)


def _no_line(search: FeatureSearch) -> str:
    where = "" if search.expected_mm is None else f" within {search.within_mm:g} mm of where it is expected"
    return (
        f"none of the {len(search.order)} points make a straight stretch of {search.config.min_line_mm:g} mm or "
        f"more{where}"
    )


def _edge(search: FeatureSearch) -> TargetPoints:
    """The corners of the straight stretch of most points from which the profile jumps away, else of that which ends."""
    lines = _lines(search, _MOST_STRETCHES)
    if not lines:
        return search.none(_no_line(search))
    ends = [[e for e in _ends(search, found) if search.near_expected(e.corner)] for found in lines]
    for borders in ([[e for e in of if e.jumps] for of in ends], ends):
        for found, some in zip(lines, borders, strict=True):
            if some:
                return _corners(search, found, some)
    return search.none(
        "the straight stretch ends only where the field of view does or where something nearer hides it, so there is "
        "no edge in it"
    )


def _corners(search: FeatureSearch, found: Agreement, ends: list[_End]) -> TargetPoints:
    """One corner, or both ends where nothing tells which it is."""
    if search.expected_mm is not None:
        middle = search.expected_mm
        ends = [min(ends, key=lambda e: float(np.min(np.hypot(*(middle - e.corner).T))))]
    unknown = "" if search.field_of_view_mm is not None else ", and where the field of view ends is not known"
    text = "" if len(ends) == 1 else f"both ends of the straight stretch can be the edge{unknown}"
    return replace(
        _points(search, [found]),
        yz_mm=np.array([e.corner for e in ends]),
        cov_yz_mm2=np.array([e.covariance for e in ends]),
        feature=np.arange(len(ends), dtype=np.intp),
        index=np.full(len(ends), -1, dtype=np.intp),
        text=text,
        rivals=len(ends) - 1,
    )


@dataclass(frozen=True, eq=False)
class _End:
    """An end of a straight stretch: corner (2,), its covariance (2, 2), whether something farther off begins there."""

    corner: Array
    covariance: Array
    jumps: bool


def _ends(search: FeatureSearch, found: Agreement) -> list[_End]:
    """The ends of a straight stretch that can be a plate's border, left end first.

    The last point lies anywhere within one pitch of the border, on its inner side: half a pitch outwards is its mean.
    An end at the field's border is the field's; one beyond which something nearer stands is that thing's shadow.
    """
    line = found.curve
    if not isinstance(line, Line):
        raise TypeError("a straight stretch is a line")
    s = np.sort(line.along(search.course.yz_mm[found.inliers]))
    pitch = float(np.median(np.diff(s)))
    turn = np.column_stack([line.direction, line.normal])
    polygon, out = search.field_of_view_mm, []
    for end, outwards in ((s[0], -1.0), (s[-1], 1.0)):
        beyond = line.origin_mm + (end + outwards * _BEYOND_PITCHES * pitch) * line.direction
        if polygon is not None and not bool(inside_polygon(beyond, polygon)):
            continue
        step = _step_beyond(search, found, line, outwards)
        if step < 0:
            continue
        place = end + outwards * pitch / 2
        across = found.scatter_mm**2 * (1 / len(s) + (place - s.mean()) ** 2 / np.sum((s - s.mean()) ** 2))
        spread = np.diag([pitch**2 / 12, across])
        out.append(_End(line.origin_mm + place * line.direction, turn @ spread @ turn.T, step > 0))
    return out


def _step_beyond(search: FeatureSearch, found: Agreement, line: Line, outwards: float) -> float:
    """How much farther from the sensor [mm] the profile goes on beyond an end; below 0 nearer, 0 where it does not."""
    y, inside = search.course.yz_mm[:, 0], found.inliers
    last = float(np.max(outwards * y[inside]))
    there = np.flatnonzero(outwards * y > last)
    there = there[np.argsort(outwards * y[there], kind="stable")][:_BEYOND_POINTS]
    if len(there) < _BEYOND_POINTS:
        return 0.0
    off = float(np.median(line.residuals(search.course.yz_mm[there])))
    farther = -off if search.towards_sensor else off
    return farther if abs(off) > max(_JUMP_SIGMAS * found.scatter_mm, _LEAST_JUMP_MM) else 0.0


def _wedge(search: FeatureSearch) -> TargetPoints:
    lines = _lines(search, 4)
    pairs = [(a, b) for i, a in enumerate(lines) for b in lines[i + 1 :]]
    met = [(a, b, ridge) for a, b in pairs if (ridge := _ridge(search, a, b)) is not None]
    met = [m for m in met if search.near_expected(m[2])]
    if not met:
        text = f"{len(lines)} straight stretch{'es' * (len(lines) != 1)} in view, and no two of them meet in a ridge"
        return search.none(text if lines else _no_line(search))
    a, b, ridge = max(met, key=lambda m: int(np.count_nonzero(m[0].inliers) + np.count_nonzero(m[1].inliers)))
    sides = sorted((a, b), key=lambda f: float(np.mean(search.course.yz_mm[f.inliers, 0])))
    return _points(search, [_on_its_side(search, side, ridge) for side in sides])


def _ridge(search: FeatureSearch, a: Agreement, b: Agreement) -> Array | None:
    """Where two straight stretches meet (2,); None where they are too parallel or end too far from there."""
    if not isinstance(a.curve, Line) or not isinstance(b.curve, Line):
        return None
    turn = np.arccos(min(1.0, abs(float(a.curve.direction @ b.curve.direction))))
    ridge = a.curve.meets(b.curve)
    if ridge is None or turn < np.deg2rad(search.config.min_wedge_deg):
        return None
    for side in (a, b):
        if np.min(np.hypot(*(search.course.yz_mm[side.inliers] - ridge).T)) > search.config.max_ridge_gap_mm:
            return None
    return ridge


def _on_its_side(search: FeatureSearch, side: Agreement, ridge: Array) -> Agreement:
    """A face without the points beyond the ridge and at it, where the stripe's centre mixes both faces."""
    if not isinstance(side.curve, Line):
        raise TypeError("a wedge's face is a line")
    s = side.curve.along(search.course.yz_mm)
    at = float(side.curve.along(ridge[None])[0])
    own = 1.0 if float(np.median(s[side.inliers])) > at else -1.0
    pitch = float(np.median(np.diff(np.sort(s[side.inliers]))))
    return replace(side, inliers=side.inliers & (own * (s - at) > _BEYOND_PITCHES * pitch))


def _things(
    search: FeatureSearch,
    shape: type[Curve],
    valid: Valid,
    accept: Callable[[Agreement], bool],
    most: int,
    share: float = 0.0,
) -> list[Agreement]:
    """Curves found one after the other, each among the points that the ones before left; most points first.

    Once a curve is found, others with less than a share of its points are asked for by nobody.
    """
    free = np.ones(len(search.order), dtype=bool)
    out: list[Agreement] = []
    for _ in range(_MOST_THINGS):
        least = share * max((np.count_nonzero(a.inliers) for a in out), default=0)
        found = agree(search.course, free, shape, valid, search.rng, search.config, int(np.ceil(least)))
        if found is None:
            break
        if accept(found):
            out.append(found)
            if len(out) == most:
                break
        free = free & ~found.inliers
    return sorted(out, key=lambda a: -int(np.count_nonzero(a.inliers)))


def _points(search: FeatureSearch, things: list[Agreement]) -> TargetPoints:
    """The points of curves as the target's, their covariance scaled to their own scatter."""
    course = search.course
    at = [np.flatnonzero(thing.inliers) for thing in things]
    covariance = [_scaled(course, thing, here) for thing, here in zip(things, at, strict=True)]
    places = np.concatenate(at)
    lines = [t for t in things if isinstance(t.curve, Line)]
    bend = (float("nan"), float("nan"))
    if len(things) == 1 and lines and isinstance(lines[0].curve, Line):
        bend = _bend(lines[0].curve, course.yz_mm[lines[0].inliers])
    return TargetPoints(
        kind=search.kind,
        yz_mm=course.yz_mm[places],
        cov_yz_mm2=np.concatenate(covariance),
        feature=np.repeat(np.arange(len(things), dtype=np.intp), [len(here) for here in at]),
        index=search.order[places],
        n_points=len(search.order),
        scatter_mm=float(np.median([t.scatter_mm for t in things])),
        curves=tuple(t.curve for t in things),
        bend_mm=bend[0],
        sigma_bend_mm=bend[1],
    )


def _scaled(course: Course, thing: Agreement, at: NDArray[np.intp]) -> Array:
    """Covariance (n, 2, 2) of a curve's points: the stated one times what they scatter by; else alike in y and z."""
    stated = course.cov_yz_mm2[at]
    n = thing.curve.normals(course.yz_mm[at])
    variance = np.einsum("ni,nij,nj->n", n, stated, n)
    wanted = thing.sigma_mm[at] ** 2
    known = variance > 0
    factor = np.where(known, wanted / np.where(known, variance, 1.0), 0.0)
    return np.asarray(np.where(known[:, None, None], stated * factor[:, None, None], wanted[:, None, None] * np.eye(2)))


def _bend(line: Line, yz: Array) -> tuple[float, float]:
    """How far the middle of a stretch stands off its ends by a parabola, and its σ from what is left."""
    s, off = line.along(yz), line.residuals(yz)
    half = np.ptp(s) / 2
    if half <= 0 or len(s) < 4:
        return 0.0, float("inf")
    t = (s - (s.min() + half)) / half
    rows = np.column_stack([np.ones_like(t), t, 1 - t**2])
    solution, _, _, _ = np.linalg.lstsq(rows, off, rcond=None)
    left = off - rows @ solution
    variance = float(left @ left) / (len(s) - 3) * float(np.linalg.inv(rows.T @ rows)[2, 2])
    return float(solution[2]), float(np.sqrt(variance))


_FINDERS: dict[str, Callable[[FeatureSearch], TargetPoints]] = {
    "sphere": _sphere,
    "balls": _balls,
    "plane": _plane,
    "edge": _edge,
    "wedge": _wedge,
}
