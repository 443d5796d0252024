"""Where a calibration on surfaces begins: from the SCP by design, or from nothing at all.

Without a design every rotation of a grid is tried. Given a rotation, a face's normal follows from the directions of its
lines, and the translation, the faces' distances and the balls' centres from linear equations: a ball's section tells
its centre in the sheet, and not on which side of the sheet it lies; the side is what agrees with the section's radius.
The best rotations are then solved for in full, and the least cost decides.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import islice, product

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Bundle, rotation_grid, solve_bundle
from calib.surface.constellation import balls_places, renamed_by_place, told_alone, with_names
from calib.surface.faces import exchanged, namings
from calib.surface.sections import FrameSection, face_angles, sections_of
from geometry import Frame, Pose, Surface, Target, log_so3, stack_poses, target_at
from jig_cad import Balls, Sphere, Wedge

Array = NDArray[np.float64]
Index = NDArray[np.intp]

_GRID = 2500  # rotations, some 15 degrees apart
_TRIED = 8  # of the best ones, solved in full
_APART_RAD = 0.35  # between rotations that are both tried
_SIDES = (1.0, 1.003, 1.01, 1.03, 1.1)  # radii over the largest section's, where a ball's is not known
_EDGE_ROUNDS = 4  # of direction and place of an edge in turn
_RIDGE = 1e-9  # share of the diagonal that closes what is open
_ITERATIONS = 40
_FEW = 10  # residuals to spare with which a solve from the drawing may end in a false answer; with more none of 60 did
_BEYOND = 100.0  # squared σ of a drawing: no part is ten σ from its drawing
_DRAWN = 24  # places that the drawing allows
_PLACES_OF_BALLS, _MOST_CHOICES = 3, 27  # that a location's balls may have by an SCP of a drawing, and together
_GROSS = 300.0  # cost of a row at a false minimum: as built, an arm of the usual priors gives some 25
_OTHER_MM, _OTHER_RAD = 5.0, 0.02  # SCPs that are farther apart are different answers
_SAME_COST = 1e-6  # share by which a later candidate must be better, so that rounding chooses none


@dataclass(frozen=True, eq=False)
class SurfaceStart:
    """An SCP, T_base_target by location, and the frames with the names of their features as they fit it.

    found: whether the SCP was found from the data alone. rival: how much larger the χ² of the next best SCP found
    is, the robot's errors free within their priors; infinite where there is none. beyond_drawing: whether so few frames
    led to it that it can be a false one, and it is farther from the design than a drawing is from its part.
    """

    T_hand_sensor: Pose
    places: Mapping[str, Pose]
    frames: tuple[Frame, ...]
    found: bool
    rival: float = np.inf
    beyond_drawing: bool = False


def surface_start(
    frames: Sequence[Frame],
    target: Target | Mapping[str, Target],
    bundle: Bundle | None,
    design: Pose | None,
    drawing_sigma: Array,
    search: bool = True,
) -> SurfaceStart | None:
    """A start for condensed frames of all roles; None where there is neither a design nor a closed form.

    bundle: the problem of the frames with the role calibrate, in their order, the robot as stated. drawing_sigma (6,):
    of the design, sensor axes. search: whether a closed form is sought where the design leads nowhere.
    """
    surfaces = [f for f in frames if _placeable(target_at(target, f.location)) and len(f.axis)]
    if not surfaces:
        return None
    solved = [f for f in surfaces if f.role == "calibrate"]
    best: tuple[float, Pose] | None = None
    if design is not None:
        best = None if bundle is None else _solved(solved, target, bundle, design, faces=_MOST_CHOICES)
        rows = 0 if bundle is None else int(sum(np.sum(t.points.present) for t in bundle.terms))
        T, rival = design if best is None else best[1], np.inf
        near: Pose | None = None
        few = bundle is not None and bundle.degrees_of_freedom < _FEW
        if few and bundle is not None:
            near, rival = _near_drawing([T], solved, target, bundle, design, drawing_sigma)
        if near is not None or best is None or bundle is None or best[0] < _GROSS * rows:
            T = near or T
            named = _renamed(frames, target, T)
            far = few and _off_drawing(design, T, drawing_sigma) > _BEYOND
            return SurfaceStart(T, _places(named, target, T), named, False, rival, beyond_drawing=far)
    if len(solved) < 3 or bundle is None or not search:
        return None
    ends = [_solved(solved, target, bundle, T) for T in _candidates(_told(solved, target), target)]
    likeliest, rival = _likeliest([e for e in ends if e is not None], solved, target, bundle, lambda _: 0.0)
    if likeliest is None:
        return None
    if bundle.degrees_of_freedom < _FEW:  # a grid so coarse finds one of several answers that lie close together
        likeliest, beside = _near_drawing([], solved, target, bundle, likeliest, drawing_sigma, weighed=False)
        if likeliest is None:
            return None
        rival = min(rival, beside)
    named = _renamed(frames, target, likeliest)
    return SurfaceStart(likeliest, _places(named, target, likeliest), named, found=True, rival=rival)


def _near_drawing(
    first: Sequence[Pose],
    frames: Sequence[Frame],
    target: Target | Mapping[str, Target],
    bundle: Bundle,
    design: Pose,
    sigma: Array,
    *,
    weighed: bool = True,
) -> tuple[Pose | None, float]:
    """Of the SCPs that so few frames fit the likeliest beside a drawing of this σ, and how far the next one is behind.

    The side on which a sheet cuts a ball, and how it turns about what it sees, have several answers each, and a drawing
    a few millimetres off leads to any of them: the solve begins from places that the drawing allows as well. weighed:
    whether how far an answer is from the drawing tells against it.
    """
    rng = np.random.default_rng(0)
    starts = [*first, design, *(design @ Pose.exp(sigma * xi) for xi in rng.normal(size=(_DRAWN, 6)))]

    def prior(T: Pose) -> float:
        return _off_drawing(design, T, sigma) if weighed else 0.0

    return _likeliest([(0.0, T) for T in starts], frames, target, bundle, prior)


def _off_drawing(design: Pose, T: Pose, sigma: Array) -> float:
    """Squared distance of an SCP from the design, in σ."""
    return float(np.sum(np.square((design.inverse() @ T).log() / sigma)))


def _likeliest(
    ends: Sequence[tuple[float, Pose]],
    frames: Sequence[Frame],
    target: Target | Mapping[str, Target],
    bundle: Bundle,
    prior: Callable[[Pose], float],
) -> tuple[Pose | None, float]:
    """The SCP of the least cost, ``prior`` included, and by how much the next one that differs is larger.

    Few frames fit several: the arm's errors decide between them, so those that come near are solved with these free.
    """
    apart: list[tuple[float, Pose]] = []
    for cost, T in sorted(ends, key=lambda e: float(f"{e[0]:.5e}")):
        if all(_different(T, other) for _, other in apart):
            apart.append((cost, T))
    rows = sum(int(np.sum(t.points.present)) for t in bundle.terms)
    near = [e for e in apart if e[0] < _GROSS * rows]
    if len(near) < 2:
        return (apart[0][1], np.inf) if apart else (None, np.inf)
    free = bundle.estimating(np.ones(len(bundle.estimated), dtype=bool))
    solved = [_solved(frames, target, free, T) for _, T in near]
    weighed = ((e[0] + prior(e[1]), e[1]) for e in solved if e is not None)
    good = sorted(weighed, key=lambda e: float(f"{e[0]:.5e}"))
    if not good:
        return near[0][1], np.inf
    cost, best = good[0]
    scale = max(1.0, cost / max(bundle.degrees_of_freedom, 1))  # the noise of hand poses is not known beforehand
    return best, min(((c - cost) / scale for c, T in good[1:] if _different(T, best)), default=np.inf)


def _different(a: Pose, b: Pose) -> bool:
    """Whether two SCPs are answers apart."""
    xi = (a.inverse() @ b).log()
    return bool(np.linalg.norm(xi[:3]) > _OTHER_MM or np.linalg.norm(xi[3:]) > _OTHER_RAD)


def _told(frames: Sequence[Frame], target: Target | Mapping[str, Target]) -> list[Frame]:
    """The frames of which it is known what their points lie on: equal balls are told apart by a chain alone."""
    out = []
    for f in frames:
        own = target_at(target, f.location)
        if not isinstance(own, Balls) or f.labels_given:
            out.append(f)
        elif (names := told_alone(f, own)) is not None:
            out.append(with_names(f, names))
    return out


def begun(target: Target, frames: Sequence[Frame]) -> Target:
    """The target with a value to begin with for a shape of which nothing is known, from its condensed frames."""
    if isinstance(target, Sphere) and not target.known:
        radii = [s.radius for s in sections_of(frames, target) if s.kind == "circle"]
        return replace(target, diameter_mm=2 * max(radii)) if radii else target
    if isinstance(target, Wedge) and not target.angle_known:
        angles = face_angles(frames, target)
        middle = float(np.clip(np.median(angles), 10.0, 170.0)) if len(angles) else target.angle_deg
        return replace(target, angle_deg=middle)
    return target


def _placeable(target: Target) -> bool:
    return isinstance(target, Surface) and type(target).place is not Surface.place


def _places(frames: Sequence[Frame], target: Target | Mapping[str, Target], T_hand_sensor: Pose) -> dict[str, Pose]:
    """T_base_target of every location by its points in the base."""
    out: dict[str, Pose] = {}
    for name in dict.fromkeys(f.location for f in frames):
        own, group = target_at(target, name), [f for f in frames if f.location == name]
        if isinstance(own, Balls):
            for likeliest in balls_places(group, own, T_hand_sensor):
                out[name] = likeliest
        elif isinstance(own, Surface) and _placeable(own):
            place = own.place(*base_points(group, own, T_hand_sensor))
            if place is not None:
                out[name] = place
    return out


def base_points(frames: Sequence[Frame], target: Surface, T_hand_sensor: Pose) -> tuple[Array, Index]:
    """Points (N, 3) of frames in the base, and their features (N,)."""
    number = {name: k for k, name in enumerate(target.features)}
    points = np.concatenate([f.at @ T_hand_sensor @ f.axis.xyz_mm for f in frames])
    return points, np.array([number[label] for f in frames for label in f.axis.label], dtype=np.intp)


def _renamed(frames: Sequence[Frame], target: Target | Mapping[str, Target], T_hand_sensor: Pose) -> tuple[Frame, ...]:
    """The frames with a wedge's faces, and balls, named as the frames of a location together have them.

    Faces are named in the order of y; a roll of the sensor may turn the order about. Balls are named in any order.
    """
    out = {f.number: f for f in frames}
    for name in dict.fromkeys(f.location for f in frames):
        own = target_at(target, name)
        group = [f for f in frames if f.location == name and not f.labels_given and len(f.axis)]
        if isinstance(own, Wedge):
            turned = namings(group, own, T_hand_sensor)[0]
            out |= {f.number: exchanged(f) for f in group if f.number in turned}
        elif isinstance(own, Balls):
            for place in balls_places(group, own, T_hand_sensor):
                out |= {f.number: f for f in renamed_by_place(group, own, T_hand_sensor, place)}
    return tuple(out[f.number] for f in frames)


def _solved(
    frames: Sequence[Frame], target: Target | Mapping[str, Target], bundle: Bundle, T: Pose, faces: int = 1
) -> tuple[float, Pose] | None:
    """Cost and SCP where the bundle ends that begins at an SCP; the least of those of balls' several places.

    faces: how many namings of wedges' faces are tried.
    """
    best: tuple[float, Pose] | None = None
    for named, places in _placed(frames, target, T, faces):
        if set(places) != set(bundle.locations):
            continue
        problem = bundle.with_axes([f.axis for f in named])
        start = problem.start(T, stack_poses([places[n] for n in bundle.locations]))
        try:
            result = solve_bundle(problem, start, max_iterations=_ITERATIONS)
        except np.linalg.LinAlgError:
            continue
        if np.isfinite(result.cost) and (best is None or result.cost < best[0] * (1 - _SAME_COST)):
            best = result.cost, result.state.pose("scp")
    return best


def _placed(
    frames: Sequence[Frame], target: Target | Mapping[str, Target], T: Pose, most_faces: int
) -> Iterator[tuple[tuple[Frame, ...], dict[str, Pose]]]:
    """The frames with their features' names, and T_base_target by location, by an SCP; several where balls have any.

    most_faces: of namings of wedges' faces, the likeliest first.
    """
    named = _renamed(frames, target, T)
    first = _places(named, target, T)
    several: dict[str, list[Pose]] = {}
    faces: dict[str, list[set[int]]] = {}
    for name in dict.fromkeys(f.location for f in frames):
        own, group = target_at(target, name), [f for f in frames if f.location == name and len(f.axis)]
        if all(f.labels_given for f in group):
            continue
        if isinstance(own, Balls):
            several[name] = balls_places(group, own, T, _PLACES_OF_BALLS)
        elif isinstance(own, Wedge):
            faces[name] = namings([f for f in group if not f.labels_given], own, T)
    for turned in islice(product(*faces.values()), most_faces):
        other = set().union(*turned)
        out = {f.number: exchanged(f) if f.number in other else f for f in frames} if faces else {}
        wedges = _places([out[f.number] for f in frames if f.location in faces], target, T) if faces else {}
        for choice in islice(product(*several.values()), _MOST_CHOICES):
            out = {f.number: f for f in named} | {k: f for k, f in out.items() if f.location in faces}
            for name, place in zip(several, choice, strict=True):
                own, group = target_at(target, name), [f for f in frames if f.location == name]
                if isinstance(own, Balls):
                    out |= {f.number: f for f in renamed_by_place(group, own, T, place)}
            places = first | wedges | dict(zip(several, choice, strict=True))
            yield tuple(out[f.number] for f in frames), places


def _candidates(frames: Sequence[Frame], target: Target | Mapping[str, Target]) -> list[Pose]:
    """SCPs to be tried, the most promising first."""
    sections: list[FrameSection] = []
    for own in {id(t): t for t in (target_at(target, f.location) for f in frames)}.values():
        here = [k for k, f in enumerate(frames) if target_at(target, f.location) is own]
        found = sections_of([frames[k] for k in here], own)
        sections += [replace(s, frame=here[s.frame]) for s in found]
    if not sections:
        return []
    hands = stack_poses([f.at for f in frames])
    grid = rotation_grid(_GRID)
    linear = _Linear(grid, hands, sections)
    out: list[Pose] = []
    for k in np.argsort(np.round(linear.cost, 9), kind="stable"):
        R = grid[k]
        if all(np.linalg.norm(log_so3(R.T @ other.R)) > _APART_RAD for other in out):
            shift = linear.side(int(k), frames, target)
            out.append(Pose(R, linear.translation[k] + shift * R[:, 0]))
        if len(out) == _TRIED:
            break
    return out


class _Linear:
    """For every rotation (K) of the sensor in the hand the linear least squares of all else.

    cost (K,) [mm²], translation (K, 3) [mm], centres: (K, 3) of balls by group.
    """

    def __init__(self, rotations: Array, hands: Pose, sections: Sequence[FrameSection]) -> None:
        self.rotations, self.hands, self.sections = rotations, hands, sections
        self.groups = list(dict.fromkeys((s.group, s.kind) for s in sections))
        self.cost, self.translation = np.zeros(len(rotations)), np.zeros((len(rotations), 3))
        index = np.array([s.frame for s in sections])
        self.turn: Array = hands.R[index][None] @ rotations[:, None]  # (K, S, 3, 3) sensor axes in the base
        self.place = np.einsum("ksij,sj->ksi", self.turn, np.array([s.place for s in sections])) + hands.t[index]
        self.by_t = hands.R[index]  # (S, 3, 3)
        along = {g: self._normals(g) for g in self.groups if g[1] == "line"}
        self.translation, self.centres, residual = self._solve(along)
        for _ in range(_EDGE_ROUNDS if any(g[1] == "point" for g in self.groups) else 0):
            self.translation, self.centres, residual = self._solve(along)
        self.cost = self.cost + residual

    def _of(self, group: tuple[tuple[str, str], str]) -> Index:
        return np.array([i for i, s in enumerate(self.sections) if (s.group, s.kind) == group], dtype=np.intp)

    def _normals(self, group: tuple[tuple[str, str], str]) -> Array:
        """Normal (K, 3) of a face: at right angles to all of its lines as well as that can be."""
        mine = self._of(group)
        lines = np.einsum("ksij,sj->ksi", self.turn[:, mine], np.array([self.sections[i].direction for i in mine]))
        values, vectors = np.linalg.eigh(np.swapaxes(lines, -1, -2) @ lines)
        self.cost = self.cost + np.maximum(values[:, 0], 0.0)
        return np.asarray(vectors[..., 0])

    def _axes(self, group: tuple[tuple[str, str], str], along: Mapping[tuple[tuple[str, str], str], Array]) -> Array:
        """Directions (K, S_g, c, 3) in which a group's sections say something of their places."""
        mine = self._of(group)
        if group[1] == "line":
            return np.broadcast_to(along[group][:, None, None], (len(self.rotations), len(mine), 1, 3))
        if group[1] == "circle":
            return np.asarray(np.swapaxes(self.turn[:, mine], -1, -2)[:, :, 1:])
        points = self.place[:, mine] + np.einsum("sij,kj->ksi", self.by_t[mine], self.translation)
        off = points - points.mean(axis=1, keepdims=True)
        across = np.swapaxes(np.linalg.eigh(np.swapaxes(off, -1, -2) @ off)[1][..., :2], -1, -2)
        return np.broadcast_to(across[:, None], (len(self.rotations), len(mine), 2, 3))

    def _solve(
        self, along: Mapping[tuple[tuple[str, str], str], Array]
    ) -> tuple[Array, dict[tuple[str, str], Array], Array]:
        count = len(self.rotations)
        size = 3 + 3 * len(self.groups)
        normal, right, square = np.zeros((count, size, size)), np.zeros((count, size)), np.zeros(count)
        for g, group in enumerate(self.groups):
            mine, own = self._of(group), slice(3 + 3 * g, 6 + 3 * g)
            axes = self._axes(group, along)
            rows = np.zeros((count, len(mine), axes.shape[2], size))
            rows[..., :3] = np.einsum("ksci,sij->kscj", axes, self.by_t[mine])
            rows[..., own] = -axes
            off = -np.einsum("ksci,ksi->ksc", axes, self.place[:, mine])
            A, b = rows.reshape(count, -1, size), off.reshape(count, -1)
            normal += np.swapaxes(A, -1, -2) @ A
            right += (np.swapaxes(A, -1, -2) @ b[..., None])[..., 0]
            square += np.sum(b**2, axis=1)
        level = np.trace(normal, axis1=-2, axis2=-1)[:, None, None] / size
        solution = np.linalg.solve(normal + _RIDGE * level * np.eye(size), right[..., None])[..., 0]
        residual = square - 2 * np.sum(right * solution, axis=1)
        residual += np.einsum("ki,kij,kj->k", solution, normal, solution)
        balls = {
            group[0]: solution[:, 3 + 3 * g : 6 + 3 * g] for g, group in enumerate(self.groups) if group[1] == "circle"
        }
        return solution[:, :3], balls, np.maximum(residual, 0.0)

    def side(self, k: int, frames: Sequence[Frame], target: Target | Mapping[str, Target]) -> float:
        """How far the sensor must yet be shifted across its sheet, so that every ball's section has its radius."""
        if any(kind != "circle" for _, kind in self.groups):
            return 0.0  # the other features have told
        x, radius, whole = [], [], []
        for i, s in enumerate(self.sections):
            centre = self.centres[s.group][k]
            sensor = self.by_t[i] @ self.translation[k] + self.hands.t[s.frame]
            x.append(float(self.turn[k, i, :, 0] @ (centre - sensor)))
            radius.append(s.radius)
            whole.append(_radius(target_at(target, s.group[0]), s.group[1]))
        across, section, known = np.array(x), np.array(radius), np.array(whole)
        best = (np.inf, 0.0)
        for radii in [known] if np.all(np.isfinite(known)) else [section.max() * f * np.ones(len(x)) for f in _SIDES]:
            depth = np.sqrt(np.maximum(radii**2 - section**2, 0.0))
            shifts = np.concatenate([across - depth, across + depth])
            cost = np.sum((np.abs(across - shifts[:, None]) - depth) ** 2, axis=1)
            j = int(np.argmin(np.round(cost, 9)))
            best = min(best, (float(cost[j]), float(shifts[j])))
        return best[1]


def _radius(target: Target, feature: str) -> float:
    if isinstance(target, Sphere):
        return target.diameter_mm / 2 if target.known else np.nan
    diameters = getattr(target, "diameters_mm", None)
    return np.nan if diameters is None else float(diameters[target.features.index(feature)]) / 2
