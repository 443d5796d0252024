"""Flat faces of a mesh: triangles of one plane that hang together, told by the edges around them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Index = NDArray[np.int64]

PARALLEL = 1e-12  # by which the cosine of two normals of one plane may fall short of 1


class FlatFaces(NamedTuple):
    """Plane parts of a surface (F,), with any number of corners and holes.

    Parameters
    ----------
    begin : NDArray
        (F + 1,) where each face's edges begin.
    ends : Array
        (E, 2, 3) [mm] of the edges around it, its inner rims among them.
    facing : Array
        (F, 3) unit normals.
    """

    begin: Index
    ends: Array
    facing: Array


def flat_faces(vertices: Array, faces: Index, outwards: Array) -> FlatFaces:
    """The flat faces of a mesh.

    Triangles belong together where they share an edge and their normals are the same; edges between them are left out.

    Parameters
    ----------
    vertices : Array
        (V, 3) [mm].
    faces : NDArray
        (T, 3) corners of the triangles.
    outwards : Array
        Their unit normals (T, 3).

    Returns
    -------
    FlatFaces
        In the order of each one's first triangle; triangles without area are left out.
    """
    places, number = np.unique(vertices, axis=0, return_inverse=True)  # files of triangles name every corner anew
    corners = number.reshape(-1)[faces]
    edges = corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)
    ordered = np.sort(edges, axis=1)
    order = np.lexsort((ordered[:, 1], ordered[:, 0]))
    new = np.ones(len(edges) + 1, dtype=bool)
    new[1:-1] = np.any(ordered[order][1:] != ordered[order][:-1], axis=1)
    begins = np.flatnonzero(new)
    twice = begins[:-1][np.diff(begins) == 2]
    one, other = order[twice], order[twice + 1]
    inner = np.einsum("ij,ij->i", outwards[one // 3], outwards[other // 3]) > 1 - PARALLEL
    inner &= edges[one, 0] == edges[other, 1]  # wound the same way; two sheets on one another are two faces
    one, other = one[inner], other[inner]
    owner = _joined(len(faces), one // 3, other // 3)
    rim = np.ones(len(edges), dtype=bool)
    rim[one] = rim[other] = False
    rim &= np.repeat(np.any(outwards != 0, axis=1), 3)
    rim &= edges[:, 0] != edges[:, 1]
    kept = np.flatnonzero(rim)
    kept = kept[np.argsort(owner[kept // 3], kind="stable")]
    which, count = np.unique(owner[kept // 3], return_counts=True)
    return FlatFaces(np.concatenate([[0], np.cumsum(count)]), places[edges[kept]], outwards[which])


@kernel
def _joined(count: int, one: Index, other: Index) -> Index:
    """The first triangle (T,) of what each belongs to, where pairs of triangles belong together."""
    first = np.arange(count)
    for k in range(len(one)):
        a, b = one[k], other[k]
        while first[a] != a:
            first[a] = first[first[a]]
            a = first[a]
        while first[b] != b:
            first[b] = first[first[b]]
            b = first[b]
        first[max(a, b)] = min(a, b)
    for t in range(count):
        first[t] = first[first[t]]  # a first triangle comes before those that follow it
    return first
