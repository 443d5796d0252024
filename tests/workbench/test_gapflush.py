"""`profile` and `gapflush` on panels that the emulator renders, with the truth of their construction."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from assets import path as asset
from extraction import extract_profile, measure_gap_flush
from geometry import Pose
from perceptron_emu import EmulatorConfig, Scene, render
from perceptron_emu.solids import PanelPair, random_panels
from tests.workbench.helpers import Cli
from workbench.files import read_sensor, write_png

PANELS = PanelPair(4.0, 0.8, (2.0, 2.5))
ATOL_GAP_MM, ATOL_FLUSH_MM, ATOL_RADIUS_MM = 0.06, 0.02, 0.1
SENSOR = asset("sensors", "nominal")


def image_of(panels: PanelPair, turn_deg: float = 0.0, speckle: bool = False, seed: int = 1) -> np.ndarray:
    """Panels turned in the sheet, 300 mm before the nominal sensor."""
    c, s = np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))
    pose = Pose(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([0, 0, 300.0]))
    config = EmulatorConfig.model_validate({"exposure": {"time_ms": 0.3}, "speckle": {"enabled": speckle}})
    scene = Scene(read_sensor(SENSOR), None, solids=panels.solids(pose))
    return render(scene, config, np.random.default_rng(seed)).image


@pytest.fixture(scope="module")
def picture(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A rendered frame of two panels under the nominal sensor."""
    file = tmp_path_factory.mktemp("panels") / "panels.png"
    write_png(file, image_of(PANELS))
    return file


def test_rendered_panels_give_their_gap_and_flush(cli: Cli, picture: Path) -> None:
    result = cli("gapflush", picture, "--sensor", SENSOR, "--json", "--picture", picture.with_name("window.png"))
    assert result.code == 0, result.err
    answer = result.json
    assert answer["gap_mm"] == pytest.approx(PANELS.gap_mm, abs=min(ATOL_GAP_MM, 3 * answer["sigma_gap_mm"]))
    assert answer["flush_mm"] == pytest.approx(PANELS.flush_mm, abs=ATOL_FLUSH_MM)
    assert answer["radius_mm"] == pytest.approx(PANELS.radii_mm, abs=ATOL_RADIUS_MM)
    assert answer["flag"] == ""
    assert cv2.imread(str(picture.with_name("window.png"))).shape[0] > 200


def test_definitions_of_rendered_panels(cli: Cli, picture: Path) -> None:
    """Known radii leave less to fit; a master that is the part itself makes the answer the certificate's."""
    asked = ("gapflush", picture, "--sensor", SENSOR, "--definition", "fixed_radius", "--fixed-radius-mm", 2.0, 2.5)
    found = cli(*asked, "--gauge-depth-mm", 1.5, "--gauge-offset-mm", 4, "--json").json
    by = found["definitions"]
    assert list(by) == ["extreme", "tangent", "edge", "fixed_radius", "gauge"]
    assert by["fixed_radius"]["sigma_gap_mm"] < by["extreme"]["sigma_gap_mm"]
    truth = {"fixed_radius": PANELS.gap_mm, "edge": PANELS.gap_mm, "tangent": PANELS.gap_mm + 4.5}
    for name, gap in truth.items():
        assert by[name]["gap_mm"] == pytest.approx(gap, abs=min(ATOL_GAP_MM, 3.5 * by[name]["sigma_gap_mm"])), name
        assert by[name]["flush_mm"] == pytest.approx(PANELS.flush_mm, abs=ATOL_FLUSH_MM)
    mastered = cli(
        *asked, "--master", picture, "--master-mm", 4.05, 0.7, "--master-uncertainty-mm", 0.01, "--json"
    ).json
    assert (mastered["gap_mm"], mastered["flush_mm"]) == pytest.approx((4.05, 0.7), abs=1e-6)
    assert mastered["sigma_gap_mm"] > found["sigma_gap_mm"]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--definition", "gauge"), "gauge_depth_mm"),
        (("--definition", "fixed_radius"), "fixed_radius_mm"),
        (("--fixed-radius-mm", 2, 200), "max_radius_mm"),
        (("--master", "m.csv"), "--master-mm"),
    ],
)
def test_definitions_that_lack_something(cli: Cli, picture: Path, options: tuple[str, ...], words: str) -> None:
    result = cli("gapflush", picture, "--sensor", SENSOR, *options)
    assert result.code == 2
    assert words in result.err


@pytest.mark.parametrize(
    ("panels", "turn_deg"),
    [
        (PanelPair(0.5, 0.0, (1.0, 1.5)), 0.0),
        (PanelPair(8.0, -3.0, (4.0, 3.0)), -12.0),
        (PanelPair(2.0, 3.0, (0.5, 0.7)), 8.0),
    ],
)
def test_panels_from_end_to_end_of_the_range(panels: PanelPair, turn_deg: float) -> None:
    """Without speckle all four lengths lie within 3.5 σ of truth, and σ is small enough to mean something."""
    sensor = read_sensor(SENSOR)
    g = measure_gap_flush(extract_profile(image_of(panels, turn_deg), sensor))
    found = np.array([g.gap_mm, g.flush_mm, *g.radius_mm])
    sigma = np.array([g.sigma_gap_mm, g.sigma_flush_mm, *g.sigma_radius_mm])
    off = found - [panels.gap_mm, panels.flush_mm, *panels.radii_mm]
    assert np.all(np.abs(off) < np.minimum(3.5 * sigma, [ATOL_GAP_MM, ATOL_FLUSH_MM, ATOL_RADIUS_MM, ATOL_RADIUS_MM]))
    assert g.blur_px == pytest.approx(0.96, abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("speckle", [False, True])
def test_sigma_of_gap_and_flush_is_true(speckle: bool) -> None:
    """Monte Carlo over 100 random panels as the benchmark draws them: no bias, errors as large as σ says."""
    sensor = read_sensor(SENSOR)
    config = EmulatorConfig.model_validate({"exposure": {"time_ms": 0.3}, "speckle": {"enabled": speckle}})
    pulls = []
    for seed in range(100):
        rng = np.random.default_rng([3, seed])
        panels, pose = random_panels(rng)
        g = measure_gap_flush(
            extract_profile(render(Scene(sensor, None, solids=panels.solids(pose)), config, rng).image, sensor)
        )
        if not g.flag:
            pulls.append(
                [(g.gap_mm - panels.gap_mm) / g.sigma_gap_mm, (g.flush_mm - panels.flush_mm) / g.sigma_flush_mm]
            )
    assert len(pulls) > 80
    z = np.array(pulls)
    assert np.all(np.abs(np.mean(z, axis=0)) < 0.15 + 3 / np.sqrt(len(z)))
    assert np.all((np.sqrt(np.mean(z**2, axis=0)) > 0.7) & (np.sqrt(np.mean(z**2, axis=0)) < 1.4))


def test_points_of_another_make(cli: Cli, picture: Path, tmp_path: Path) -> None:
    """Two columns are enough; what the blur did to the bend stays in, and that is said."""
    sensor = read_sensor(SENSOR)
    yz = extract_profile(cv2.imread(str(picture), cv2.IMREAD_UNCHANGED), sensor).yz_mm
    file = tmp_path / "points.csv"
    file.write_text("y_mm,z_mm\n" + "\n".join(f"{y:.5f},{z:.5f}" for y, z in yz) + "\n")
    result = cli("gapflush", file, "--json")
    assert result.code == 0, result.err
    assert result.json["blur_px"] is None
    assert "points only" in result.err
    assert result.json["flush_mm"] == pytest.approx(PANELS.flush_mm, abs=ATOL_FLUSH_MM)
    assert result.json["gap_mm"] == pytest.approx(PANELS.gap_mm, abs=0.25)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("y_mm,x_mm\n1,2\n", 'line 1: the column "z_mm" is missing'),
        ("z_mm,sigma_z_mm\n1,2\n", "line 1: a profile needs the column y_mm"),
        ("y_mm,z_mm\n1,2\n1,x\n", 'line 3, column z_mm: "x" is not a number'),
        ("y_mm,z_mm\n1,nan\n", "all points of its profile are missing"),
        ("", "is empty"),
    ],
)
def test_profiles_that_can_not_be_read(cli: Cli, tmp_path: Path, text: str, words: str) -> None:
    (tmp_path / "p.csv").write_text(text)
    result = cli("gapflush", tmp_path / "p.csv")
    assert result.code == 2
    assert words in result.err
    assert len(result.err.splitlines()) == 1


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
    assert right.json["flush_mm"] == pytest.approx(-PANELS.flush_mm, abs=ATOL_FLUSH_MM)
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
    sensor = read_sensor(SENSOR)
    dark = tmp_path / "dark.png"
    write_png(dark, np.full((sensor.camera.height_px, sensor.camera.width_px), 12, np.uint8))
    empty = cli("profile", dark, "--sensor", SENSOR, "--csv", tmp_path / "p.csv")
    assert empty.code == 3
    assert "no stripe" in empty.err
    none = cli("gapflush", dark, "--sensor", SENSOR)
    assert none.code == 3
    assert "points" in none.err
