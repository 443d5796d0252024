"""Visibility through meshes: the hierarchy against all triangles tried one by one, and against Embree."""

from __future__ import annotations

import numpy as np
import trimesh

from geometry import Pose
from perceptron_emu import Material, Solid
from perceptron_emu.solids import blocked, build_bvh, hidden_by_solids


def rays(n: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(seed)
    ends = rng.normal(size=(2, n, 3)) * 40
    ends[1, : n // 4, 0] = ends[0, : n // 4, 0]  # rays with a direction component of exactly 0
    return ends[0], ends[1]


def test_the_hierarchy_finds_what_all_triangles_find() -> None:
    mesh = trimesh.creation.torus(20, 7)
    tree, (origins, targets) = build_bvh(mesh.triangles), rays(2000, 1)
    alone = np.zeros(len(origins), dtype=bool)
    for triangle in mesh.triangles:
        alone |= blocked(build_bvh(triangle[None]), origins, targets)
    np.testing.assert_array_equal(blocked(tree, origins, targets), alone)
    assert 0.1 < alone.mean() < 0.9


def test_long_triangles_and_neighbouring_rays_are_found_too() -> None:
    """Through the plane of a drilled plate: its triangles are boxed in pieces, most packets of rays hit no box."""
    plate = trimesh.creation.annulus(10, 60, 2, sections=48)
    u, v = np.meshgrid(np.linspace(-70, 70, 71), np.linspace(-70, 70, 71))
    origins = np.column_stack([u.ravel(), v.ravel(), np.full(u.size, -20.0)])
    tree = build_bvh(plate.triangles)
    assert len(tree.members) > len(plate.triangles)
    targets = origins + np.array([3.0, 1.0, 40.0])
    alone = np.zeros(len(origins), dtype=bool)
    for triangle in plate.triangles:
        alone |= blocked(build_bvh(triangle[None]), origins, targets)
    np.testing.assert_array_equal(blocked(tree, origins, targets), alone)
    assert 0.3 < alone.mean() < 0.9


def test_the_hierarchy_agrees_with_embree() -> None:
    """But for rays that graze an edge, where Embree's single precision may differ."""
    mesh = trimesh.creation.torus(20, 7)
    origins, targets = rays(4000, 2)
    direction = targets - origins
    length = np.linalg.norm(direction, axis=1)
    hits, index, _ = mesh.ray.intersects_location(origins, direction / length[:, None], multiple_hits=True)
    theirs = np.zeros(len(origins), dtype=bool)
    theirs[index[np.linalg.norm(hits - origins[index], axis=1) < length[index]]] = True
    assert np.mean(theirs != blocked(build_bvh(mesh.triangles), origins, targets)) < 2e-3


def test_a_flat_panel_across_an_axis_blocks() -> None:
    panel = np.array([[[-5.0, -5, 0], [5, -5, 0], [5, 5, 0]], [[-5.0, -5, 0], [5, 5, 0], [-5, 5, 0]]])
    tree = build_bvh(panel)
    points = np.array([[0.0, 0, 1], [1, 2, 3], [9, 0, 1], [0, 0, 1]])
    ends = np.array([[0.0, 0, -1], [1, 2, -3], [9, 0, -1], [0, 0, 0.5]])
    np.testing.assert_array_equal(blocked(tree, points, ends), [True, True, False, False])


def test_several_solids_hide_what_each_hides_alone() -> None:
    """Each at its own place, in one walk; points that are hidden stay so, a point's own solid is not asked."""
    rng = np.random.default_rng(4)
    meshes = (trimesh.creation.torus(20, 7), trimesh.creation.icosphere(2, 9.0), trimesh.creation.box([30, 4, 12]))
    places = [Pose.exp(np.r_[rng.normal(size=3) * 15, rng.normal(size=3)]) for _ in meshes]
    solids = tuple(Solid(m, Material(0.5), p, str(k)) for k, (m, p) in enumerate(zip(meshes, places, strict=True)))
    origins, targets = rays(3000, 3)
    known, own = rng.random(3000) < 0.1, rng.integers(-1, 3, 3000)
    expected = known.copy()
    for k, solid in enumerate(solids):
        pose = solid.T_sensor_mesh
        expected |= blocked(build_bvh(solid.mesh.triangles), origins, targets, pose.R, pose.t) & (own != k)
    found = hidden_by_solids(solids, origins, targets, known, own)
    np.testing.assert_array_equal(found, expected)
    assert 0.2 < found.mean() < 0.9
    np.testing.assert_array_equal(hidden_by_solids((), origins, targets[0], known), known)
    seen = hidden_by_solids(solids[:1], origins, targets[0])
    np.testing.assert_array_equal(
        seen, blocked(build_bvh(meshes[0].triangles), origins, targets[0], places[0].R, places[0].t)
    )
