"""One recipe serves every command: its region, its tools, its tolerances."""

from __future__ import annotations

import csv
from pathlib import Path

import cv2
import numpy as np
import pytest

from extraction import Profile, RegionConfig, region_mask
from extraction.stripe.pictures import draw
from tests.workbench.helpers import Cli
from workbench.cell import measure, profile_values
from workbench.files import Recipe


def arc(rng: np.random.Generator, sigma: float) -> Profile:
    angle = np.linspace(-1.0, 1.0, 400)
    yz = np.column_stack([20 * np.sin(angle) + 3, 250 - 20 * np.cos(angle)])
    cov = np.zeros((400, 2, 2))
    cov[:, 1, 1] = sigma**2
    return Profile.of_points(yz + rng.normal(0, sigma, 400)[:, None] * [0, 1], cov)


def test_a_region_is_the_polygons_that_are_kept_without_those_left_out() -> None:
    mask = region_mask(RegionConfig(keep=(((10, 10), (30, 10), (30, 30), (10, 30)),)), (50, 60))
    assert mask is not None
    assert mask[10:31, 10:31].all()
    assert mask.sum() == 21 * 21
    out = region_mask(RegionConfig(leave_out=(((0, 0), (5, 0), (5, 49), (0, 49)),)), (50, 60))
    assert out is not None
    assert not out[:, :6].any()
    assert out[:, 6:].all()
    assert region_mask(RegionConfig(), (50, 60)) is None
    colour = region_mask(RegionConfig(leave_out=(((0, 0), (5, 0), (5, 49), (0, 49)),)), (50, 60, 3))
    np.testing.assert_array_equal(colour, out)


def test_a_feature_has_a_true_sigma() -> None:
    """Centre and radius of an arc scatter as their σ say, over 40 draws; only white noise is tried."""
    rng = np.random.default_rng(0)
    recipe = Recipe.model_validate({"measure": {"feature": "sphere", "diameter_mm": 40.0}})
    rows = []
    for _ in range(40):
        profile = arc(rng, 0.02)
        found = {v.key: v for v in profile_values(profile, measure(profile, recipe), recipe)}
        rows.append([(found[k].value, found[k].sigma) for k in ("centre_y_mm", "centre_z_mm", "radius_mm")])
    table = np.array(rows, dtype=float)
    pulls = (table[:, :, 0] - [3.0, 250.0, 20.0]) / table[:, :, 1]
    assert 0.6 < float(np.sqrt(np.mean(pulls**2))) < 1.4


def test_a_value_out_of_its_tolerance_has_a_red_lamp() -> None:
    profile = arc(np.random.default_rng(1), 0.02)
    limits = {"radius_mm": {"min": 19.9, "max": 20.1}, "points": {"min": 500}}
    recipe = Recipe.model_validate({"measure": {"feature": "sphere"}, "tolerances": limits})
    lamps = {v.key: v.lamp for v in profile_values(profile, measure(profile, recipe), recipe)}
    assert (lamps["radius_mm"], lamps["points"], lamps["flagged"]) == ("good", "bad", "")


def test_what_is_not_there_is_not_within_its_tolerance() -> None:
    line = np.column_stack([np.linspace(0, 50, 300), np.full(300, 200.0)])
    profile = Profile.of_points(line, np.tile(np.eye(2) * 1e-4, (300, 1, 1)))
    recipe = Recipe.model_validate({"measure": {"gap_and_flush": True}, "tolerances": {"gap_mm": {"max": 5.0}}})
    measured = measure(profile, recipe)
    assert measured.gap is None
    assert measured.gap_text
    assert next(v for v in profile_values(profile, measured, recipe) if v.key == "gap_mm").lamp == "bad"


def test_extract_and_calibrate_take_the_region_of_a_recipe(cli: Cli, recording: Path, tmp_path: Path) -> None:
    """Spots left of u = 700 px are there without the recipe, and none with it."""
    recipe, points = tmp_path / "recipe.toml", tmp_path / "points.csv"
    recipe.write_text("[region]\nleave_out = [[[-1, -1], [700, -1], [700, 2000], [-1, 2000]]]\n", encoding="utf-8")
    columns = []
    for extra in ((), ("--recipe", recipe)):
        assert cli("extract", recording, *extra, "--csv", points).code == 0
        with points.open(newline="") as stream:
            columns.append([float(row["u_px"]) for row in csv.DictReader(stream)])
    assert min(columns[0]) < 600
    assert min(columns[1]) > 700
    assert len(columns[1]) < len(columns[0])
    answer = cli("calibrate", recording, "--recipe", recipe, "--json").json
    assert all(p["u_px"] > 700 for f in answer["frames"] for p in f["points"])


@pytest.fixture(scope="module")
def stripe(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("stripe") / "a.png"
    cv2.imwrite(str(path), draw("beside_a_border", np.random.default_rng(1)).image)
    return path


def test_profile_takes_the_region_of_a_recipe(cli: Cli, stripe: Path, tmp_path: Path) -> None:
    recipe = tmp_path / "recipe.toml"
    recipe.write_text("[region]\nkeep = [[[100, -1], [300, -1], [300, 9999], [100, 9999]]]\n", encoding="utf-8")
    points = cli("profile", stripe, "--recipe", recipe, "--json").json["images"][0]["points"]
    assert (points[0]["section"], points[-1]["section"]) == (100, 300)


def test_gapflush_says_what_is_out_of_tolerance(cli: Cli, tmp_path: Path) -> None:
    """Exit code 1 and a sentence where a tolerance is broken, 0 where all hold; panels drawn as points."""
    y = np.linspace(-20, 20, 801)
    z = np.where(y < -2, 200.0, np.where(y > 2, 200.5, np.nan))
    rows = [f"{a:.3f},{b:.4f},0.005" for a, b in zip(y, z, strict=True) if np.isfinite(b)]
    profile, recipe = tmp_path / "panels.csv", tmp_path / "recipe.toml"
    profile.write_text("y_mm,z_mm,sigma_z_mm\n" + "\n".join(rows) + "\n", encoding="utf-8")
    for least, code in ((3.0, 0), (5.0, 1)):
        recipe.write_text(f"[tolerances.gap_mm]\nmin = {least}\nmax = 9.0\n", encoding="utf-8")
        done = cli("gapflush", profile, "--recipe", recipe, "--json")
        assert done.code == code, done.err
        assert done.json["tolerances"]["gap_mm"]["holds"] is (code == 0)
        assert ("gap_mm = 4" in done.err) is (code == 1)
