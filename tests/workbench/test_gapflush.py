"""`profile` and `gapflush` on panels that the emulator renders, with the truth of their construction."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh
from shapely.geometry import Polygon

from assets import path as asset
from perceptron_emu import EmulatorConfig, Material, Scene, Solid, render
from tests.workbench.helpers import Cli
from workbench.formats import read_sensor, write_png

GAP_MM, FLUSH_MM, RADII_MM = 4.0, 0.8, (2.0, 2.5)
ATOL_GAP_MM = 0.15  # a section blurs a steep bend: the gap comes out small by 0.1 mm
ATOL_FLUSH_MM = 0.02
ATOL_RADIUS_MM = 0.2
PAINT = Material(0.6)


def panel_solid(side: float, edge_y_mm: float, top_z_mm: float, radius_mm: float) -> Solid:
    """A thick panel whose face looks at the sensor; ``side`` +1: it lies at smaller y and its bend looks to +y."""
    angle = np.linspace(0, np.pi / 2, 60)
    bend = np.column_stack([radius_mm * (np.sin(angle) - 1), radius_mm * (1 - np.cos(angle))])
    outline = np.vstack([[-40.0, 0.0], bend, [0.0, 12.0], [-40.0, 12.0]])
    outline = outline * [side, 1.0] + [edge_y_mm, top_z_mm]
    body = trimesh.creation.extrude_polygon(Polygon(outline), 60.0)
    y, z, x = body.vertices.T
    mesh = trimesh.Trimesh(np.column_stack([x - 30.0, y, z]), body.faces, process=True)
    mesh.fix_normals()
    return Solid(mesh, PAINT)


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rendered frame of two panels under the nominal sensor."""
    sensor = read_sensor(asset("sensors", "nominal")).model
    z = 300.0
    left = panel_solid(1.0, -GAP_MM / 2, z, RADII_MM[0])
    right = panel_solid(-1.0, GAP_MM / 2, z - FLUSH_MM, RADII_MM[1])
    smooth = EmulatorConfig.model_validate({"exposure": {"time_ms": 0.3}, "speckle": {"enabled": False}})
    frame = render(Scene(sensor, None, solids=(left, right)), smooth, np.random.default_rng(1))
    file = tmp_path_factory.mktemp("panels") / "panels.png"
    write_png(file, frame.image)
    return file


SENSOR = asset("sensors", "nominal")


def test_rendered_panels_give_their_gap_and_flush(cli: Cli, picture: Path) -> None:
    result = cli("gapflush", picture, "--sensor", SENSOR, "--json", "--picture", picture.with_name("window.png"))
    assert result.code == 0, result.err
    answer = result.json
    assert answer["gap_mm"] == pytest.approx(GAP_MM, abs=min(ATOL_GAP_MM, 2.5 * answer["sigma_gap_mm"]))
    assert answer["flush_mm"] == pytest.approx(FLUSH_MM, abs=ATOL_FLUSH_MM)
    assert answer["radius_mm"] == pytest.approx(RADII_MM, abs=ATOL_RADIUS_MM)
    assert answer["flag"] == ""
    assert cv2.imread(str(picture.with_name("window.png"))).shape[0] > 200


def test_a_written_profile_gives_the_same_answer(cli: Cli, picture: Path) -> None:
    csv = picture.with_suffix(".csv")
    written = cli("profile", picture, "--sensor", SENSOR, "--csv", csv, "--ply", picture.with_suffix(".ply"))
    assert written.code == 0, written.err
    assert written.out == ""
    assert len(trimesh.load(picture.with_suffix(".ply")).vertices) > 300
    straight = cli("gapflush", picture, "--sensor", SENSOR, "--json").json
    again = cli("gapflush", csv, "--json").json
    assert again["gap_mm"] == pytest.approx(straight["gap_mm"], abs=1e-4)
    table = cli("gapflush", csv)
    assert "gap" in table.out
    assert table.code == 0


def test_settings_and_their_mistakes(cli: Cli, picture: Path, tmp_path: Path) -> None:
    good, bad = tmp_path / "good.toml", tmp_path / "bad.toml"
    good.write_text('[gapflush]\nreference = "right"\n[stripe]\nselect = "continuous"\n')
    bad.write_text("[gapflush]\nreferense = 'right'\n")
    right = cli("gapflush", picture, "--sensor", SENSOR, "--config", good, "--json")
    assert right.json["reference"] == "right"
    assert right.json["flush_mm"] == pytest.approx(-FLUSH_MM, abs=ATOL_FLUSH_MM)
    wrong = cli("gapflush", picture, "--sensor", SENSOR, "--config", bad)
    assert wrong.code == 2
    assert "bad.toml, line 2" in wrong.err
    assert 'did you mean "reference"' in wrong.err


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("gapflush", "nowhere.csv"), 2, "nowhere.csv"),
        (("gapflush", "picture.png"), 2, "--sensor"),
        (("profile", "picture.png", "--sensor", SENSOR), 2, "--csv"),
        (("profile", "nowhere.png", "--sensor", SENSOR, "--csv", "x.csv"), 2, "nowhere.png"),
    ],
)
def test_unusable_arguments(cli: Cli, arguments: tuple[object, ...], code: int, words: str) -> None:
    result = cli(*arguments)
    assert result.code == code
    assert words in result.err
    assert len(result.err.splitlines()) == 1


def test_no_stripe_and_no_panels_are_no_answers(cli: Cli, tmp_path: Path) -> None:
    sensor = read_sensor(SENSOR).model
    dark = tmp_path / "dark.png"
    write_png(dark, np.full((sensor.height_px, sensor.width_px), 12, np.uint8))
    empty = cli("profile", dark, "--sensor", SENSOR, "--csv", tmp_path / "p.csv")
    assert empty.code == 3
    assert "no stripe" in empty.err
    none = cli("gapflush", dark, "--sensor", SENSOR)
    assert none.code == 3
    assert "points" in none.err
