"""What stands before the sensor: the jig's strings and solids with their materials, all in {P}."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from geometry import Camera, InputError, Pose, Sensor
from jig_cad import Jig

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]


MAX_SCATTER_MM = 5.0  # skin has some 0.7, marble 0.3, wax a few


@dataclass(frozen=True)
class Material:
    """How a surface scatters light.

    Parameters
    ----------
    diffuse : float
        Albedo of the Lambertian part, 0 … 1.
    specular : float
        Reflectance of the glossy part (GGX) at normal incidence, 0 … 1; 0 is matte.
    roughness : float
        α of the glossy part, 0.02 … 1.
    scatter_mm : float
        Mean free path below the surface of the matte part's light [mm]; 0: it comes back from where it falls.

    Raises
    ------
    InputError
        Where the numbers can not be a surface.
    """

    diffuse: float = 0.5
    specular: float = 0.0
    roughness: float = 0.3
    scatter_mm: float = 0.0

    def __post_init__(self) -> None:
        """InputError where the numbers can not be a surface."""
        for name, low in (("diffuse", 0.0), ("specular", 0.0), ("roughness", 0.02)):
            value = getattr(self, name)
            if not low <= value <= 1:
                raise InputError(f"material {name} = {value:g}: must lie in {low:g} … 1")
        if not 0 <= self.scatter_mm <= MAX_SCATTER_MM:
            raise InputError(
                f"material scatter_mm = {self.scatter_mm:g}: must lie in 0 … {MAX_SCATTER_MM:g}; beyond, light "
                f"comes out of all of the body and no stripe is left"
            )
        if self.diffuse + self.specular > 1 + 1e-9:
            raise InputError(
                f"material diffuse = {self.diffuse:g} and specular = {self.specular:g}: together above 1, it would "
                f"send back more light than falls on it; lower one"
            )


# measured on no sample: albedos of plain paint, black anodised plate, milled aluminium (GGX's F0 of some 0.9, fine
# tool marks) and a grey wall, in round numbers
MATTE = Material(0.6)
BLACK_PLATE = Material(0.08, 0.02, 0.4)
ALUMINIUM = Material(0.1, 0.85, 0.2)
WALL = Material(0.5)


@dataclass(frozen=True, eq=False)
class Solid:
    """A body of triangles.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        In its own axes [mm].
    material : Material
        One for all of it.
    T_sensor_mesh : Pose
        The mesh's axes in {P}.
    name : str
        For labels and messages.

    Raises
    ------
    InputError
        For a mesh without triangles or with numbers that are not finite.
    """

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

    Parameters
    ----------
    sensor : Sensor
        With a camera, to be rendered.
    jig : Jig, optional
        The strings.
    T_sensor_jig : Pose
        The jig's pose in {P}.
    solids : tuple of Solid
        Plates, posts, walls, parts; strings are not among them.
    string_material : Material, optional
        The thread's surface; [surface] of the configuration where None.
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
    """A flat panel, visible from both sides.

    Parameters
    ----------
    width_mm, height_mm : float
        Along x and y of its own frame, centred on its origin.
    T_sensor_panel : Pose
        That frame in {P}.
    material : Material
        A grey wall's by default.
    name : str
        For labels and messages.

    Returns
    -------
    Solid
        Two triangles.
    """
    import trimesh  # a quarter of a second, and most commands build no mesh

    w, h = width_mm / 2, height_mm / 2
    corners = [[-w, -h, 0.0], [w, -h, 0.0], [w, h, 0.0], [-w, h, 0.0]]
    return Solid(trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False), material, T_sensor_panel, name)
