"""What stands before the sensor: the jig's strings and solids with their materials, all in {P}."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import trimesh
from numpy.typing import NDArray

from geometry import Camera, InputError, Pose, Sensor
from jig_cad import Jig

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Material:
    """How a surface scatters light.

    diffuse: albedo of the Lambertian part. specular: reflectance of the GGX part at normal incidence. roughness: its α.
    """

    diffuse: float = 0.5
    specular: float = 0.0
    roughness: float = 0.3

    def __post_init__(self) -> None:
        """InputError where the numbers can not be a surface."""
        for name, low in (("diffuse", 0.0), ("specular", 0.0), ("roughness", 0.02)):
            value = getattr(self, name)
            if not low <= value <= 1:
                raise InputError(f"material {name} = {value:g}: must lie in {low:g} … 1")


# measured on no sample: albedos of plain paint, black anodised plate, milled aluminium (GGX's F0 of some 0.9, fine
# tool marks) and a grey wall, in round numbers
MATTE = Material(0.6)
BLACK_PLATE = Material(0.08, 0.02, 0.4)
ALUMINIUM = Material(0.1, 0.85, 0.2)
WALL = Material(0.5)


@dataclass(frozen=True, eq=False)
class Solid:
    """A body of triangles. mesh: in its own axes [mm]. T_sensor_mesh: its pose in {P}."""

    mesh: trimesh.Trimesh
    material: Material = MATTE
    T_sensor_mesh: Pose = field(default_factory=Pose.identity)
    name: str = ""

    def __post_init__(self) -> None:
        """InputError for a mesh without triangles or with numbers that are not finite."""
        if len(self.mesh.faces) == 0:
            raise InputError(f"solid {self.name or '(unnamed)'}: the mesh has no faces")
        if not np.all(np.isfinite(self.mesh.vertices)):
            raise InputError(f"solid {self.name or '(unnamed)'}: a vertex is not finite")


@dataclass(frozen=True, eq=False)
class Scene:
    """A sensor before a jig (or none) and solids.

    T_sensor_jig: the jig's pose in {P}. solids: plates, posts, walls, parts; strings are not among them.
    string_material: the thread's surface; None takes [surface] of the configuration.
    """

    sensor: Sensor
    jig: Jig | None = None
    T_sensor_jig: Pose = field(default_factory=Pose.identity)
    solids: tuple[Solid, ...] = ()
    string_material: Material | None = None

    @property
    def camera(self) -> Camera:
        """The sensor's camera; InputError where it has none."""
        return self.sensor.require_camera()


def panel(
    width_mm: float, height_mm: float, T_sensor_panel: Pose, material: Material = WALL, name: str = "panel"
) -> Solid:
    """A flat panel in the x-y plane of its own frame, centred on its origin, visible from both sides."""
    w, h = width_mm / 2, height_mm / 2
    corners = [[-w, -h, 0.0], [w, -h, 0.0], [w, h, 0.0], [-w, h, 0.0]]
    return Solid(trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False), material, T_sensor_panel, name)
