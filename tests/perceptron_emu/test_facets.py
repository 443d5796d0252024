"""Triangles put together to flat faces of four corners."""

import numpy as np
import pytest
import trimesh

from perceptron_emu.solids import facets

MESHES = {
    "box": trimesh.creation.box((30, 20, 10)),
    "rod": trimesh.creation.cylinder(5, 100, sections=64),
    "ring": trimesh.creation.annulus(10, 30, 5),
    "ball": trimesh.creation.icosphere(2, 20.0),
}


def faces_of(mesh: trimesh.Trimesh) -> tuple[np.ndarray, np.ndarray]:
    return facets(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64), np.array(mesh.face_normals))


def vector_area(corners: np.ndarray) -> np.ndarray:
    """Area (F, 3) of polygons (F, 4, 3) along their normals."""
    return 0.5 * np.cross(corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1])


@pytest.mark.parametrize("name", MESHES)
def test_facets_have_the_area_and_the_normals_of_their_triangles(name: str) -> None:
    mesh = MESHES[name]
    corners, owner = faces_of(mesh)
    area = vector_area(corners)
    assert np.linalg.norm(area, axis=1).sum() == pytest.approx(mesh.area, rel=1e-12)
    along = np.einsum("ij,ij->i", area, np.array(mesh.face_normals)[owner])
    assert along == pytest.approx(np.linalg.norm(area, axis=1), rel=1e-9)


def test_sides_of_a_box_and_of_a_rod_are_whole() -> None:
    assert len(faces_of(MESHES["box"])[0]) == 6
    corners, _ = faces_of(MESHES["rod"])
    side = np.ptp(corners[..., 2], axis=1) > 99
    assert side.sum() == 64


def test_facets_are_convex() -> None:
    corners, owner = faces_of(MESHES["ring"])
    normal = np.array(MESHES["ring"].face_normals)[owner]
    edge = np.roll(corners, -1, axis=1) - corners
    turn = np.einsum("fki,fi->fk", np.cross(np.roll(edge, 1, axis=1), edge), normal)
    assert turn.min() > -1e-9


def test_a_ball_stays_triangles() -> None:
    corners, owner = faces_of(MESHES["ball"])
    assert len(owner) == len(MESHES["ball"].faces)
    assert np.array_equal(corners[:, 2], corners[:, 3])
