"""Parts around a cell, one image of a scene, truth by the pixel, laser-off frames, and the OpenGL renderer."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from perceptron_emu.gl import gl_problem
from tests.workbench.helpers import Cli
from workbench.files import read_cell

STRING_ATOL_PX = 0.05  # between the two renderers
SMALL = ("--per-location", 1, "--seed", 5)
BLOCK = (
    '[[mesh]]\nname = "block"\nfile = "box.stl"\nframe = "jig"\nmaterial = "aluminium"\ntranslation_mm = [50, 0, 190]\n'
)
LONE = '[[mesh]]\nfile = "box.stl"\nmaterial = "aluminium"\nrotation_deg = [10, 20, 30]\ntranslation_mm = [0, 0, 300]\n'
JIG = '[jig]\nfile = "jig.toml"\nrotation_deg = [5, 15, 3]\ntranslation_mm = [-45, 0, 300]\n'

needs_gl = pytest.mark.skipif((PROBLEM := gl_problem()) is not None, reason=str(PROBLEM))


@pytest.fixture(scope="module")
def plan(recording: Path) -> Path:
    return recording.parent / "plan"


@pytest.fixture
def folder(plan: Path, tmp_path: Path) -> Path:
    """A folder with a box, a jig file, and two views of the recorded cell."""
    trimesh.creation.box((60, 60, 200)).export(tmp_path / "box.stl")
    (tmp_path / "jig.toml").write_bytes((plan / "jig.toml").read_bytes())
    lines = (plan.parent / "recording" / "frames.csv").read_text().splitlines()
    (tmp_path / "views.csv").write_text("\n".join(lines[:3]) + "\n")
    return tmp_path


def write(folder: Path, text: str) -> Path:
    path = folder / "scene.toml"
    path.write_text(text)
    return path


def grey(path: Path) -> np.ndarray:
    return np.asarray(cv2.imread(str(path), cv2.IMREAD_UNCHANGED))


def rows(path: Path) -> list[dict[str, str]]:
    with path.open() as stream:
        return list(csv.DictReader(stream))


def labels_of(folder: Path, number: str) -> dict[str, int]:
    return {row["surface"]: int(row["label"]) for row in rows(folder / "truth" / f"{number}_labels.csv")}


def test_parts_around_a_cell_are_lit(cli: Cli, plan: Path, folder: Path) -> None:
    """A block behind the jig gives a stripe where the truth's curve says; without the scene that place is dark."""
    views = ("--joints", folder / "views.csv", "--exact")
    scene, bare, full = write(folder, BLOCK), folder / "bare", folder / "full"
    assert cli("render", plan, "--out", bare, *views).code == 0
    result = cli("render", plan, "--out", full, *views, "--scene", scene, "--full-truth")
    assert result.code == 0, result.err
    block = grey(full / "truth" / "000_labels.png") == labels_of(full, "000")["block"]
    assert block.sum() > 100
    assert grey(full / "images" / "000.png")[block].mean() > 3 * grey(bare / "images" / "000.png")[block].mean()
    seen = [r for r in rows(full / "truth" / "000_curve.csv") if r["surface"] == "block" and r["seen"] == "1"]
    middle = [[(float(r[f"{a}1_px"]) + float(r[f"{a}2_px"])) / 2 for a in "uv"] for r in seen]
    inside = [(round(u), round(v)) for u, v in middle if 0 <= u < block.shape[1] - 1 and 0 <= v < block.shape[0] - 1]
    assert inside
    assert all(block[v - 2 : v + 3, u - 2 : u + 3].any() for u, v in inside)


def test_the_base_is_the_frame_of_a_cell(cli: Cli, plan: Path, folder: Path) -> None:
    """The same block placed in the base where the jig's place puts it gives the same images."""
    place = read_cell(plan, recorded=False).T_base_jig["A"]
    turn, shift = place.fixed_xyz_deg, place @ np.array([50.0, 0.0, 190.0])
    in_base = f'[[mesh]]\nfile = "box.stl"\nmaterial = "aluminium"\nrotation_deg = {turn.tolist()}\n'
    views = ("--joints", folder / "views.csv", "--exact")
    lines = (folder / "views.csv").read_text().splitlines()
    assert lines[1].split(",")[2] == lines[2].split(",")[2] == "A"
    for name, text in (("a", BLOCK), ("b", in_base + f"translation_mm = {shift.tolist()}\n")):
        assert cli("render", plan, "--out", folder / name, *views, "--scene", write(folder, text)).code == 0
    a, b = (grey(folder / name / "images" / "001.png").astype(int) for name in "ab")
    assert np.mean(np.abs(a - b) > 1) < 1e-4


def test_a_part_on_the_sensor_goes_along(cli: Cli, plan: Path, folder: Path) -> None:
    """What is placed in the sensor's frame is lit at the same pixels in every view."""
    finger = '[[panel]]\nname = "finger"\nwidth_mm = 30\nheight_mm = 12\nframe = "sensor"\n'
    scene = write(folder, finger + "rotation_deg = [0, 20, 0]\ntranslation_mm = [0, 60, 240]\n")
    out, views = folder / "out", ("--joints", folder / "views.csv")
    assert cli("render", plan, "--out", out, *views, "--scene", scene, "--full-truth").code == 0
    places = [grey(out / "truth" / f"{n}_labels.png") == labels_of(out, n)["finger"] for n in ("000", "001")]
    assert places[0].sum() > 20
    assert np.sum(places[0] != places[1]) < 0.02 * places[0].sum()  # what stands behind may outshine a pixel of its rim


def test_extras_are_made_good_and_change_nothing(cli: Cli, plan: Path, folder: Path) -> None:
    """Truth by the pixel and laser-off partners can be asked for later; images and truth.json stay as they are."""
    out, views = folder / "out", ("--joints", folder / "views.csv")
    assert cli("render", plan, "--out", out, *views).code == 0
    before = {n: (out / n).read_bytes() for n in ("images/000.png", "truth.json")}
    assert not (out / "truth").exists()
    assert cli("render", plan, "--out", out, *views, "--full-truth", "--ambient-frames").code == 0
    assert {n: (out / n).read_bytes() for n in before} == before
    names, labels = labels_of(out, "000"), grey(out / "truth" / "000_labels.png")
    for point in json.loads(before["truth.json"])["frames"][0]["points"]:
        u, v = (round(c) for c in point["image_px"])
        assert labels[v, u] == names[point["label"]]
    lit = labels > 0
    on, off = grey(out / "images" / "000.png")[lit].mean(), grey(out / "images_off" / "000.png")[lit].mean()
    assert off < 0.5 * on


def test_a_part_that_no_sheet_meets_is_said(cli: Cli, plan: Path, folder: Path) -> None:
    far = '[[panel]]\nname = "gate"\nwidth_mm = 100\nheight_mm = 100\ntranslation_mm = [-9000, 0, 0]\n'
    result = cli(
        "render", plan, "--out", folder / "out", "--joints", folder / "views.csv", "--scene", write(folder, far)
    )
    assert result.code == 0
    assert "meets gate in no frame" in " ".join(result.err.split())


def test_a_view_that_parts_darken_is_said(cli: Cli, plan: Path, folder: Path) -> None:
    """A plate on the sensor before the laser leaves no string to see."""
    text = '[[panel]]\nwidth_mm = 400\nheight_mm = 400\nframe = "sensor"\ntranslation_mm = [0, 0, 100]\n'
    views, scene = ("--joints", folder / "views.csv"), ("--scene", write(folder, text))
    result = cli("render", plan, "--out", folder / "given", *views, *scene)
    assert result.code == 0
    assert "frame 0, 1: every string is hidden" in result.err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (JIG, "[jig]: the cell places its own jig"),
        ('[[mesh]]\nfile = "none.stl"\n', "none.stl: no such mesh file"),
        ('[[mesh]]\nfile = "box.stl"\nunit = "m"\n', "read in m the mesh measures"),
        ('[[mesh]]\nfile = "box.stl"\nframe = "hand"\n', "mesh.0.frame"),
    ],
)
def test_bad_surroundings(cli: Cli, plan: Path, folder: Path, text: str, words: str) -> None:
    result = cli("render", plan, "--out", folder / "out", *SMALL, "--scene", write(folder, text))
    assert result.code == 2
    assert words in result.err
    assert not (folder / "out").exists()


def test_a_view_without_the_jig_is_refused(cli: Cli, plan: Path, folder: Path) -> None:
    lines = (folder / "views.csv").read_text().splitlines()
    cells = lines[1].split(",")
    cells[4] = str(float(cells[4]) + 25.0)  # the first joint turns the sensor away
    (folder / "views.csv").write_text("\n".join([lines[0], lines[2], ",".join(cells)]) + "\n")
    result = cli("render", plan, "--out", folder / "out", "--joints", folder / "views.csv")
    assert result.code == 2
    assert "frame 0 at location A" in result.err
    assert not (folder / "out").exists()


def test_one_image_of_a_scene(cli: Cli, folder: Path) -> None:
    out = folder / "out"
    assert cli("render", write(folder, JIG), "--sensor", "nominal", "--out", out, "--full-truth").code == 0
    truth = json.loads((out / "truth" / "000.json").read_text())
    assert truth["T_sensor_jig"][2][3] == 300.0
    labels, names = grey(out / "truth" / "000_labels.png"), labels_of(out, "000")
    for point in truth["points"]:
        if point["visible_fraction"] > 0.9:
            u, v = (round(c) for c in point["image_px"])
            assert labels[v, u] == names[point["label"]]
    assert cli("render", write(folder, LONE), "--sensor", "nominal", "--out", folder / "part").code == 0
    assert json.loads((folder / "part" / "truth" / "000.json").read_text()) == {"T_sensor_jig": None, "points": []}
    assert grey(folder / "part" / "images" / "000.png").max() > 50


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (LONE.replace("[0, 0, 300]", "[0, 900, 300]"), "no laser light of the scene reaches the image"),
        (LONE.replace("[0, 0, 300]", "[900, 0, 300]"), "nothing in the scene reaches the laser sheet"),
        (JIG.replace("[-45, 0, 300]", "[-45, 900, 300]"), "the jig is out of view"),
        (LONE + 'frame = "base"\n', "has no robot"),
        ("", "the file is empty"),
    ],
)
def test_never_an_empty_image(cli: Cli, folder: Path, text: str, words: str) -> None:
    result = cli("render", write(folder, text), "--sensor", "nominal", "--out", folder / "out")
    assert result.code == 2
    assert words in result.err
    assert "scene.toml" in result.err
    assert not (folder / "out").exists()


@needs_gl
@pytest.mark.processes
def test_a_cell_by_opengl(cli: Cli, plan: Path, folder: Path) -> None:
    """Two frames by the other renderer: string spots where ours has them."""
    views = ("--joints", folder / "views.csv", "--seed", 5)
    for renderer in ("own", "pyrender"):
        result = cli("render", plan, "--out", folder / renderer, *views, "--renderer", renderer)
        assert result.code == 0, result.err
    own, gl = (json.loads((folder / r / "truth.json").read_text())["frames"] for r in ("own", "pyrender"))
    compared = 0
    for a, b in zip(own, gl, strict=True):
        for p, q in zip(a["points"], b["points"], strict=True):
            if p["visible_fraction"] >= 0.9 and q["image_px"]:
                np.testing.assert_allclose(p["image_px"], q["image_px"], rtol=0, atol=STRING_ATOL_PX)
                compared += 1
    assert compared >= 8
    assert grey(folder / "pyrender" / "images" / "001.png").max() > 50
