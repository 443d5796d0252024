"""Targets: gradients against differences, shapes against their derivative, and figures kept as they are."""

from __future__ import annotations

import numpy as np
import pytest

from geometry import AxisPoints, InputError, Pose, SheetPoints, Surface
from jig_cad import Balls, Edge, Jig, Plane, Sphere, Wedge
from jig_cad.bodies import target_meshes
from jig_cad.jig import sample_tolerance
from jig_cad.measured import measured_balls, measured_jig
from jig_cad.sphere import sphere_centre
from jig_cad.symmetry import symmetries_of
from tests.pinned import pinned

STEP_MM, ATOL = 1e-4, 1e-6
BALLS = Balls.of({"a": (30.0, (0, 0, 0)), "b": (40.0, (90, 10, 0)), "c": (25.0, (20, 80, 15))})
LINE = Balls.of({"a": (30.0, (1, 2, 3)), "b": (20.0, (51, 52, 53))})
SURFACES: dict[str, Surface] = {
    "sphere": Sphere(40.0),
    "sphere of unknown diameter": Sphere(diameter_sigma_mm=np.inf),
    "balls": BALLS,
    "balls on a line": LINE,
    "plane": Plane(),
    "edge": Edge(),
    "wedge": Wedge(80.0),
    "valley of unknown angle": Wedge(100.0, angle_known=False),
}


def _points(target: Surface, n: int = 24) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    return rng.uniform(-60, 60, (n, 3)), rng.integers(0, len(target.features), n)


@pytest.mark.parametrize("name", SURFACES)
def test_gradients_are_those_of_differences(name: str) -> None:
    target = SURFACES[name]
    points, feature = _points(target)
    gradient = target.offset(points, feature)[1]
    for k, step in enumerate(STEP_MM * np.eye(3)):
        slope = (target.offset(points + step, feature)[0] - target.offset(points - step, feature)[0]) / (2 * STEP_MM)
        np.testing.assert_allclose(gradient[..., k], slope, rtol=0, atol=ATOL)
    for k in range(len(target.shape.sigma)):
        step = 1e-6 * np.eye(len(target.shape.sigma))[k]
        up, down = (target.shaped(s * step).offset(points, feature)[0] for s in (1, -1))
        np.testing.assert_allclose(target.by_shape(points, feature)[..., k], (up - down) / 2e-6, rtol=0, atol=1e-5)


@pytest.mark.parametrize("name", SURFACES)
def test_a_surface_is_where_its_points_are(name: str) -> None:
    """Points put on it are nowhere off it, and the place that follows from them has them on it again."""
    target = SURFACES[name]
    points, feature = _points(target, 60)
    for _ in range(50):
        away, gradient = target.offset(points, feature)
        points = points - np.einsum("nk,nkc->nc", away, gradient)
    np.testing.assert_allclose(target.offset(points, feature)[0], 0, rtol=0, atol=1e-9)
    T = Pose.exp(np.array([300.0, -200.0, 90.0, 0.4, -1.1, 0.7]))
    place = target.place(T @ points, feature)
    said = target.at_place(T, np.array([[500.0, -300.0, 400.0]]))
    frames = [
        AxisPoints((target.features[f],), np.array([-1]), p[None, 1:], np.eye(2)[None], ("",))
        for p, f in zip(points[:8], feature, strict=False)
    ]
    seen = SheetPoints.of(frames, target.features)
    at = Pose.exp(np.tile([3.0, -4.0, 250.0, 0.1, 0.2, -0.3], (8, 1)))
    found = target.predict(at, np.full(len(target.shape.sigma), 0.01), seen)
    pinned(
        {
            "place": None if place is None else place.matrix,
            "said": said,
            "predicted": found,
            "symmetries": target.symmetries,
            "freedom": target.freedom,
        }
    )
    if place is not None:
        assert np.abs(target.offset(place.inverse() @ (T @ points), feature)[0]).max() < 1e-6
    assert target.place((T @ points)[:1], feature[:1]) is None


@pytest.mark.parametrize("name", ["sphere", "balls", "plane", "edge", "wedge"])
def test_what_is_drawn_of_a_target(name: str) -> None:
    for body, mesh in target_meshes(SURFACES[name]).items():
        pinned({"name": body, "vertices": np.asarray(mesh.vertices).sum(0), "bounds": mesh.bounds, "area": mesh.area})


def test_a_centre_needs_four_points() -> None:
    points = np.array([[20.0, 0, 0], [0, 20, 0], [0, 0, 20], [-20, 0, 0]])
    assert sphere_centre(points[:3], 20.0) is None
    centre = sphere_centre(points, 20.0)
    assert centre is not None
    np.testing.assert_allclose(centre, 0, atol=1e-9)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Wedge(4.9),
        lambda: Wedge(175.1),
        lambda: Sphere(-1.0),
        lambda: Sphere(40.0, -0.1),
        lambda: Balls.of({"a": (30.0, (0, 0, 0))}),
        lambda: Balls.of({"a": (30.0, (0, 0, 0)), "b": (30.0, (29.9, 0, 0))}),
        lambda: Balls.of({"a": (30.0, (0, 0, 0)), "b": (0.0, (90, 0, 0))}),
        lambda: Jig.nominal(side_mm=-1.0),
        lambda: Jig.nominal(string_diameter_mm=200.0),
        lambda: Jig.nominal(tolerance_mm=-0.1),
    ],
)
def test_what_is_no_target_is_refused(make) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(InputError) as refused:
        make()
    pinned(str(refused.value))


def test_limits_themselves_are_targets() -> None:
    assert Wedge(5.0).angle_deg == 5.0
    assert Wedge(175.0).angle_deg == 175.0
    assert Wedge(170.0).shaped(np.array([1.0])).angle_deg == 175.0
    assert Sphere(40.0, 0.0).known
    assert Balls.of({"a": (30.0, (0, 0, 0)), "b": (30.0, (30.0, 0, 0))}).on_a_line


def _measured(change) -> tuple[object, object]:  # type: ignore[no-untyped-def]
    jig = Jig.nominal()
    T = Pose.exp(np.array([100.0, 20.0, -30.0, 0.2, 0.3, 1.4]))
    rng = np.random.default_rng(3)
    off = rng.normal(size=jig.nominal_anchors_mm.shape) * 0.02
    points = dict(zip(jig.anchors, T @ (jig.nominal_anchors_mm + off), strict=True))
    return jig, change({n: np.asarray(p) for n, p in points.items()})


CHANGES = {
    "swapped": lambda p: p | {"Bb": p["Cb"], "Cb": p["Bb"]},
    "mirrored": lambda p: {n: v * [1, 1, -1] for n, v in p.items()},
    "metres": lambda p: {n: v / 1000 for n, v in p.items()},
    "inches": lambda p: {n: v / 25.4 for n, v in p.items()},
    "centimetres": lambda p: {n: v / 10 for n, v in p.items()},
    "another": lambda p: {n: v * 1.3 for n, v in p.items()},
    "lacking": lambda p: {n: v for n, v in p.items() if n != "At"},
}


def test_a_jig_as_measured() -> None:
    jig, points = _measured(lambda p: p)
    found = measured_jig(jig, points)  # type: ignore[arg-type]
    pinned({"names": found.names, "off": found.deviation_mm, "rms": found.rms_mm, "jig": found.target})
    T = Pose.exp(np.array([10.0, 2.0, -3.0, 0.2, 0.3, 1.4]))
    there = {n: T @ (c + 0.01 * k) for k, (n, c) in enumerate(zip(BALLS.names, BALLS.centres_mm, strict=True))}
    pinned(measured_balls(BALLS, there, {"b": 40.2}))


@pytest.mark.parametrize("name", CHANGES)
def test_what_happened_to_measured_anchors_is_said(name: str) -> None:
    jig, points = _measured(CHANGES[name])
    with pytest.raises(InputError) as refused:
        measured_jig(jig, points)  # type: ignore[arg-type]
    pinned(str(refused.value))


def test_a_jigs_own_figures() -> None:
    jig = Jig.nominal(side_mm=110.0, height_mm=95.0)
    other = sample_tolerance(jig, np.random.default_rng(1))
    moved = Pose.exp(np.tile([3.0, -4.0, 250.0, 0.1, 0.2, -0.3], (2, 1)))
    axis = AxisPoints(
        jig.strings, np.full(5, -1), np.arange(10.0).reshape(5, 2), np.tile(np.eye(2), (5, 1, 1)), ("",) * 5
    )
    points = SheetPoints.of([axis, axis], jig.features)
    pinned(
        {
            "jig": jig,
            "drawn": other.anchors_mm,
            "lines": [jig.starts, jig.ends, jig.lengths, jig.directions],
            "axis": [jig.axis, jig.foot_mm, jig.side_mm, jig.height_mm, jig.anchor_sigma_mm],
            "shape": jig.shape,
            "predicted": jig.predict(moved, np.linspace(-0.1, 0.1, len(jig.shape.sigma)), points),
            "offset": jig.offset(np.arange(15.0).reshape(5, 3), np.arange(5)),
            "symmetries": jig.symmetries,
        }
    )


def test_symmetries_of_a_square() -> None:
    """Four lines of a square's corners upwards: turns by quarters and half turns, each with its renaming."""
    corners = np.array([[0.0, y, z] for y in (-50, 50) for z in (-50, 50)])
    top = corners + np.array([80.0, 0, 0])
    found = symmetries_of(np.concatenate([corners, top]), tuple("abcd"), np.arange(4), np.arange(4) + 4, 0.1)
    pinned({"n": len(found), "all": found})
