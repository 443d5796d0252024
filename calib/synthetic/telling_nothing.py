"""Views of surfaces from which the SCP does not follow, each spoilt in one way, and the words that name it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from calib.synthetic.cell import TRUTH, industrial_arm
from calib.synthetic.surfaces import SurfaceCell
from geometry import NoAnswerError, Pose, Role, Surface, draw_errors, exp_so3, inverse_kinematics
from jig_cad import Edge, Plane, Sphere, Wedge

FRAMES = 9  # at each of three places; twice as many of one plane
_PLACES = {"A": (-700.0, 0.3), "B": (0.0, 0.0), "C": (650.0, -0.4)}
_LOOKING = np.diag([1.0, -1.0, -1.0])
_DRAWN = 60  # views, of which the arm reaches some half
_TRIES = 8


@dataclass(frozen=True, eq=False)
class Spoilt:
    """A kind of views: the target, what is wrong, words of which one names it, and at how many places."""

    target: Surface
    kind: str
    words: tuple[str, ...]
    places: int = 3


SHIFTED = ("shifted and hardly turned",)
ONE_AXIS = ("one axis only", "own line")
TILTS = ("different tilt", "about one axis only", "of one amount", "general position")
SPOILT = {
    "sphere, shifts alone": Spoilt(Sphere(40.0), "translation", SHIFTED),
    "sphere, one axis": Spoilt(Sphere(40.0), "one axis", ONE_AXIS),
    "sphere, through its middle": Spoilt(Sphere(40.0), "middle", ("through its middle",)),
    "one plane, shifts alone": Spoilt(Plane(), "translation", SHIFTED, 1),
    "one plane, one tilt": Spoilt(Plane(), "one tilt", (*TILTS, *ONE_AXIS), 1),
    "one plane, two tilts": Spoilt(Plane(), "two tilts", (*TILTS, *ONE_AXIS), 1),
    "one plane, three tilts": Spoilt(Plane(), "three tilts", TILTS, 1),
    "one plane, tilts about one axis": Spoilt(Plane(), "tilts about one axis", TILTS, 1),
    "one plane, tilts of one amount": Spoilt(Plane(), "one amount", TILTS, 1),
    "one plane, two amounts about two axes": Spoilt(Plane(), "two by two", TILTS, 1),
    "three planes, shifts alone": Spoilt(Plane(), "translation", SHIFTED),
    "three planes, one axis": Spoilt(Plane(), "one axis", (*ONE_AXIS, *TILTS)),
    "edge, shifts alone": Spoilt(Edge(), "translation", SHIFTED),
    "edge, one axis": Spoilt(Edge(), "one axis", ONE_AXIS),
    "edge, crossed square": Spoilt(Edge(), "square", (*ONE_AXIS, "crosses the edge's line square")),
    "wedge, shifts alone": Spoilt(Wedge(90.0), "translation", SHIFTED),
    "wedge, one axis": Spoilt(Wedge(90.0), "one axis", ONE_AXIS),
    "wedge, crossed square": Spoilt(Wedge(90.0), "square", (*ONE_AXIS, "crosses the wedge's line square")),
    "wedge, turns about its ridge": Spoilt(Wedge(90.0), "about x", ONE_AXIS),
}


def spoilt_cell(
    spoilt: Spoilt, rng: np.random.Generator, count: int | None = None, most_places: int = len(_PLACES)
) -> SurfaceCell:
    """A cell of such views, reached by an arm as built; ``count`` of them at each of so many places at most.

    Planes, which are told apart by how they stand, keep their number of places.
    """
    robot, joints, location = industrial_arm(), [], list[str]()
    places: dict[str, Pose] = {}
    stands = spoilt.places if isinstance(spoilt.target, Plane) else min(spoilt.places, most_places)
    count = count or (FRAMES if spoilt.places > 1 else 2 * FRAMES)
    for k, (name, (y, turn)) in enumerate(list(_PLACES.items())[:stands]):
        R = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) @ exp_so3(np.array([0.1, turn, 0.2]))
        if isinstance(spoilt.target, Plane) and spoilt.places > 1:  # turned otherwise, else they are one
            R = R @ exp_so3(0.5 * np.array([np.cos(2.1 * k), np.sin(2.1 * k), 0.0]))
        places[name] = Pose(R, np.array([1500.0, y, 800.0]))
        joints += _reached(places[name], spoilt.kind, count, rng)
        location += [name] * count
    built = robot.corrected(draw_errors(robot, rng))
    roles: tuple[Role, ...] = tuple("calibrate" for _ in location)
    return SurfaceCell(spoilt.target, robot, built, TRUTH, places, tuple(location), roles, np.array(joints))


def _reached(place: Pose, kind: str, count: int, rng: np.random.Generator) -> list[np.ndarray]:
    robot = industrial_arm()
    for _ in range(_TRIES):
        views = place @ _views(kind, rng, _DRAWN) @ TRUTH.inverse()
        found = inverse_kinematics(robot, views, rng, max_starts=6)
        good = found.joints[found.converged][:count]
        if len(good) == count:
            return list(good)
    raise NoAnswerError("no place of the target can be reached")


def _views(kind: str, rng: np.random.Generator, n: int) -> Pose:
    """T_target_sensor of views spoilt in one way, in all else at random."""
    tilt, roll = np.deg2rad(rng.uniform(-30, 30, (n, 2))), np.deg2rad(rng.uniform(-50, 50, n))
    off = np.column_stack([rng.uniform(-12, 12, n), rng.uniform(-15, 15, n), -rng.uniform(275, 305, n)])
    about_normal = np.zeros(n)
    if kind == "translation":
        tilt, roll = np.full((n, 2), 0.15), np.full(n, 0.2)
    elif kind == "one axis":
        tilt[:, 1], roll = 0.1, np.zeros(n)
    elif kind == "about x":
        tilt[:, 1], roll = 0.0, np.zeros(n)
    elif kind == "middle":
        off[:, 0] = 0.0
    elif kind == "square":
        tilt[:, 1], roll = 0.0, np.zeros(n)
    elif kind == "tilts about one axis":
        tilt[:, 1], about_normal, roll = 0.0, roll, np.zeros(n)
    elif kind in _TILTS:
        tilt, about_normal, roll = _TILTS[kind](n, rng), roll, np.zeros(n)
    nothing = np.zeros((n, 2))
    R = exp_so3(np.column_stack([nothing, about_normal])) @ exp_so3(np.column_stack([tilt, np.zeros(n)])) @ _LOOKING
    R = R @ exp_so3(np.column_stack([nothing, roll]))
    return Pose(R, (R @ off[..., None])[..., 0])


def _one_amount(n: int, rng: np.random.Generator) -> np.ndarray:
    way = rng.uniform(0, 2 * np.pi, n)
    return 0.35 * np.column_stack([np.cos(way), np.sin(way)])


def _two_by_two(n: int, rng: np.random.Generator) -> np.ndarray:
    """Each of two amounts about one axis with each of two about the other: four tilts."""
    return np.column_stack([rng.choice([-0.35, 0.25], n), rng.choice([-0.3, 0.4], n)])


_TILTS = {
    "one tilt": lambda n, _: np.tile([0.3, 0.1], (n, 1)),
    "two tilts": lambda n, _: np.array([[0.3, 0.1], [-0.2, 0.2]])[np.arange(n) % 2],
    "three tilts": lambda n, _: np.array([[0.3, 0.1], [-0.2, 0.2], [0.1, -0.35]])[np.arange(n) % 3],
    "one amount": _one_amount,
    "two by two": _two_by_two,
}
