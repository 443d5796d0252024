"""Two panels with rounded edges and a gap between them, as a scene with the truth of gap, flush and radii."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from geometry import Pose
from perceptron_emu.scene import Material, Solid

if TYPE_CHECKING:
    import trimesh

Array = NDArray[np.float64]

FACETS = 90  # of a quarter turn: they miss the circle by 4e-5 of the radius
HALF_LENGTH_MM = 6.0  # along the gap; the sheet is far thinner


@dataclass(frozen=True)
class PanelPair:
    """Two panels with rounded edges and a gap between them.

    Parameters
    ----------
    gap_mm : float
        Between the bends' extreme points along the left face.
    flush_mm : float
        By how much the right face stands nearer to the sensor.
    radii_mm : tuple of float
        Of the left and the right bend.
    face_mm, depth_mm : float
        Length and thickness of each panel.
    """

    gap_mm: float = 3.0
    flush_mm: float = 0.0
    radii_mm: tuple[float, float] = (2.0, 2.0)
    face_mm: float = 30.0
    depth_mm: float = 12.0

    def solids(self, T_sensor_panels: Pose, material: Material | None = None) -> tuple[Solid, Solid]:
        """The panels in {P}. Their own frame: y across the gap from its middle, z into the panels from the left face,
        x along the gap.
        """
        material = material or Material(0.6)
        left = self._outline(self.radii_mm[0]) + np.array([-self.gap_mm / 2, 0.0])
        right = self._outline(self.radii_mm[1]) * [-1.0, 1.0] + np.array([self.gap_mm / 2, -self.flush_mm])
        return (
            Solid(profile_strip(left), material, T_sensor_panels, "left panel"),
            Solid(profile_strip(right[::-1]), material, T_sensor_panels, "right panel"),
        )

    def _outline(self, radius_mm: float) -> Array:
        """Face, bend and flank (n, 2) as (y, z), the extreme point at y = 0 and the face at z = 0."""
        angle = np.linspace(0, np.pi / 2, FACETS + 1)
        bend = radius_mm * np.column_stack([np.sin(angle) - 1, 1 - np.cos(angle)])
        return np.vstack([[-self.face_mm, 0.0], bend, [0.0, max(self.depth_mm, radius_mm + 1.0)]])


def random_panels(rng: np.random.Generator) -> tuple[PanelPair, Pose]:
    """Panels over the range of car bodies before a sensor with 300 mm stand-off.

    Parameters
    ----------
    rng : numpy.random.Generator
        Draws gaps of 0.5 to 8 mm, flush of ±3 mm, radii of 0.5 to 4 mm, a turn of up to ±15° in the sheet, up to 20 mm
        aside.

    Returns
    -------
    panels : PanelPair
        The truth.
    T_sensor_panels : Pose
        Their place in {P}.
    """
    gap, flush, radii = rng.uniform(0.5, 8), rng.uniform(-3, 3), rng.uniform(0.5, 4, 2)
    turn, y, z = np.deg2rad(rng.uniform(-15, 15)), rng.uniform(-20, 20), rng.uniform(290, 320)
    c, s = np.cos(turn), np.sin(turn)
    pose = Pose(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([0.0, y, z]))
    return PanelPair(float(gap), float(flush), (float(radii[0]), float(radii[1]))), pose


def profile_strip(outline: Array, half_length_mm: float = HALF_LENGTH_MM) -> trimesh.Trimesh:
    """The surface that an outline sweeps along x; open, for only its outside is ever lit.

    Parameters
    ----------
    outline : Array
        (n, 2) as (y, z) [mm].
    half_length_mm : float
        To either side of x = 0.

    Returns
    -------
    trimesh.Trimesh
        In {P} where the outline is.
    """
    import trimesh  # a quarter of a second, and most commands build no mesh

    n = len(outline)
    vertices = np.vstack([np.column_stack([np.full(n, x), outline]) for x in (-half_length_mm, half_length_mm)])
    i = np.arange(n - 1)
    faces = np.vstack([np.column_stack([i, i + 1, i + n]), np.column_stack([i + 1, i + n + 1, i + n])])
    return trimesh.Trimesh(vertices, faces, process=False)
