"""Clearance of sensor, hand and arm from target, floor and boxes: against meshes, and arms driven into things."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from geometry import InputError, Pose, Workspace, segments_to_boxes_mm
from geometry.sensor import housing_box
from jig_cad import Jig, Sphere
from jig_cad.solids import PillarDesign, jig_solids
from tests.workbench.helpers import Cli
from workbench.cell import DESIGN_SCP, find_robot, find_sensor, write_starter
from workbench.files import read_cell
from workbench.plan import ViewLimits, plan_limits, plan_views, seen_whole, standing
from workbench.plan.clearance import (
    SAFE_MM,
    room_at_target_mm,
    room_in_workspace_mm,
    target_boxes,
    target_in_workspace,
)
from workbench.plan.moves import straight_moves
from workbench.plan.views import ViewProblem
from workbench.plan.whole import scaled

ATOL_MM = 1e-9
NO_FLOOR = Workspace(floor_z_mm=None)


def _distance(jig: Jig, points: np.ndarray) -> np.ndarray:
    return np.min(segments_to_boxes_mm(points, points, target_boxes(jig)), axis=-1)


def test_no_solid_is_nearer_than_said() -> None:
    """The boxes hold plates, posts and strings, so the distance never exceeds that of the meshes."""
    jig = Jig.nominal()
    points = np.random.default_rng(1).uniform([-150, -150, -150], [250, 150, 250], (400, 3))
    said = _distance(jig, points)
    for name, mesh in jig_solids(jig).items():
        _, distance, _ = trimesh.proximity.closest_point(mesh, points)
        thickness = jig.string_diameter_mm / 2 if name.startswith("string") else 0.0  # boxes hold the strings' axes
        assert np.all(said <= distance + thickness + ATOL_MM)


@pytest.mark.parametrize("depth", [5.0, 60.0, 200.0])
def test_before_the_front_the_plates_edges_are_nearest_or_the_strings(depth: float) -> None:
    """Half way up, before string A: the strings lie ``depth`` behind, the plates' front edges half a height aside."""
    jig = Jig.nominal()
    _, front, _, _ = PillarDesign().plate(jig).bounds
    said = _distance(jig, np.array([[jig.height_mm / 2, 0.0, -depth]]))
    edge = np.hypot(jig.height_mm / 2, max(depth + front, 0.0))
    np.testing.assert_allclose(said, min(depth, edge), rtol=0, atol=ATOL_MM)


def _arm(name: str, joints_deg: list[float]):
    sensor = find_sensor("nominal")
    return standing(find_robot(name), np.deg2rad([joints_deg]), DESIGN_SCP, sensor)


def test_an_arm_in_the_target_is_found() -> None:
    """The jig put at the hand's place is hit, the same jig two metres off is not; a ball likewise."""
    arm = _arm("abb_irb6640_180_255", [10.0, 20.0, 10.0, 5.0, 40.0, 0.0])
    at = Pose(np.eye(3), arm.hand_mm[0, 0])
    off = Pose(np.eye(3), at.t + np.array([2000.0, 0, 0]))
    for target in (Jig.nominal(), Sphere()):
        assert room_at_target_mm(arm, target, at)[0] < 0 < room_at_target_mm(arm, target, off)[0]


def test_the_housing_alone_can_touch() -> None:
    """A jig at the far corner of the housing is hit though the hand's line and the links are far from it."""
    arm = _arm("abb_irb6640_180_255", [10.0, 20.0, 10.0, 5.0, 40.0, 0.0])
    corner = arm.T_base_sensor[0] @ housing_box(find_sensor("nominal"))[1]
    small = Jig.nominal(10, 10, 0.1, 0.01)
    assert room_at_target_mm(arm, small, Pose(np.eye(3), corner))[0] < 0
    ahead = corner + 300.0 * arm.T_base_sensor[0].R[:, 2]  # along the sensor's depth axis
    assert room_at_target_mm(arm, small, Pose(np.eye(3), ahead))[0] > 0


def test_an_arm_in_the_floor_is_found() -> None:
    """The room above a floor is that of the lowest point of what was sampled densely of links and housing."""
    arm = _arm("ur5e", [0.0, -10.0, 60.0, 0.0, 90.0, 0.0])
    edges = np.linspace(0, 1, 200)[:, None, None]
    links = arm.joints_mm[0, 1:-1] + edges * (arm.joints_mm[0, 2:] - arm.joints_mm[0, 1:-1])
    low, high = arm.housing_mm
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 9).T, indexing="ij"), -1).reshape(-1, 3)
    lowest = min(links[..., 2].min() - arm.link_mm, (arm.T_base_sensor[0] @ grid)[:, 2].min())
    room, where = room_in_workspace_mm(arm, Workspace(floor_z_mm=-900.0))
    assert where[0] == -1
    assert room[0] <= lowest + 900 - SAFE_MM + ATOL_MM
    assert room_in_workspace_mm(arm, NO_FLOOR)[0][0] == np.inf


def test_a_box_is_kept_out_of() -> None:
    arm = _arm("ur5e", [0.0, -90.0, 60.0, 0.0, 90.0, 0.0])
    middle = arm.joints_mm[0, :2].mean(axis=0)  # of the upper arm
    box = np.array([[middle - 10, middle + 10]])
    room, where = room_in_workspace_mm(arm, Workspace(None, box, ("the post",)))
    assert where[0] == 0
    assert room[0] < 0
    far = Workspace(None, box + np.array([3000.0, 0, 0]), ("the post",))
    assert room_in_workspace_mm(arm, far)[0][0] > 1000


@pytest.mark.parametrize("robot", ["ur5e", "kuka_kr6_r700"])
def test_no_planned_configuration_goes_through_the_floor(robot: str, tmp_path: Path) -> None:
    """Judged by points of its own: the links' axes and a grid in the housing, above the floor raised to the jig."""
    write_starter(tmp_path / "cell", robot, "nominal", "paper")
    cell = read_cell(tmp_path / "cell", recorded=False)
    place = cell.T_base_jig["B"]
    floor = float(place.t[2]) - 30.0  # the jig stands on a table: elbows must stay up
    problem = ViewProblem(cell.arm, cell.sensor, cell.jig, place, cell.design, workspace=Workspace(floor))
    views = plan_views(problem, 4, np.random.default_rng(0))
    low, high = housing_box(cell.sensor)
    grid = np.stack(np.meshgrid(*np.linspace(low, high, 5).T, indexing="ij"), -1).reshape(-1, 3)
    hand = cell.arm.pose(views.joints_rad)
    assert np.all((hand @ cell.design @ grid[None])[..., 2] > floor)
    assert np.all(cell.arm.link_poses(views.joints_rad).t[:, 2:, 2] > floor)
    without = plan_views(
        ViewProblem(cell.arm, cell.sensor, cell.jig, place, cell.design, workspace=NO_FLOOR),
        12,
        np.random.default_rng(0),
    )
    elbows = cell.arm.link_poses(without.joints_rad).t[:, 2:, 2]
    assert np.any(elbows < floor + 60)  # the floor was in the way


def test_a_straight_move_through_a_box_is_told(tmp_path: Path) -> None:
    """A post that stands where the hand passes between two readings that are both free of it."""
    write_starter(tmp_path / "cell", "ur5e", "nominal", "paper")
    cell = read_cell(tmp_path / "cell", recorded=False)
    ends = np.deg2rad([[side, -90.0, 60.0, 0.0, 90.0, 0.0] for side in (-60.0, 60.0)])
    middle = cell.arm.pose(np.deg2rad([0.0, -90, 60, 0, 90, 0])).t
    half = np.array([20.0, 20.0, 400.0])
    post = np.array([[middle - half, middle + half]])
    for boxes, names, hits in ((post, ("the post",), True), (np.zeros((0, 2, 3)), (), False)):
        space = Workspace(None, boxes, names)
        far = Pose(np.eye(3), np.array([5000.0, 0, 0]))
        problem = ViewProblem(cell.arm, cell.sensor, cell.jig, far, cell.design, workspace=space)
        assert np.all(room_in_workspace_mm(standing(cell.arm, ends, cell.design, cell.sensor), space)[0] > 0)
        (move,) = straight_moves(problem, "A", [4, 9], ends)
        assert (move.room_mm < 0) == hits
        if hits:
            assert move.near == "the post"
            assert "frame 4 to frame 9" in move.sentence()


def test_a_jig_that_is_too_large_is_told_with_the_size_that_fits() -> None:
    """The size named is seen whole by the same sensor, and one a fifth larger is not."""
    sensor = find_sensor("lmi_gocator_2330")
    limits = plan_limits()
    told = seen_whole(sensor, Jig.nominal(), limits)
    assert not told.fits
    assert told.side_mm is not None
    assert told.height_mm is not None
    assert f"side {told.side_mm:.0f} mm" in told.sentence(sensor, Jig.nominal())
    assert seen_whole(sensor, scaled(Jig.nominal(), told.side_mm / 100), limits).fits
    assert not seen_whole(sensor, scaled(Jig.nominal(), 1.2 * told.side_mm / 100), limits).fits
    assert seen_whole(find_sensor("nominal"), Jig.nominal(), ViewLimits()).fits


def test_a_jig_in_the_floor_is_said_before_planning(tmp_path: Path, cli: Cli) -> None:
    write_starter(tmp_path / "cell", "ur5e", "nominal", "paper")
    file = tmp_path / "cell" / "cell.toml"
    file.write_text(file.read_text() + "[workspace]\nfloor_z_mm = 500.0\n")
    result = cli("plan", tmp_path / "cell")
    assert result.code == 2
    assert "into the floor at z = 500" in result.err
    place = Pose(np.eye(3), np.array([0.0, 0.0, 5.0]))
    assert target_in_workspace(Jig.nominal(), place, Workspace(-200.0)) == ""


@pytest.mark.parametrize(
    ("table", "words"),
    [
        ("floor_z_mm = true", "floor_z_mm"),
        ("[[workspace.box]]\nmin_mm = [0, 0, 5]\nmax_mm = [1, 1, 1]", "must lie below max_mm, and in z"),
        ("flor_z_mm = 1.0", "did you mean"),
        ("link_radius_mm = -4.0", "link_radius_mm"),
        ("[[workspace.box]]\nmin_mm = [0.0, 0.0]\nmax_mm = [1.0, 1.0, 1.0]", "min_mm"),
    ],
)
def test_bad_workspaces_are_one_sentence(table: str, words: str, tmp_path: Path, cli: Cli) -> None:
    write_starter(tmp_path / "cell", "ur5e", "nominal", "paper")
    file = tmp_path / "cell" / "cell.toml"
    file.write_text(f"{file.read_text()}\n[workspace]\n{table}\n")
    result = cli("plan", tmp_path / "cell")
    assert result.code == 2
    assert words in result.err
    with pytest.raises(InputError, match=r"cell\.toml"):
        read_cell(tmp_path / "cell", recorded=False)
