"""Which meshes are convex, and over which of their triangles nothing stands, whatever their size and place."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from geometry import exp_so3
from perceptron_emu.solids.bodies import FLAT, _bare

SCALES = [1e-2, 1.0, 1e3]


def _asked(mesh: trimesh.Trimesh, scale: float = 1.0, closed: bool = True) -> tuple[bool, np.ndarray]:
    turned = mesh.vertices @ exp_so3(np.array([0.4, -0.7, 0.2])).T * scale + scale * np.array([3.0, -2.0, 5.0])
    return _bare(turned[mesh.faces], turned, closed)


@pytest.mark.parametrize("scale", SCALES)
def test_convex_solids_hide_none_of_their_own_triangles(scale: float) -> None:
    for mesh in (trimesh.creation.box((1, 2, 3)), trimesh.creation.icosphere(2), trimesh.creation.cylinder(1.0, 4.0)):
        convex, bare = _asked(mesh, scale)
        assert convex
        assert bare.all()


@pytest.mark.parametrize("scale", SCALES)
def test_of_a_solid_with_a_hollow_some_triangles_have_nothing_above(scale: float) -> None:
    corner = trimesh.util.concatenate(
        [trimesh.creation.box((2, 1, 1)), trimesh.creation.box((1, 1, 1)).apply_translation([0.5, 0, 1.0])]
    )
    convex, bare = _asked(corner, scale)
    assert not convex
    normals = corner.face_normals
    bottom, low_top = normals[:, 2] < -0.9, (normals[:, 2] > 0.9) & (corner.triangles_center[:, 2] < 0.6)
    assert bare[bottom & (corner.triangles_center[:, 2] < 0)].all()
    assert not bare[low_top].any()
    assert not _asked(corner, scale, closed=False)[1].any()
    assert _asked(trimesh.creation.box((1, 2, 3)), scale, closed=False)[1].all()


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize(("depth", "convex"), [(0.5, True), (2.0, False)])
def test_a_dent_counts_from_a_share_of_the_size_on(scale: float, depth: float, convex: bool) -> None:
    """A roof over a square whose ridge is bent inwards by so many times what counts."""
    size = 10.0
    dent = depth * FLAT * size
    v = np.array([[0, 0, 0], [size, 0, 0], [size, size, 0], [0, size, 0], [size / 2, size / 2, 3.0]])
    mesh = trimesh.Trimesh(v, [[0, 2, 1], [0, 3, 2], [0, 1, 4], [1, 2, 4], [2, 3, 4], [3, 0, 4]], process=False)
    low = trimesh.Trimesh(
        np.vstack([v, [size / 2, size / 2, dent]]),
        [[0, 5, 1], [1, 5, 2], [2, 5, 3], [3, 5, 0], *mesh.faces[2:].tolist()],
        process=False,
    )
    flat = low.vertices * scale
    assert _bare(flat[low.faces], flat, True)[0] == convex
    assert _asked(mesh, scale)[0]
