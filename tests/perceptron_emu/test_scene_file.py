"""scene.toml: what it makes, and one sentence for everything that it can not be."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from pydantic import ValidationError

from geometry import InputError, Sensor
from perceptron_emu import EmulatorConfig, Material, check_optics, read_scene, render
from perceptron_emu.mesh_file import read_mesh
from tests.perceptron_emu.conftest import jig_before
from tests.pinned import pinned

JIG = "side_mm = 100.0\nheight_mm = 100.0\nstring_diameter_mm = 0.3\ntolerance_mm = 0.1\n"
PLACE = '[jig]\nfile = "jig.toml"\nrotation_deg = [5, 15, 3]\ntranslation_mm = [-45, 0, 300]\n'


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "jig.toml").write_text(JIG)
    trimesh.creation.box((40, 30, 20)).export(tmp_path / "box.stl")
    return tmp_path


def write(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text)
    return path


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "glb"])
def test_a_part_of_any_format_gives_a_stripe(folder: Path, sensor: Sensor, suffix: str) -> None:
    scale = 1e-3 if suffix == "glb" else 1.0  # glTF is in metres
    trimesh.creation.box((40, 30, 20)).apply_scale(scale).export(folder / f"part.{suffix}")
    text = f'[[mesh]]\nfile = "part.{suffix}"\nmaterial = "aluminium"\ntranslation_mm = [0, 0, 300]\n'
    scene = read_scene(write(folder, text), sensor)
    np.testing.assert_allclose(scene.solids[0].mesh.extents, [40, 30, 20], atol=1e-4)
    assert render(scene, EmulatorConfig().off("noise", "speckle", "ambient")).image.max() > 30


def test_jig_panels_and_materials(folder: Path, sensor: Sensor) -> None:
    more = (
        '[[panel]]\nwidth_mm = 500\nheight_mm = 400\ntranslation_mm = [50, 0, 200]\nframe = "jig"\nmaterial = "grey"\n'
    )
    scene = read_scene(write(folder, PLACE + more + "[materials.grey]\ndiffuse = 0.3\n"), sensor)
    assert scene.jig is not None
    assert [s.name for s in scene.solids][-1] == "panel 0"
    assert scene.solids[-1].material.diffuse == 0.3
    assert len(scene.solids) > 3


BAD = {
    "unknown key": (PLACE + "rotaton_deg = [0, 0, 0]\n", r"scene\.toml: jig\.rotaton_deg.*rotation_deg"),
    "no file": ('[[mesh]]\nfile = "none.stl"\n', r"none\.stl: no such mesh file"),
    "format": ('[[mesh]]\nfile = "jig.toml"\n', r"jig\.toml.*not a mesh format"),
    "unit": ('[[mesh]]\nfile = "box.stl"\nunit = "m"\n', r"box\.stl: read in m the mesh measures .* unit"),
    "material": ('[[mesh]]\nfile = "box.stl"\nmaterial = "velvet"\n', r'material "velvet" is not known'),
    "frame": ('[[mesh]]\nfile = "box.stl"\nframe = "jig"\n', r'frame = "jig", but the scene has no \[jig\]'),
    "albedo": ("[materials.sun]\ndiffuse = 2.0\n", r"materials\.sun: material diffuse = 2"),
    "nan": (PLACE.replace("300", "nan"), r"jig\.translation_mm.*finite"),
    "jig beside": (PLACE.replace("[-45, 0, 300]", "[-45, 900, 300]"), r"out of view: .*field of view"),
    "jig above": (PLACE.replace("[-45, 0, 300]", "[500, 0, 300]"), r"passes the jig by"),
    "jig parallel": (
        PLACE.replace("[5, 15, 3]", "[0, 0, 90]").replace("[-45, 0, 300]", "[50, 0, 300]"),
        r"parallel|passes the jig by|out of view",
    ),
    "nothing in the sheet": (
        '[[mesh]]\nfile = "box.stl"\ntranslation_mm = [200, 0, 300]\n',
        r"nothing in the scene reaches",
    ),
    "not toml": ("[jig\n", r"scene\.toml, line 1: not valid TOML"),
}


@pytest.mark.parametrize("case", BAD)
def test_bad_scenes_are_named(folder: Path, sensor: Sensor, case: str) -> None:
    text, message = BAD[case]
    with pytest.raises(InputError, match=message) as refused:
        read_scene(write(folder, text), sensor)
    pinned(str(refused.value))


def test_open_and_empty_meshes_are_named(folder: Path, sensor: Sensor) -> None:
    box = trimesh.creation.box((40, 30, 20))
    trimesh.Trimesh(box.vertices, box.faces[:-1], process=False).export(folder / "open.stl")
    (folder / "empty.stl").write_text("solid nothing\nendsolid nothing\n")
    (folder / "broken.ply").write_bytes(b"\x00\x01\x02")
    for name, message in (("open.stl", "not watertight \\(3 open"), ("empty.stl", "empty"), ("broken.ply", "broken")):
        with pytest.raises(InputError, match=message) as refused:
            read_scene(write(folder, f'[[mesh]]\nfile = "{name}"\ntranslation_mm = [0, 0, 300]\n'), sensor)
        pinned(str(refused.value))
    text = '[[mesh]]\nfile = "open.stl"\nopen = true\ntranslation_mm = [0, 0, 300]\n'
    assert read_scene(write(folder, text), sensor).solids


@pytest.mark.parametrize(
    ("optics", "message"),
    [
        ({"filter_centre_nm": 450.0}, "blocks the laser's 660 nm"),
        ({"focus_distance_mm": 5.0}, "not beyond the chip"),
        ({"focus_distance_mm": 14.0, "defocus": True, "f_number": 1.4}, "blurs the middle"),
    ],
)
def test_impossible_optics_are_named(sensor: Sensor, optics: dict[str, object], message: str) -> None:
    with pytest.raises(InputError, match=message) as refused:
        check_optics(sensor, EmulatorConfig.model_validate({"optics": optics}))
    pinned(str(refused.value))


def test_render_refuses_impossible_optics(sensor: Sensor) -> None:
    blocked = EmulatorConfig.model_validate({"optics": {"filter_centre_nm": 450.0}})
    with pytest.raises(InputError, match="blocks the laser") as refused:
        render(jig_before(sensor), blocked)
    pinned(str(refused.value))


def test_default_optics_are_possible(sensor: Sensor) -> None:
    check_optics(sensor, EmulatorConfig())


@pytest.mark.parametrize(
    ("tables", "where"),
    [
        ({"laser": {"power_mw": -1}}, ("laser", "power_mw")),
        ({"noise": {"quantum_efficiency": float("nan")}}, ("noise", "quantum_efficiency")),
        ({"laser": {"power_mw": float("inf")}}, ("laser", "power_mw")),
        ({"motion": {"velocity_mm_s": [0.0, float("nan"), 0.0]}}, ("motion", "velocity_mm_s")),
        ({"exposure": {"shutter": "leaf"}}, ("exposure", "shutter")),
    ],
)
def test_bad_configuration_names_table_and_key(tables: dict[str, object], where: tuple[str, str]) -> None:
    """The files' reader makes its sentence of this place; infinite and NaN values are refused like any other."""
    with pytest.raises(ValidationError) as raised:
        EmulatorConfig.model_validate(tables)
    assert raised.value.errors()[0]["loc"][:2] == where


@pytest.mark.parametrize("key", ["diffuse", "specular", "roughness"])
@pytest.mark.parametrize("value", [float("nan"), float("inf"), -0.1, 1.1])
def test_impossible_materials_are_named(key: str, value: float) -> None:
    with pytest.raises(InputError, match=f"material {key}") as refused:
        Material(**{key: value})
    pinned(str(refused.value))


TETRA = "v 0 0 0\nv 60 0 0\nv 0 60 0\nv 0 0 60\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n"
PLY = (
    "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 1\n"
    "property list uchar int vertex_indices\nend_header\n0 0 0\n50 0 0\n0 50 0\n3 0 1 7\n"
)
STL = "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 50 0 0\nvertex 0 50 0\nendloop\nendfacet\n"


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("a.obj", TETRA.replace("v 60 0 0", "v 60 nan 0"), "vertex 2 of the mesh is not a finite point"),
        ("a.obj", TETRA.replace("f 2 3 4", "f 2 3 9"), "a vertex that is not there"),
        ("a.ply", PLY, "a vertex that is not there"),
        ("a.obj", "v 0 0 0\n", "has no faces"),
        ("a.obj", "# nothing\n", "has no faces"),
        ("a.obj", "v -20\nv 20\nv 0\nv 9\n" + TETRA[TETRA.index("f") :], "have 1 coordinates"),
        ("a.stl", STL, "cut short"),
        ("a.stl", "", "empty"),
    ],
)
def test_broken_meshes_are_named(tmp_path: Path, name: str, text: str, message: str) -> None:
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=message) as error:
        read_mesh(path, allow_open=True)
    assert str(path) in str(error.value)
    assert "\n" not in str(error.value)


def test_a_cut_binary_stl_is_named(tmp_path: Path) -> None:
    path = tmp_path / "a.stl"
    trimesh.creation.box((40, 30, 20)).export(path)
    assert len(read_mesh(path).faces) == 12
    path.write_bytes(path.read_bytes()[:-60])
    with pytest.raises(InputError, match="announces 12 triangles and has room for 10") as refused:
        read_mesh(path)
    pinned(str(refused.value).replace(str(tmp_path), ""))
