"""Mesh files of all sizes and states, read in millimetres or refused by name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from geometry import InputError, read_bytes

if TYPE_CHECKING:
    import trimesh

UNITS = {"mm": 1.0, "cm": 10.0, "m": 1000.0, "inch": 25.4}
FORMATS = (".stl", ".obj", ".ply", ".glb")
SMALLEST_MM, LARGEST_MM = 1.0, 10_000.0  # a part beyond these is in another unit than it says
FARTHEST = 1e9  # of a vertex, in any unit
MAX_MESH_BYTES = 512 * 2**20  # ten million triangles as a binary STL
OUT_OF_RANGE = "a face of the mesh names a vertex that is not there"

Unit = Literal["mm", "cm", "m", "inch"]


def read_mesh(path: Path, unit: Unit | None = None, *, allow_open: bool = False) -> trimesh.Trimesh:
    """A mesh file in millimetres.

    Parameters
    ----------
    path : Path
        STL, OBJ, PLY or GLB.
    unit : {"mm", "cm", "m", "inch"}, optional
        Of the file's numbers; mm, for GLB m, where None.
    allow_open : bool
        Take a mesh with holes.

    Returns
    -------
    trimesh.Trimesh
        [mm].

    Raises
    ------
    InputError
        Where it has no faces, is not watertight or can not be in that unit.
    """
    if path.suffix.lower() not in FORMATS:
        raise InputError(f'{path}: "{path.suffix}" is not a mesh format read here, use {", ".join(FORMATS)}')
    data = read_bytes(path, MAX_MESH_BYTES, "mesh file")
    if path.suffix.lower() == ".stl":
        _check_stl(path, data)
    mesh = _loaded(path)
    beyond = ~(np.abs(mesh.vertices) < FARTHEST).all(axis=1)
    if np.any(beyond):
        at = int(np.flatnonzero(beyond)[0])
        what = "lies beyond all parts" if np.all(np.isfinite(mesh.vertices[at])) else "is not a finite point"
        raise InputError(f"{path}: vertex {at + 1} of the mesh {what}")
    if len(mesh.faces) == 0:
        raise InputError(f"{path}: the mesh has no faces")
    if not 0 <= mesh.faces.min() <= mesh.faces.max() < len(mesh.vertices):
        raise InputError(f"{path}: {OUT_OF_RANGE} ({len(mesh.vertices)} vertices)")
    mesh.merge_vertices()
    unit = unit or ("m" if path.suffix.lower() == ".glb" else "mm")
    mesh.vertices = mesh.vertices * UNITS[unit]
    size = mesh.extents
    if not SMALLEST_MM <= float(size.max()) <= LARGEST_MM:
        text = " × ".join(f"{s:.3g}" for s in size)
        raise InputError(f'{path}: read in {unit} the mesh measures {text} mm; set unit = "mm", "cm", "m" or "inch"')
    if not (allow_open or mesh.is_watertight):
        holes = int(np.sum(np.unique(mesh.edges_sorted, axis=0, return_counts=True)[1] == 1))
        raise InputError(f"{path}: the mesh is not watertight ({holes} open edges); mend it or set open = true")
    return mesh


def _check_stl(path: Path, data: bytes) -> None:
    """A binary STL says how many triangles it has, one of text how it ends; trimesh mistakes cut ones."""
    if data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        if b"endsolid" not in data[-4096:].lower():
            raise InputError(f"{path}: the STL is cut short, its last line is not endsolid")
        return
    triangles, room = int.from_bytes(data[80:84], "little"), max(len(data) - 84, 0) // 50
    if len(data) != 84 + 50 * triangles:
        raise InputError(
            f"{path}: the STL is cut short or damaged: it announces {triangles} triangles and has room for {room}"
        )


def _loaded(path: Path) -> trimesh.Trimesh:
    """As the file has it, nothing merged or dropped."""
    import trimesh  # a quarter of a second, and most commands build no mesh

    try:
        mesh: Any = trimesh.load(path, force="mesh", process=False)
    except IndexError:
        raise InputError(f"{path}: {OUT_OF_RANGE}") from None
    except MemoryError:
        raise
    except Exception:  # noqa: BLE001 - whatever a third party's parser meets in a damaged file
        raise InputError(f"{path}: is no {path.suffix[1:].upper()}, or damaged: it can not be parsed") from None
    if not isinstance(mesh, trimesh.Trimesh):
        raise InputError(f"{path}: the mesh has no faces")
    if mesh.vertices.ndim != 2 or mesh.vertices.shape[1] != 3:
        raise InputError(f"{path}: the vertices of the mesh have {mesh.vertices.shape[-1]} coordinates, points have 3")
    return mesh
