"""Balls, ball bars and planes with known errors: what the tests give is what was put in.

Points are made by the standards' equations. Nothing is said here of images; extraction has its own tests.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from extraction import Profile
from geometry import Pose
from tests.accept.standards import Ball, across, write
from tests.workbench.helpers import Cli
from workbench.accept import BallStandard, PlacedProfile, Recorded, accept_ball, accept_flatness, accept_spacing

ATOL_MM = 1e-6
REJECTED_MM = 0.01  # by which rejecting three points in a thousand of a distorted ball moves its size
BALL: Ball = (0.4, 2.0, 60.0, 15.0)
AT = np.arange(-11.0, 12.0, 2.0)


def scan(profiles: list[np.ndarray], at: np.ndarray | None) -> Recorded:
    """Profiles at places along x; None: nobody tells."""
    placed = []
    for k, yz in enumerate(profiles):
        place = None if at is None else Pose(np.eye(3), np.array([at[k], 0.0, 0.0]))
        cov = np.broadcast_to(np.eye(2) * 1e-4**2, (len(yz), 2, 2))
        placed.append(PlacedProfile(f"p{k}", Profile.of_points(yz, cov), place))
    return Recorded(tuple(placed), (), "" if at is None else "a stage")


def figures(record: object) -> dict[str, float | None]:
    return {f.name: f.value for f in record.figures}  # type: ignore[attr-defined]


def test_an_exact_ball_has_no_error() -> None:
    found = figures(accept_ball(scan([across([BALL], x) for x in AT], AT), BallStandard(30.0)))
    for name in ("PF", "PF_D95", "PS", "PF_section"):
        assert found[name] == pytest.approx(0.0, abs=ATOL_MM)


def test_size_and_form_errors_are_what_was_put_in() -> None:
    """A scale of z makes an ellipsoid: its form error against a sphere by dense sampling of its own equation."""
    truth = figures(accept_ball(scan([across([BALL], x) for x in AT], AT), BallStandard(29.9)))
    assert truth["PS"] == pytest.approx(0.1, abs=ATOL_MM)
    stretched = accept_ball(scan([across([BALL], x) for x in AT], 1.02 * AT), BallStandard(30.0))
    cloud = np.vstack([np.insert(across([BALL], x), 0, 1.02 * x, axis=1) for x in AT])
    c, r = np.array([0.4, 2.0, 60.0]), 15.0
    for _ in range(100):  # an associated sphere by plain steps
        away = cloud - c
        length = np.linalg.norm(away, axis=1)
        rows = np.column_stack([away / length[:, None], np.ones(len(cloud))])
        step = np.linalg.lstsq(rows, length - r, rcond=None)[0]
        c, r = c + step[:3], r + step[3]
    off = np.sort(np.abs(np.linalg.norm(cloud - c, axis=1) - r))
    assert figures(stretched)["PF"] == pytest.approx(np.ptp(np.linalg.norm(cloud - c, axis=1)), rel=0.1)
    assert off[-1] > 0.02
    assert figures(stretched)["PS"] == pytest.approx(2 * r - 30, abs=REJECTED_MM)


def test_a_few_spikes_are_rejected_and_more_count() -> None:
    """Up to three points in a thousand may be rejected; one more is in the probing error."""
    profiles = [across([BALL], x) for x in AT]
    on_ball = sum(int(np.count_nonzero(p[:, 1] < 80)) for p in profiles)
    allowed = int(np.floor(0.003 * on_ball))
    for spikes, expected in ((allowed, 0.0), (allowed + 1, 0.45)):
        spoilt = [p.copy() for p in profiles]
        for k in range(spikes):
            p = spoilt[3 + k % 6]
            middle = int(np.argmin(np.abs(p[:, 0] - 2.0 - (k // 6))))
            p[middle, 1] -= 0.5
        record = accept_ball(scan(spoilt, AT), BallStandard(30.0))
        assert figures(record)["PF"] == pytest.approx(expected, abs=0.06 if expected else ATOL_MM), spikes


def test_noise_shows_as_noise() -> None:
    """The shell of 95 % of Gaussian points is 3.92 σ across the surface; σ across is σ_z times the mean cosine."""
    rng = np.random.default_rng(8)
    profiles = [across([BALL], x, noise_mm=0.01, rng=rng) for x in AT]
    record = accept_ball(scan(profiles, AT), BallStandard(30.0, 0.001, 0.0005))
    found = {f.name: f for f in record.figures}
    assert found["PF_D95"].value == pytest.approx(0.0305, rel=0.05)
    assert found["PS"].value == pytest.approx(0.0, abs=2e-3)
    bounds = found["PF"].bounds
    assert bounds is not None
    assert bounds.high - bounds.low == pytest.approx(2 * 1.96 * 0.00025, rel=1e-3)  # u = F / 2 of the ball's own form


def test_sections_without_places_tell_no_size() -> None:
    record = accept_ball(scan([across([BALL], x) for x in AT], None), BallStandard(30.0))
    found = figures(record)
    assert found["PS"] is None
    assert found["PF"] is None
    assert found["PF_section"] == pytest.approx(0.0, abs=ATOL_MM)
    assert any(line.startswith("PS: a single section") for line in record.not_judged)


def test_a_zone_takes_what_lies_in_it() -> None:
    narrow = accept_ball(scan([across([BALL], x) for x in AT], AT), BallStandard(30.0), zone_deg=40.0)
    wide = accept_ball(scan([across([BALL], x) for x in AT], AT), BallStandard(30.0))
    assert 0.5 * wide.details["n_points"] < narrow.details["n_points"] < 0.8 * wide.details["n_points"]


@pytest.mark.parametrize("second", [(3.0, 32.0, 58.0), (34.0, 0.0, 61.0)])
def test_spacing_across_and_along_the_scan(second: tuple[float, float, float]) -> None:
    one, two = (0.0, -20.0, 60.0, 10.0), (*second, 10.0)
    at = np.arange(-9.0, second[0] + 9.5, 2.0)
    profiles = [across([one, two], x, half_mm=50.0) for x in at]
    true = float(np.linalg.norm(np.subtract(two[:3], one[:3])))
    record = accept_spacing(scan(profiles, at), BallStandard(20.0), true - 0.03, 0.002)
    found = {f.name: f for f in record.figures}
    assert found["SD"].value == pytest.approx(0.03, abs=ATOL_MM)
    assert found["SD"].bounds is not None
    assert found["SD"].bounds.most - 0.03 == pytest.approx(1.645 * 0.001, rel=1e-3)
    assert found["PS_second"].value == pytest.approx(0.0, abs=ATOL_MM)


def test_flatness_of_a_bent_plane() -> None:
    """A saddle z = k x y of an even grid has a range of 2 k X Y about its plane; each profile is straight."""
    at = np.linspace(-20, 20, 21)
    y = np.arange(-30, 30.001, PITCH)
    profiles = [np.column_stack([y, 100 + 1e-4 * x * y + 0.05 * y]) for x in at]
    found = figures(accept_flatness(scan(profiles, at)))
    assert found["straightness"] == pytest.approx(0.0, abs=ATOL_MM)
    edges = 2 * 1e-4 * 20 * 30 / np.sqrt(1 + 0.05**2)
    assert 0.95 * edges < found["F"] < edges  # three points in a thousand are rejected, all at the corners
    alone = accept_flatness(scan(profiles, None))
    assert figures(alone)["F"] is None
    assert alone.not_judged


PITCH = 0.25


def test_a_ball_by_the_command_line(cli: Cli, tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    folder = write(tmp_path / "ball", [across([BALL], x, noise_mm=0.005, rng=rng, table=x > 8) for x in AT])
    asked = ("accept", "ball", folder, "--diameter-mm", 30, "--form-mm", 0.0004, "--diameter-uncertainty-mm", 0.001)
    moved = cli(*asked, "--step-mm", 2, "--max-form-mm", 0.05, "--max-size-mm", 0.005, "--json")
    assert moved.code == 0, moved.err
    assert moved.json["verdict"]["code"] == "conform"
    assert len(moved.json["inputs"]) == len(AT)
    assert cli(*asked, "--step-mm", 2, "--max-form-mm", 0.01).code == 1
    table = tmp_path / "at.csv"
    table.write_text("profile;x_mm\n" + "\n".join(f"p{k:03d};{x:.1f}".replace(".", ",") for k, x in enumerate(AT)))
    placed = cli(*asked, "--positions", table, "--json", "--report", tmp_path / "r.html")
    assert placed.json["figures"]["PF"] == moved.json["figures"]["PF"]
    assert "PF_D95" in (tmp_path / "r.html").read_text(encoding="utf-8")
    (folder / "p004.csv").write_text("y_mm,z_mm\n1,x\n")  # one that can not be read still counts as a step
    without = cli(*asked, "--step-mm", 2, "--json")
    assert "p004.csv" in without.err
    assert without.json["figures"]["PS"]["value"] == pytest.approx(moved.json["figures"]["PS"]["value"], abs=2e-3)
    alone = cli(*asked, "--max-size-mm", 0.005, "--json")
    assert alone.code == 1
    assert alone.json["verdict"]["code"] == "not_proven"


def test_a_cell_s_frames_are_placed_by_its_robot(cli: Cli, tmp_path: Path) -> None:
    plan, cell = tmp_path / "plan", tmp_path / "cell"
    cli("init", plan, "--target", "sphere")
    assert cli("render", plan, "--out", cell, "--profiles", "csv", "--per-location", 6, "--seed", 2).code == 0
    asked = ("accept", "ball", cell, "--diameter-mm", 40)
    several = cli(*asked)
    assert several.code == 2
    assert "--location" in several.err
    design = cli(*asked, "--location", "A", "--json")
    assert design.code == 0, design.err
    assert design.json["figures"]["PF"]["value"] > design.json["figures"]["PF_section"]["value"]
    assert "robot" in design.json["moved_by"]
    text = (cell / "cell.toml").read_text(encoding="utf-8")
    start = text.index("[scp_initial]")
    end = text.find("\n[", start + 1)
    (cell / "cell.toml").write_text(text[:start] + (text[end:] if end > 0 else ""), encoding="utf-8")
    unplaced = cli(*asked, "--location", "A")
    assert unplaced.code == 2
    assert "--scp" in unplaced.err


BAD = {
    "both": (("--step-mm", 2, "--positions", "at.csv"), 2, "give one"),
    "no step": (("--step-mm", 0), 2, "must not be zero"),
    "no cell": (("--scp", "x.json"), 2, "belong to a cell"),
    "other ball": (("--step-mm", 2, "--zone-deg", 4), 2, "zone"),
}


@pytest.mark.parametrize("kind", BAD)
def test_what_does_not_go_together_is_a_sentence(cli: Cli, tmp_path: Path, kind: str) -> None:
    options, code, words = BAD[kind]
    folder = write(tmp_path / "ball", [across([BALL], x) for x in AT[:4]])
    result = cli("accept", "ball", folder, "--diameter-mm", 30, *options)
    assert result.code == code
    assert words in result.err


def test_one_sentence_for_each_bad_scan(cli: Cli, tmp_path: Path) -> None:
    folder = write(tmp_path / "ball", [across([BALL], x) for x in AT[::3]])
    table = tmp_path / "at.csv"
    table.write_text("profile,x_mm\nother,0\n")
    cases = [
        (("ball", folder, "--diameter-mm", 30, "--positions", table), 2, "no row names a profile"),
        (("ball", folder, "--diameter-mm", 300, "--step-mm", 1), 3, "no profile shows the ball"),
        (("ball", tmp_path / "none", "--diameter-mm", 30), 2, "none"),
        (("ball", folder / "p001.csv", "--diameter-mm", 30, "--step-mm", 1), 2, "there is one only"),
        (("spacing", folder, "--diameter-mm", 30, "--distance-mm", 60), 2, "where the sensor stood"),
        (("spacing", folder, "--diameter-mm", 30, "--distance-mm", 20, "--step-mm", 1), 2, "overlap"),
        (("spacing", folder, "--diameter-mm", 30, "--distance-mm", 60, "--step-mm", 1), 3, "second one was not seen"),
        (("flatness", folder / "p001.csv", "--sensor", tmp_path / "s.toml"), 2, "s.toml"),
    ]
    for arguments, code, words in cases:
        result = cli("accept", *arguments)
        assert (result.code, words in result.err) == (code, True), (arguments, result.err)
        assert len(result.err.strip().splitlines()) == 1
