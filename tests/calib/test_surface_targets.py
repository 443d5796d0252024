"""Spheres, planes, edges and wedges: exact geometry seen by a sheet's rays, solved with and without a design."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib import CalibConfig, CalibrationResult, calibrate
from calib.printed import nees
from calib.surface import condensed
from calib.synthetic.cell import default_sensor
from calib.synthetic.surfaces import ProfileNoise, SurfaceCell, observe_surface, surface_cell
from geometry import AxisPoints, Frame, Pose, SheetPoints, Surface, exp_so3
from geometry.robot import RobotUncertainty
from jig_cad import Balls, Edge, Plane, Sphere, Wedge
from tests.pinned import pinned

NEES_LIMIT = 30.0  # a sound covariance exceeds it in 4 of 100,000 runs
SAME_MM = 1e-4  # one minimum, reached from two starts
TARGETS: dict[str, tuple[Surface, Surface]] = {  # as it is, as it is known
    "sphere": (Sphere(40.0), Sphere(40.0)),
    "sphere of unknown diameter": (Sphere(40.0), Sphere(diameter_sigma_mm=np.inf)),
    "plane": (Plane(), Plane()),
    "wedge": (Wedge(90.0), Wedge(90.0)),
    "wedge of unknown angle": (Wedge(80.0), Wedge(angle_known=False)),
    "edge": (Edge(), Edge()),
}


@cache
def _cell(name: str) -> SurfaceCell:
    return surface_cell(TARGETS[name][0], np.random.default_rng(3))


@cache
def _result(name: str, by_design: bool) -> CalibrationResult:
    cell = _cell(name)
    seen = observe_surface(cell, np.random.default_rng(4), ProfileNoise(), points=120, labelled=False)
    design = seen.design if by_design else None
    return calibrate(seen.frames, TARGETS[name][1], cell.robot, seen.sensor, design, config=CalibConfig(model="full"))


@pytest.mark.parametrize("name", TARGETS)
def test_truth_lies_within_sigma(name: str) -> None:
    """One cell each; that σ is true on average is benchmarks/calib_targets.py's business."""
    result = _result(name, True)
    assert result.verdict.trustworthy, result.verdict.text
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(_cell(name).T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT


def test_an_edges_sigma_are_as_large_as_its_errors() -> None:
    """With an exact arm nothing but the points' noise is left: along the rays, and where the border falls between."""
    exact, squared = ProfileNoise(joint_rad=1e-9, robot=False), []
    for seed in range(1, 17):
        rng = np.random.default_rng(seed)
        cell = surface_cell(Edge(), rng, noise=exact)
        seen = observe_surface(cell, rng, exact, labelled=False)
        robot = replace(cell.robot, uncertainty=RobotUncertainty(1e-9, 0.0, 0.0, 0.0, 0.0))
        result = calibrate(seen.frames, Edge(), robot, seen.sensor, seen.design, config=CalibConfig(model="scp"))
        pinned(result)
        assert result.T_hand_sensor is not None
        assert result.covariance is not None
        squared.append(nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance))
    assert 3.0 < np.mean(squared) < 9.5  # 6 ± 0.87; 0.2 with points that scatter along the rays alone


@pytest.mark.parametrize("name", TARGETS)
def test_no_design_is_needed(name: str) -> None:
    """Also the side of a ball's section is found; figures by design are absent then."""
    with_design, without = _result(name, True), _result(name, False)
    assert with_design.T_hand_sensor is not None
    assert without.T_hand_sensor is not None
    np.testing.assert_allclose(without.T_hand_sensor.matrix, with_design.T_hand_sensor.matrix, rtol=0, atol=SAME_MM)
    assert without.T_hand_sensor_design is None
    assert without.locations["D"].point_rms_mm.design is None
    assert without.locations["D"].point_rms_mm.solved == pytest.approx(
        with_design.locations["D"].point_rms_mm.solved, abs=SAME_MM
    )


def test_what_is_said_of_a_location_is_where_it_stands() -> None:
    """Within a millimetre: the robot's own errors carry places along."""
    atol_mm, atol_rad = 1.5, 2e-3
    at = {k: (_cell(k).T_base_target["A"], dict(_result(k, True).locations["A"].surface or {})) for k in TARGETS}
    place, said = at["sphere of unknown diameter"]
    np.testing.assert_allclose(np.array(said["centre_mm"]), place.t, rtol=0, atol=atol_mm)
    assert said["diameter_mm"] == pytest.approx(40.0, abs=0.1)
    place, said = at["plane"]
    np.testing.assert_allclose(np.array(said["normal"]), place.R[:, 2], rtol=0, atol=atol_rad)
    assert said["distance_mm"] == pytest.approx(place.R[:, 2] @ place.t, abs=atol_mm)
    for name in ("edge", "wedge of unknown angle"):
        place, said = at[name]
        direction, point = np.array(said["direction"]), np.array(said["point_mm"])
        assert abs(direction @ place.R[:, 0]) == pytest.approx(1.0, abs=atol_rad)
        assert direction[np.flatnonzero(np.abs(direction) > 1e-9)[0]] > 0
        assert point @ direction == pytest.approx(0.0, abs=1e-6)
        off = point - place.t
        assert np.linalg.norm(off - place.R[:, 0] * (off @ place.R[:, 0])) < atol_mm
    assert at["wedge of unknown angle"][1]["angle_deg"] == pytest.approx(80.0, abs=0.1)


def test_the_balls_own_centres_make_the_figures() -> None:
    location = _result("sphere", True).locations["D"]
    assert location.max_deviation_mm.design is not None
    assert location.max_deviation_mm.solved is not None
    assert location.max_deviation_mm.solved < location.max_deviation_mm.design
    assert len(location.distances.frame) + location.centres_left_out == 8
    assert location.n_found == 8 * 120
    assert _result("plane", True).locations["D"].max_deviation_mm.solved is None


def test_targets_may_differ_by_location() -> None:
    """A ball at A and B, a plate at C, in one solve without a design."""
    ball, plate = Sphere(40.0), Plane()
    rng = np.random.default_rng(8)
    one = surface_cell(ball, rng, (("A", "calibrate", 9), ("B", "calibrate", 9)))
    other = surface_cell(plate, np.random.default_rng(9), (("C", "calibrate", 9),))
    other = SurfaceCell(plate, one.robot, one.built, one.T_hand_sensor, other.T_base_target, other.location, other.role,
                        other.joints_rad)  # fmt: skip
    first = observe_surface(one, rng, ProfileNoise(), 60, labelled=False)
    second = observe_surface(other, rng, ProfileNoise(), 60, labelled=False)
    frames = (
        *first.frames,
        *(Frame(100 + f.number, f.location, joints_rad=f.joints_rad, axis=f.axis) for f in second.frames),
    )
    targets = {"A": ball, "B": ball, "C": plate}
    result = calibrate(frames, targets, one.robot, first.sensor, None, config=CalibConfig(model="full"))
    pinned(result)
    assert result.T_hand_sensor is not None, result.verdict.text
    assert result.covariance is not None
    assert nees(one.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT
    assert {k: dict(v.surface or {})["kind"] for k, v in result.locations.items()} == {
        "A": "sphere", "B": "sphere", "C": "plane",
    }  # fmt: skip


@pytest.mark.parametrize(
    "target", [Sphere(40.0), Plane(), Edge(), Wedge(70.0), Balls.of({"a": (20.0, (0, 0, 0)), "b": (30.0, (60, 5, 9))})]
)
def test_derivatives_agree_with_differences(target: Surface) -> None:
    rng = np.random.default_rng(1)
    step, atol = 1e-5, 1e-6
    T = Pose(exp_so3(rng.normal(size=(2, 3))), rng.normal(size=(2, 3)) * 30)
    feature = rng.integers(0, len(target.features), (2, 5))
    points = SheetPoints(
        rng.normal(size=(2, 5, 2)) * 40, np.tile(np.eye(2), (2, 5, 1, 1)), np.ones((2, 5), bool), feature
    )
    nothing = np.zeros(len(target.shape.sigma))
    found = target.predict(T, nothing, points)
    for k in range(6):
        xi = step * np.eye(6)[k]
        ends = [target.predict(Pose.exp(s * xi) @ T, nothing, points).residual for s in (1, -1)]
        np.testing.assert_allclose(found.by_motion[..., k], (ends[0] - ends[1]) / (2 * step), rtol=0, atol=atol)
    for k in range(len(nothing)):
        change = step * np.eye(len(nothing))[k]
        ends = [target.predict(T, s * change, points).residual for s in (1, -1)]
        np.testing.assert_allclose(found.by_shape[..., k], (ends[0] - ends[1]) / (2 * step), rtol=0, atol=atol)


@pytest.mark.parametrize("target", [Sphere(40.0), Plane()])
def test_few_points_say_what_many_say(target: Surface) -> None:
    """The information of 400 points about the target's place is that of two or three nodes, to second order."""
    rng = np.random.default_rng(2)
    if isinstance(target, Sphere):
        turn = rng.uniform(-2.2, -0.9, 400)
        yz = np.column_stack([np.cos(turn), np.sin(turn)]) * np.sqrt(20.0**2 - 8.0**2)
        T = Pose(np.eye(3), np.array([8.0, 0.0, 0.0]))
    else:
        y = rng.uniform(-30, 30, 400)
        yz = np.column_stack([y, 0.3 * y + 5])
        z = np.cross([0.0, 1.0, 0.3], [1.0, 0.2, 0.1])
        z /= np.linalg.norm(z)
        x = np.cross([0.0, 1.0, 0.0], z)
        x /= np.linalg.norm(x)
        T = Pose(np.column_stack([x, np.cross(z, x), z]), np.array([0.0, 0.0, 5.0]))
    cov = np.tile(np.eye(2), (400, 1, 1)) * rng.uniform(0.5, 2, 400)[:, None, None] * 1e-6
    label = target.features[:1] * 400
    yz = yz + rng.normal(size=yz.shape) * np.sqrt(cov[:, :1, 0])
    raw = Frame(0, "A", axis=AxisPoints(label, np.full(400, -1), yz, cov, ("",) * 400))
    few = condensed([raw], target)
    assert few.scale == pytest.approx(1.0, abs=0.25)  # 400 residuals tell it to 7 %
    assert len(few.frames[0].axis) <= 3
    whole, small = (_information(f, target, T) for f in (raw, few.frames[0]))
    factor = few.scale * few.inflation
    np.testing.assert_allclose(small * factor, whole, rtol=0, atol=2e-3 * np.abs(whole).max())


def _information(f: Frame, target: Surface, T: Pose) -> np.ndarray:
    points = SheetPoints.of([f.axis], target.features)
    found = target.predict(
        T[None] if T.t.ndim > 1 else Pose(T.R[None], T.t[None]), np.zeros(len(target.shape.sigma)), points
    )
    assert found.by_point is not None
    J = found.by_motion[0, :, 0]
    variance = np.einsum("mi,mij,mj->m", found.by_point[0, :, 0], points.cov_mm2[0], found.by_point[0, :, 0])
    return J.T @ (J / variance[:, None])


def test_neighbours_that_share_their_noise_count_less() -> None:
    """A first-order process of correlation 0.8 counts nine neighbours as one."""
    cell = _cell("plane")
    noise = ProfileNoise(correlation=0.8)
    seen = observe_surface(cell, np.random.default_rng(4), noise, points=400)
    few = condensed(seen.frames, cell.target)
    assert few.inflation == pytest.approx((1 + 0.8) / (1 - 0.8), rel=0.15)
    assert few.scale == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("stated", [39.8, 40.3])
def test_a_diameter_that_the_data_contradict_is_said_in_sigma(stated: float) -> None:
    """Too small a ball contradicts its sections at once, too large a one only the views together."""
    cell = _cell("sphere")
    seen = observe_surface(cell, np.random.default_rng(4), ProfileNoise(), points=120, labelled=False)
    config = CalibConfig(model="full")
    result = calibrate(seen.frames, Sphere(stated), cell.robot, seen.sensor, seen.design, config=config)
    pinned(result)
    assert result.verdict.code == "priors_contradict"
    assert f"{stated:g} mm by target.toml" in result.verdict.text
    assert result.T_hand_sensor is not None
    assert result.covariance is not None
    assert nees(cell.T_hand_sensor, result.T_hand_sensor, result.covariance) < NEES_LIMIT
    assert _result("sphere", True).verdict.code == "ok"


def _by_hand_poses(count: int) -> tuple[SurfaceCell, list[Frame]]:
    """Views of a ball at one place with an exact arm's hand poses alone."""
    rng = np.random.default_rng(3)
    noise = ProfileNoise(robot=False)
    cell = surface_cell(Sphere(40.0), rng, (("A", "calibrate", count),), noise)
    seen = observe_surface(cell, rng, noise, points=120, labelled=False)
    hands = cell.robot.pose(cell.joints_rad)
    return cell, [replace(f, joints_rad=None, T_base_hand=hands[i]) for i, f in enumerate(seen.frames)]


@pytest.mark.parametrize("stated", [39.4, 40.6])
def test_noise_of_hand_poses_does_not_hide_a_wrong_diameter(stated: float) -> None:
    """It is learnt from the residuals, which a wrong diameter makes large."""
    cell, frames = _by_hand_poses(12)
    result = calibrate(frames, Sphere(stated), None, default_sensor(), cell.design)
    pinned(result)
    assert result.verdict.code == "priors_contradict", result.verdict.text
    assert f"{stated:g} mm by target.toml" in result.verdict.text
    assert calibrate(frames, Sphere(40.0), None, default_sensor(), cell.design).verdict.code in ("ok", "weak")


def test_profiles_out_of_step_are_named_whatever_else_the_views_lack() -> None:
    """Each profile with the row after its own: what so wrong a set leaves open is not the cause."""
    cell, frames = _by_hand_poses(10)
    after = [replace(a, axis=b.axis, n_points=b.n_points) for a, b in zip(frames[1:], frames[:-1], strict=True)]
    result = calibrate(after, Sphere(40.0), None, default_sensor(), cell.design)
    pinned(result)
    assert not result.verdict.trustworthy
    assert result.T_hand_sensor is None
    assert "profiles and poses are out of step" in result.verdict.text
