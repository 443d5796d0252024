"""Flat faces of a mesh with up to four corners: what is drawn is halved where two triangles make a quadrilateral."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from geometry.compiled import kernel

Array = NDArray[np.float64]
Index = NDArray[np.int64]

PARALLEL = 1e-12  # by which the cosine of two normals of one plane may fall short of 1


def facets(vertices: Array, faces: Index, outwards: Array) -> tuple[Array, Index]:
    """Pairs of triangles that make a convex quadrilateral, and all other triangles, alone.

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
    corners : Array
        In order (F, 4, 3) [mm], the last one twice where it is a triangle.
    owner : NDArray
        A triangle of each facet (F,).
    """
    pairs = _neighbours(faces)
    first, second, edge = pairs
    length = np.linalg.norm(vertices[edge[:, 0]] - vertices[edge[:, 1]], axis=1)
    flat = np.einsum("ij,ij->i", outwards[first], outwards[second]) > 1 - PARALLEL
    order = np.argsort(-length, kind="stable")  # across the longest edges: a strip's quadrilaterals stay whole
    order = order[flat[order]]
    corners, owner = _pair(vertices, faces, outwards, Neighbours(*(values[order] for values in pairs)))
    return vertices[corners], owner


class Neighbours(NamedTuple):
    """Two triangles (N,), (N,) for each edge (N, 2) that just two have in common."""

    first: Index
    second: Index
    edge: Index


def _neighbours(faces: Index) -> Neighbours:
    edges = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    order = np.lexsort((edges[:, 1], edges[:, 0]))
    ordered = edges[order]
    new = np.ones(len(edges) + 1, dtype=bool)
    new[1:-1] = np.any(ordered[1:] != ordered[:-1], axis=1)
    begins = np.flatnonzero(new)
    twice = begins[:-1][np.diff(begins) == 2]
    return Neighbours(order[twice] // 3, order[twice + 1] // 3, ordered[twice])


@kernel
def _pair(vertices: Array, faces: Index, outwards: Array, neighbours: Neighbours) -> tuple[Index, Index]:
    """The facets' corners (F, 4), numbers of vertices, and owners (F,)."""
    first, second, edge = neighbours
    corners, owner = np.empty((len(faces), 4), np.int64), np.empty(len(faces), np.int64)
    taken = np.zeros(len(faces), np.bool_)
    n = 0
    for k in range(len(first)):
        one, other = first[k], second[k]
        if taken[one] or taken[other]:
            continue
        at = 0
        while faces[one, at] == edge[k, 0] or faces[one, at] == edge[k, 1]:
            at += 1
        opposite = 0
        while faces[other, opposite] == edge[k, 0] or faces[other, opposite] == edge[k, 1]:
            opposite += 1
        c, a, b = faces[one, at], faces[one, (at + 1) % 3], faces[one, (at + 2) % 3]
        d = faces[other, opposite]
        if not (_turns(vertices, c, a, d, outwards[one]) and _turns(vertices, d, b, c, outwards[one])):
            continue
        corners[n, 0], corners[n, 1], corners[n, 2], corners[n, 3], owner[n] = c, a, d, b, one
        taken[one] = taken[other] = True
        n += 1
    for t in range(len(faces)):
        if not taken[t]:
            corners[n, :3], corners[n, 3], owner[n] = faces[t], faces[t, 2], t
            n += 1
    return corners[:n].copy(), owner[:n].copy()


@kernel
def _turns(vertices: Array, a: int, b: int, c: int, normal: Array) -> bool:
    """Whether the way from a over b to c turns to the left, seen against the normal."""
    p, q = vertices[b] - vertices[a], vertices[c] - vertices[b]
    x, y, z = p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]
    return bool(x * normal[0] + y * normal[1] + z * normal[2] > 0)
