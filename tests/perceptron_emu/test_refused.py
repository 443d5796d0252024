"""Scenes, meshes and settings that can not be are refused in a sentence."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh

from extraction import StripeConfig
from extraction.board.charuco import dictionary
from geometry import InputError, Pose
from jig_cad import Jig
from perceptron_emu import Scene, Solid
from perceptron_emu.check import check_scene
from perceptron_emu.mesh_file import read_mesh
from tests.geometry.strategies import line_sensor

SQUARE = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0.0]], [[0, 1, 2]], process=False)


def test_a_mesh_needs_faces_and_finite_vertices() -> None:
    with pytest.raises(InputError, match="solid plate: the mesh has no faces"):
        Solid(trimesh.Trimesh(), name="plate")
    bad = SQUARE.copy()
    bad.vertices = np.array([[0, 0, 0], [1, np.nan, 0], [0, 1, 0.0]])
    with pytest.raises(InputError, match=r"solid \(unnamed\): a vertex is not finite"):
        Solid(bad)
    assert Solid(SQUARE).name == ""


def test_a_file_of_points_alone_is_no_mesh(tmp_path: Path) -> None:
    path = tmp_path / "points.ply"
    trimesh.PointCloud(np.eye(3)).export(path)
    with pytest.raises(InputError, match=r"points\.ply: "):
        read_mesh(path)


def test_a_sheet_along_all_strings_sees_none() -> None:
    along = Pose.from_fixed_xyz_deg([0.0, 0.0, 0.0], [0.0, 0.0, 300.0])
    jig = Jig.of_lines(
        {"a": (0.0, -50.0, 0.0), "b": (0.0, 50.0, 0.0), "c": (0.0, -50.0, 10.0), "d": (0.0, 50.0, 10.0),
         "e": (0.0, -50.0, 20.0), "f": (0.0, 50.0, 22.0)},
        {"one": ("a", "b"), "two": ("c", "d"), "three": ("e", "f")},
    )  # fmt: skip
    with pytest.raises(InputError, match="the laser sheet is parallel to all strings of the jig: turn the jig"):
        check_scene(Scene(line_sensor(), jig=jig, T_sensor_jig=along))


def test_settings_that_contradict_one_another() -> None:
    with pytest.raises(ValueError, match="min_width_px 9 must be below max_width_px 9"):
        StripeConfig(min_width_px=9.0, max_width_px=9.0)
    with pytest.raises(InputError, match='dictionary = "DICT_9X9" is none of OpenCV'):
        dictionary("DICT_9X9")
