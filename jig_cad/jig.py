"""The string jig: lines between anchors, its symmetries, its tolerance (docs/conventions.md)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Pose, Prediction, Shape, SheetPoints, Symmetry, did_you_mean
from jig_cad.crossing import offset_from_lines, predict_crossings
from jig_cad.pillar import ANCHORS, DEFAULT_STRINGS, STRINGS, Pillar, half_turn, nominal_anchors, pillar_of
from jig_cad.symmetry import symmetries_of

Array = NDArray[np.float64]
Index = NDArray[np.intp]

LEAST_TOLERANCE_MM = 1e-6  # less is none: nothing is made or measured so
MIN_SLENDERNESS = 10.0  # a string is at least this many diameters long, a side at least this many tolerances
FORBIDDEN = ',;"`'  # in names: they are columns of CSV files, where a backtick is read as a prime
MAX_NAME = 40  # characters that a label may take of a table or a picture


@dataclass(frozen=True, eq=False)
class Jig:
    """Strings between anchors, in {J} [mm]: x up, roughly along the strings; z away from who looks at it.

    Parameters
    ----------
    anchors : names of the A anchors.
    anchors_mm : (A, 3) where they are: as drawn, as sampled within the tolerance, or as measured.
    strings : names of the S strings.
    start_index, end_index : (S,) anchors between which each string runs.
    string_diameter_mm : of all strings.
    tolerance_mm : full width; every anchor lies within ± half of it in y and z.
    measured : whether the anchors were measured: then the tolerance says nothing of them any more.
    drawn_mm : (A, 3) the anchors as drawn, whatever was measured; None: as ``anchors_mm``.
    pillar : what makes the set a triangular pillar, or None.
    symmetries : the motions that carry the jig as drawn onto itself, the identity left out.

    Raises
    ------
    InputError
        where names or numbers can not be a jig.
    """

    anchors: tuple[str, ...]
    anchors_mm: Array = field(repr=False)
    strings: tuple[str, ...]
    start_index: Index = field(repr=False)
    end_index: Index = field(repr=False)
    string_diameter_mm: float
    tolerance_mm: float
    measured: bool = False
    name: str = ""
    drawn_mm: Array | None = field(default=None, repr=False)
    pillar: Pillar | None = None
    symmetries: tuple[Symmetry, ...] = field(default=(), repr=False)

    @staticmethod
    def nominal(
        side_mm: float = 100.0,
        height_mm: float = 100.0,
        string_diameter_mm: float = 0.3,
        tolerance_mm: float = 0.1,
        strings: Sequence[str] = DEFAULT_STRINGS,
        name: str = "",
    ) -> Jig:
        """The pillar as drawn: the paper's five strings unless told otherwise."""
        _check_sizes(side_mm, height_mm, string_diameter_mm, tolerance_mm)
        for label in strings:
            if label not in STRINGS:
                instead = did_you_mean(label, STRINGS) or f"; known are {', '.join(STRINGS)}"
                raise InputError(f'the jig\'s strings name "{label}"{instead}')
        pillar = Pillar(side_mm, height_mm, {label: label for label in strings})
        drawn = nominal_anchors(side_mm, height_mm)
        start, end = (np.array([ANCHORS.index(STRINGS[s][k]) for s in strings], dtype=np.intp) for k in (0, 1))
        return Jig(
            ANCHORS,
            drawn,
            tuple(strings),
            start,
            end,
            string_diameter_mm,
            tolerance_mm,
            name=name,
            drawn_mm=drawn,
            pillar=pillar,
            symmetries=half_turn(pillar),
        )

    @staticmethod
    def of_lines(
        anchors_mm: Mapping[str, Sequence[float]],
        strings: Mapping[str, tuple[str, str]],
        string_diameter_mm: float = 0.3,
        tolerance_mm: float = 0.1,
        measured: bool = False,
        name: str = "",
    ) -> Jig:
        """Any lines between any named anchors; its symmetries are found, and a pillar of other names is known as one.

        Parameters
        ----------
        anchors_mm : point (3,) in {J} of every anchor.
        strings : the names of both anchors of every string.

        Examples
        --------
        >>> jig = Jig.of_lines({"low": (0, 0, 0), "high": (90, 5, 20)}, {"left": ("low", "high")})
        >>> jig.strings, jig.symmetries
        (('left',), ())
        """
        names = tuple(anchors_mm)
        points = np.array([anchors_mm[a] for a in names], dtype=float).reshape(-1, 3)
        for label, ends in strings.items():
            for anchor in ends:
                if anchor not in names:
                    instead = did_you_mean(anchor, names) or f"; known are {', '.join(names)}"
                    raise InputError(f'string "{label}" ends at an anchor "{anchor}" that is not given{instead}')
        start, end = (np.array([names.index(e[k]) for e in strings.values()], dtype=np.intp) for k in (0, 1))
        jig = Jig(
            names, points, tuple(strings), start, end, string_diameter_mm, tolerance_mm, measured, name, drawn_mm=points
        )
        pillar = pillar_of(points, jig.strings, start, end)
        found = symmetries_of(points, jig.strings, start, end, tolerance_mm) if pillar is None else half_turn(pillar)
        return replace(jig, pillar=pillar, symmetries=found)

    def __post_init__(self) -> None:
        """InputError where names or numbers can not be a jig."""
        if self.drawn_mm is None:
            object.__setattr__(self, "drawn_mm", self.anchors_mm)
        _check_names(self)
        _check_anchors(self)
        _check_lengths(self)

    @property
    def features(self) -> tuple[str, ...]:
        """The strings: what a point can lie on."""
        return self.strings

    @property
    def anchor_sigma_mm(self) -> float:
        """σ of every anchor's y and z: uniform within ± half of the tolerance; 0 where the anchors were measured."""
        exact = self.measured or self.tolerance_mm < LEAST_TOLERANCE_MM
        return 0.0 if exact else float(self.tolerance_mm / np.sqrt(12))

    @cached_property
    def shape(self) -> Shape:
        """Shifts of every anchor in y and z."""
        labels = tuple(f"{a}.{axis}" for a in self.anchors for axis in ("y", "z"))
        return Shape(labels, np.full(len(labels), self.anchor_sigma_mm))

    @property
    def freedom(self) -> tuple[bool, ...]:
        """A set of strings shows all six components of its pose."""
        return (True,) * 6

    @property
    def residuals_per_point(self) -> int:
        """The crossing's y and z."""
        return 2

    def predict(self, T_sensor_target: Pose, shape: Array, points: SheetPoints) -> Prediction:
        """Crossings of the strings with the laser plane less the measured points."""
        return predict_crossings(self.anchors_mm, self.start_index, self.end_index, T_sensor_target, shape, points)

    def offset(self, points_mm: Array, feature: NDArray[np.intp]) -> tuple[Array, Array]:
        """Perpendicular offsets (N, 3) [mm] of points from their strings, and their derivatives (N, 3, 3)."""
        return offset_from_lines(points_mm, self.starts[feature], self.directions[feature])

    @property
    def nominal_anchors_mm(self) -> Array:
        """The anchors (A, 3) [mm] as drawn, whatever was measured."""
        return self.anchors_mm if self.drawn_mm is None else self.drawn_mm

    @cached_property
    def starts(self) -> Array:
        """First anchors of the strings (S, 3) [mm], in the order of ``strings``."""
        return self.anchors_mm[self.start_index]

    @cached_property
    def ends(self) -> Array:
        """Second anchors of the strings (S, 3) [mm]."""
        return self.anchors_mm[self.end_index]

    @cached_property
    def lengths(self) -> Array:
        """Lengths of the strings between their anchors (S,) [mm]."""
        return np.asarray(np.linalg.norm(self.ends - self.starts, axis=-1))

    @cached_property
    def directions(self) -> Array:
        """Unit vectors (S, 3) from starts to ends."""
        return (self.ends - self.starts) / self.lengths[:, None]

    @cached_property
    def used_anchors(self) -> Index:
        """Anchors at which a string ends, in their order."""
        return np.unique(np.concatenate([self.start_index, self.end_index]))

    @cached_property
    def axis(self) -> Array:
        """The unit vector (3,) in {J} along which the strings run on the whole: x of a pillar."""
        if self.pillar is not None:
            return np.array([1.0, 0.0, 0.0])
        vectors = np.linalg.eigh(self.directions.T @ self.directions)[1]
        lead = np.round(vectors[:, -1], 9) * [1.0, 1e-3, 1e-6]  # the sense in which x grows, or else y, or z
        return np.asarray(vectors[:, -1] * (1.0 if np.sum(lead) > 0 else -1.0))

    @cached_property
    def side_mm(self) -> float:
        """The pillar's side as drawn; of other sets the largest width across x, at least ten string diameters."""
        if self.pillar is not None:
            return self.pillar.side_mm
        across = self.nominal_anchors_mm[self.used_anchors, 1:]
        widest = np.max(np.linalg.norm(across[:, None] - across, axis=-1))
        return float(max(widest, MIN_SLENDERNESS * self.string_diameter_mm))

    @cached_property
    def height_mm(self) -> float:
        """The pillar's height as drawn; of other sets the extent along x, at least ten string diameters."""
        if self.pillar is not None:
            return self.pillar.height_mm
        up = self.nominal_anchors_mm[self.used_anchors, 0]
        return float(max(np.ptp(up), MIN_SLENDERNESS * self.string_diameter_mm))

    @cached_property
    def foot_mm(self) -> Array:
        """The point (3,) about which views turn, at the lowest end of the strings: the middle of the set, x least."""
        if self.pillar is not None:
            return np.array([0.0, 0.0, self.side_mm / np.sqrt(3)])
        points = self.nominal_anchors_mm[self.used_anchors]
        return np.array([points[:, 0].min(), *points[:, 1:].mean(axis=0)])

    def require_pillar(self, what: str) -> Pillar:
        """The pillar that this set is; InputError, naming ``what`` needs one, where it is none."""
        if self.pillar is None:
            named = f' "{self.name}"' if self.name else ""
            raise InputError(
                f"{what} needs a triangular pillar, and the jig{named} is none: its strings are "
                f"{', '.join(self.strings)}"
            )
        return self.pillar


def sample_tolerance(jig: Jig, rng: np.random.Generator) -> Jig:
    """One made jig: every anchor moved uniformly within ± half of its tolerance in y and z.

    Parameters
    ----------
    jig : Jig
        As drawn.
    rng : numpy.random.Generator

    Returns
    -------
    Jig
        With its anchors as made.
    """
    shift = np.zeros((len(jig.anchors), 3))
    shift[:, 1:] = rng.uniform(-0.5, 0.5, (len(jig.anchors), 2)) * jig.tolerance_mm
    return replace(jig, anchors_mm=jig.anchors_mm + shift, measured=False)


def _check_sizes(side_mm: float, height_mm: float, string_diameter_mm: float, tolerance_mm: float) -> None:
    sizes = {"side_mm": side_mm, "height_mm": height_mm, "string_diameter_mm": string_diameter_mm}
    for key, value in sizes.items():
        _check_positive(key, value)
    _check_tolerance(tolerance_mm)
    limit = min(side_mm, height_mm) / MIN_SLENDERNESS
    for key, value in {"string_diameter_mm": string_diameter_mm, "tolerance_mm": tolerance_mm}.items():
        if value > limit:
            raise InputError(
                f"the jig's {key} = {value:g} is too large for side_mm = {side_mm:g} and "
                f"height_mm = {height_mm:g}: at most {limit:g} would leave strings that are lines"
            )


def _check_positive(key: str, value: float) -> None:
    if not (np.isfinite(value) and value > 0):
        raise InputError(f"the jig's {key} = {value:g}: must be a positive, finite number of millimetres")


def _check_tolerance(value: float) -> None:
    if not (np.isfinite(value) and value >= 0):
        raise InputError(f"the jig's tolerance_mm = {value:g}: must be 0 or a positive, finite number")


def _check_names(jig: Jig) -> None:
    if not jig.strings:
        raise InputError("the jig has no strings: strings must name at least one")
    for what, names in (("strings", jig.strings), ("anchors", jig.anchors)):
        for name in names:
            if names.count(name) > 1:
                raise InputError(f'the jig\'s {what} name "{name}" more than once')
            if problem := _trouble(name):
                raise InputError(f"the jig's {what} name {name!r}: {problem}")


def _trouble(name: str) -> str:
    """Why ``name`` can not stand in CSV files and tables, or ""."""
    if not name or name != name.strip():
        return "a name must not be empty, nor begin or end with a space"
    if not (name.isascii() and name.isprintable()):
        return "a name must be of printable ASCII characters"
    if any(c in FORBIDDEN for c in name):
        return f"a name must hold none of {' '.join(FORBIDDEN)}"
    return "" if len(name) <= MAX_NAME else f"a name must have at most {MAX_NAME} characters"


def _check_anchors(jig: Jig) -> None:
    n = len(jig.anchors)
    for points in (jig.anchors_mm, jig.nominal_anchors_mm):
        if np.shape(points) != (n, 3):
            raise InputError(f"the jig needs anchors of shape ({n}, 3), not {np.shape(points)}")
        if not np.all(np.isfinite(points)):
            bad = jig.anchors[int(np.argmin(np.all(np.isfinite(points), axis=1)))]
            raise InputError(f"the jig's anchor {bad} holds a number that is not finite")
    for index in (jig.start_index, jig.end_index):
        if np.shape(index) != (len(jig.strings),) or np.any((index < 0) | (index >= n)):
            raise InputError(f"the jig needs one of its {n} anchors at both ends of each of {len(jig.strings)} strings")


def _check_lengths(jig: Jig) -> None:
    _check_positive("string_diameter_mm", jig.string_diameter_mm)
    _check_tolerance(jig.tolerance_mm)
    shortest = MIN_SLENDERNESS * jig.string_diameter_mm
    for k, (label, length) in enumerate(zip(jig.strings, jig.lengths, strict=True)):
        first, second = jig.anchors[jig.start_index[k]], jig.anchors[jig.end_index[k]]
        if first == second:
            raise InputError(f"string {label} runs from anchor {first} to itself: it needs two different anchors")
        if length < shortest:
            raise InputError(
                f"string {label} is only {length:g} mm long: anchors {first} and {second} must lie at least "
                f"{shortest:g} mm apart (are the anchors in millimetres?)"
            )
    limit = float(np.min(jig.lengths)) / MIN_SLENDERNESS
    if jig.tolerance_mm > limit:
        raise InputError(
            f"the jig's tolerance_mm = {jig.tolerance_mm:g} is too large for a string of {np.min(jig.lengths):g} mm: "
            f"at most {limit:g} would leave strings that are lines"
        )
