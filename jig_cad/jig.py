"""The string jig: lines between anchors, its symmetry, its tolerance (docs/conventions.md)."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from geometry import InputError, Pose, Prediction, Shape, SheetPoints, Symmetry, did_you_mean
from jig_cad.crossing import offset_from_lines, predict_crossings

Array = NDArray[np.float64]

ANCHORS = ("Ab", "At", "Bb", "Bt", "Cb", "Ct")  # b: bottom plate, t: top plate
STRINGS = {
    "A": ("Ab", "At"),
    "B": ("Bb", "Bt"),
    "C": ("Cb", "Ct"),
    "B'": ("At", "Bb"),
    "C'": ("Ab", "Ct"),
    "D'": ("Bb", "Ct"),
}
DEFAULT_STRINGS = ("A", "B", "C", "B'", "C'")
MIN_SLENDERNESS = 10.0  # a string is at least this many diameters long, a side at least this many tolerances

_HALF_TURN = {"B": "C", "C": "B", "B'": "C'", "C'": "B'"}


def nominal_anchors(side_mm: float, height_mm: float) -> Array:
    """Anchors (6, 3) [mm] in {J}, in the order of ANCHORS, of a regular pillar."""
    depth, half = np.sqrt(3) / 2 * side_mm, side_mm / 2
    bottom = np.array([[0, 0, 0], [0, -half, depth], [0, half, depth]])
    top = bottom + np.array([height_mm, 0, 0])
    return np.stack([bottom, top], 1).reshape(6, 3)


@dataclass(frozen=True, eq=False)
class Jig:
    """Strings between the anchors of a triangular pillar, in {J} [mm].

    {J}: origin at the bottom anchor of string A, x up the pillar, z into it.
    tolerance_mm: full width; every anchor lies within ± half of it in y and z.
    anchors_mm: (6, 3) in the order of ANCHORS. measured: whether they were measured.
    """

    side_mm: float
    height_mm: float
    string_diameter_mm: float
    tolerance_mm: float
    strings: tuple[str, ...]
    anchors_mm: Array = field(repr=False)
    measured: bool = False
    name: str = ""

    @staticmethod
    def nominal(
        side_mm: float = 100.0,
        height_mm: float = 100.0,
        string_diameter_mm: float = 0.3,
        tolerance_mm: float = 0.1,
        strings: tuple[str, ...] = DEFAULT_STRINGS,
        name: str = "",
    ) -> Jig:
        """The jig as drawn: the paper's five strings unless told otherwise."""
        anchors = nominal_anchors(side_mm, height_mm)
        return Jig(side_mm, height_mm, string_diameter_mm, tolerance_mm, tuple(strings), anchors, name=name)

    def __post_init__(self) -> None:
        """InputError where the numbers can not be a jig."""
        _check_sizes(self)
        _check_strings(self)
        _check_anchors(self)

    @cached_property
    def start_index(self) -> NDArray[np.intp]:
        """The anchor (S,) at which each string starts."""
        return np.array([ANCHORS.index(STRINGS[s][0]) for s in self.strings])

    @cached_property
    def end_index(self) -> NDArray[np.intp]:
        """The anchor (S,) at which each string ends."""
        return np.array([ANCHORS.index(STRINGS[s][1]) for s in self.strings])

    @cached_property
    def starts(self) -> Array:
        """First anchors of the strings (S, 3) [mm], in the order of ``strings``."""
        return self.anchors_mm[[ANCHORS.index(STRINGS[s][0]) for s in self.strings]]

    @cached_property
    def ends(self) -> Array:
        """Second anchors of the strings (S, 3) [mm]."""
        return self.anchors_mm[[ANCHORS.index(STRINGS[s][1]) for s in self.strings]]

    @cached_property
    def lengths(self) -> Array:
        """Lengths of the strings between their anchors (S,) [mm]."""
        return np.asarray(np.linalg.norm(self.ends - self.starts, axis=-1))

    @cached_property
    def directions(self) -> Array:
        """Unit vectors (S, 3) from starts to ends."""
        return (self.ends - self.starts) / self.lengths[:, None]

    @property
    def features(self) -> tuple[str, ...]:
        """The strings: what a point can lie on."""
        return self.strings

    @cached_property
    def shape(self) -> Shape:
        """Shifts of every anchor in y and z: uniform within ± half of the tolerance, none where they were measured."""
        sigma = 0.0 if self.measured else self.tolerance_mm / np.sqrt(12)
        labels = tuple(f"{a}.{axis}" for a in ANCHORS for axis in ("y", "z"))
        return Shape(labels, np.full(len(labels), float(sigma)))

    @property
    def symmetries(self) -> tuple[Symmetry, ...]:
        """The half turn."""
        return (Symmetry(self.half_turn, {n: half_turn_label(n) for n in self.strings}),)

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
        """The anchors (6, 3) [mm] as drawn, whatever was measured."""
        return nominal_anchors(self.side_mm, self.height_mm)

    @property
    def half_turn(self) -> Pose:
        """The map (x, y, z) → (h - x, -y, z), which carries the nominal jig onto itself."""
        return Pose(np.diag([-1.0, -1.0, 1.0]), np.array([self.height_mm, 0.0, 0.0]))


def half_turn_label(label: str) -> str:
    """The string onto which the half turn carries ``label``."""
    if label not in STRINGS:
        raise InputError(f'there is no string "{label}"{did_you_mean(label, STRINGS)}')
    return _HALF_TURN.get(label, label)


def sample_tolerance(jig: Jig, rng: np.random.Generator) -> Jig:
    """The jig with every anchor moved uniformly within ± half of its tolerance in y and z: one made jig."""
    shift = np.zeros((6, 3))
    shift[:, 1:] = rng.uniform(-0.5, 0.5, (6, 2)) * jig.tolerance_mm
    return replace(jig, anchors_mm=jig.anchors_mm + shift, measured=False)


def _check_sizes(jig: Jig) -> None:
    for key in ("side_mm", "height_mm", "string_diameter_mm"):
        value = getattr(jig, key)
        if not (np.isfinite(value) and value > 0):
            raise InputError(f"the jig's {key} = {value:g}: must be a positive, finite number of millimetres")
    if not (np.isfinite(jig.tolerance_mm) and jig.tolerance_mm >= 0):
        raise InputError(f"the jig's tolerance_mm = {jig.tolerance_mm:g}: must be 0 or a positive, finite number")
    limit = min(jig.side_mm, jig.height_mm) / MIN_SLENDERNESS
    for key in ("string_diameter_mm", "tolerance_mm"):
        if getattr(jig, key) > limit:
            raise InputError(
                f"the jig's {key} = {getattr(jig, key):g} is too large for side_mm = {jig.side_mm:g} and "
                f"height_mm = {jig.height_mm:g}: at most {limit:g} would leave strings that are lines"
            )


def _check_strings(jig: Jig) -> None:
    if not jig.strings:
        raise InputError("the jig has no strings: strings must name at least one")
    for label in jig.strings:
        if label not in STRINGS:
            instead = did_you_mean(label, STRINGS) or f"; known are {', '.join(STRINGS)}"
            raise InputError(f'the jig\'s strings name "{label}"{instead}')
        if jig.strings.count(label) > 1:
            raise InputError(f'the jig\'s strings name "{label}" more than once')


def _check_anchors(jig: Jig) -> None:
    if np.shape(jig.anchors_mm) != (6, 3):
        raise InputError(f"the jig needs anchors of shape (6, 3), not {np.shape(jig.anchors_mm)}")
    if not np.all(np.isfinite(jig.anchors_mm)):
        bad = ANCHORS[int(np.argmin(np.all(np.isfinite(jig.anchors_mm), axis=1)))]
        raise InputError(f"the jig's anchor {bad} holds a number that is not finite")
    shortest = MIN_SLENDERNESS * jig.string_diameter_mm
    for label, length in zip(jig.strings, jig.lengths, strict=True):
        if length < shortest:
            first, second = STRINGS[label]
            raise InputError(
                f"string {label} is only {length:g} mm long: anchors {first} and {second} must lie at least "
                f"{shortest:g} mm apart (are the anchors in millimetres?)"
            )
