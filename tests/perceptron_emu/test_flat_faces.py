"""Triangles put together to flat faces, told by the edges around them."""

import numpy as np
import pytest
import trimesh

from perceptron_emu.solids import FlatFaces, flat_faces

MESHES = {
    "box": (trimesh.creation.box((30, 20, 10)), 6),
    "rod": (trimesh.creation.cylinder(5, 100, sections=64), 66),
    "ring": (trimesh.creation.annulus(10, 30, 5, sections=32), 66),
    "ball": (trimesh.creation.icosphere(2, 20.0), 320),
}


def faces_of(mesh: trimesh.Trimesh) -> FlatFaces:
    return flat_faces(np.array(mesh.vertices), np.array(mesh.faces, dtype=np.int64), np.array(mesh.face_normals))


def areas(faces: FlatFaces) -> np.ndarray:
    """Area (F,) along each face's normal, by its edges."""
    each = 0.5 * np.cross(faces.ends[:, 0], faces.ends[:, 1])
    total = np.add.reduceat(each, faces.begin[:-1], axis=0)
    return np.asarray(np.einsum("ij,ij->i", total, faces.facing))


@pytest.mark.parametrize("name", MESHES)
def test_faces_have_the_area_of_their_triangles(name: str) -> None:
    mesh, count = MESHES[name]
    faces = faces_of(mesh)
    assert len(faces.facing) == count
    assert areas(faces).min() > 0
    assert areas(faces).sum() == pytest.approx(mesh.area, rel=1e-12)


def test_corners_named_anew_in_every_triangle_are_the_same() -> None:
    mesh = MESHES["rod"][0]
    soup = trimesh.Trimesh(mesh.triangles.reshape(-1, 3), np.arange(3 * len(mesh.faces)).reshape(-1, 3), process=False)
    assert areas(faces_of(soup)) == pytest.approx(areas(faces_of(mesh)))


def test_two_sheets_on_one_another_are_two_faces() -> None:
    square = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 2, 3]], process=False)
    both = trimesh.util.concatenate([square, square])
    assert areas(faces_of(both)).sum() == pytest.approx(2)
