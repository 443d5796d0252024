"""Repeatability: σ of series and of profiles as put in, intervals that cover it, Cg and Cgk by hand."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from scipy.stats import binom, chi2

from extraction import Profile
from tests.accept.standards import across, write
from tests.workbench.helpers import Cli
from workbench.accept import PlacedProfile, Series, accept_repeat
from workbench.accept.repeat import pointwise

N_SERIES, LEVEL, LIKELY = 200, 0.95, 1e-3


def test_cg_and_cgk_by_hand(cli: Cli, tmp_path: Path) -> None:
    """Of 2, 4, 4, 4, 5, 5, 7, 9: mean 5, σ 2.138; with T = 100 and a master of 4: Cg 1.559, Cgk (10 − 1) / (3 σ)."""
    path = tmp_path / "master.csv"
    path.write_text("no;value\n" + "\n".join(f"{k};{v},0" for k, v in enumerate((2, 4, 4, 4, 5, 5, 7, 9))))
    asked = ("accept", "repeat", path, "--reference-mm", 4, "--tolerance-mm", 100)
    result = cli(*asked, "--min-cgk", 1.33, "--rule", "simple", "--json")
    sigma = np.sqrt(32 / 7)
    found = result.json["figures"]
    assert found["sigma"]["value"] == pytest.approx(sigma, rel=1e-7)
    assert found["sigma"]["interval"] == pytest.approx(list(sigma * np.sqrt(7 / chi2.ppf([0.975, 0.025], 7))), rel=1e-6)
    assert found["bias"]["value"] == pytest.approx(1.0)
    assert found["Cg"]["value"] == pytest.approx(20 / (6 * sigma), rel=1e-7)
    assert found["Cgk"]["value"] == pytest.approx(9 / (3 * sigma), rel=1e-7)
    assert result.code == 0
    assert cli(*asked, "--min-cgk", 1.33).code == 1  # eight values prove nothing of the kind


def test_intervals_of_cgk_cover_it() -> None:
    rng = np.random.default_rng(12)
    inside = 0
    for _ in range(N_SERIES):
        record = accept_repeat(
            [Series("value", "mm", 10.2 + 0.3 * rng.standard_normal(30))], [], reference=10.0, tolerance=8.0
        )
        b = next(f.bounds for f in record.figures if f.name == "Cgk")
        assert b is not None
        inside += b.low <= (0.8 - 0.2) / 0.9 <= b.high
    assert binom.ppf(LIKELY / 2, N_SERIES, LEVEL) <= inside <= binom.ppf(1 - LIKELY / 2, N_SERIES, LEVEL)


@pytest.mark.parametrize("grain", [0.0, 4.0])
def test_scatter_place_by_place_and_its_interval(grain: float) -> None:
    """Neighbours that share their noise count as fewer: the interval covers σ as often with grain as without."""
    rng = np.random.default_rng(13)
    y = np.arange(0, 40, 0.1)
    scale = 1.0 if grain == 0 else float(np.std(gaussian_filter1d(rng.standard_normal(200_000), grain)))
    inside, values = 0, []
    for _ in range(N_SERIES):
        noise = rng.standard_normal((8, len(y)))
        noise = noise if grain == 0 else gaussian_filter1d(noise, grain, axis=1) / scale
        profiles = [np.column_stack([y, 80 + 0.1 * y + 0.02 * row]) for row in noise]
        cov = np.zeros((len(y), 2, 2))
        figure = pointwise([PlacedProfile("p", Profile.of_points(yz, cov)) for yz in profiles])
        assert figure.bounds is not None
        assert figure.value is not None
        inside += figure.bounds.low <= 0.02 <= figure.bounds.high
        values.append(figure.value)
    assert np.mean(values) == pytest.approx(0.02, rel=0.01)
    assert inside >= binom.ppf(LIKELY / 2, N_SERIES, LEVEL)


def test_profiles_of_a_plane_and_a_ball(cli: Cli, tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    ball = (0.0, 1.0, 60.0, 15.0)
    folder = write(tmp_path / "still", [across([ball], 3.0, noise_mm=0.01, rng=rng) for _ in range(6)])
    result = cli("accept", "repeat", folder, "--feature", "sphere", "--diameter-mm", 30, "--of", "centre_z_mm",
                 "--max-sigma-mm", 0.01, "--max-sigma-z-mm", 0.02, "--json")  # fmt: skip
    assert result.code == 0, result.err
    assert result.json["figures"]["sigma_z"]["value"] == pytest.approx(0.01, rel=0.05)
    assert {r["measurand"] for r in result.json["measurands"]} == {"centre_y_mm", "centre_z_mm", "radius_mm"}
    assert cli("accept", "repeat", folder, "--feature", "sphere", "--of", "heigth_mm").code == 2
    assert cli("accept", "repeat", folder).code == 2


def test_drift_is_said() -> None:
    rng = np.random.default_rng(6)
    values = 0.02 * np.arange(30) + 0.01 * rng.standard_normal(30)
    record = accept_repeat([Series("value", "mm", values)], [])
    assert any("drifts" in note for note in record.notes)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("value\n1\n2\n", "at least 5"),
        ("value\n" + "1\n" * 10, "all 10 values"),
        ("value\n1\nx\n3\n4\n5\n", 'line 3, column value: "x"'),
        ("wert\n1\n2\n", 'the column "value" is missing'),
    ],
)
def test_bad_series_end_in_a_sentence(cli: Cli, tmp_path: Path, text: str, words: str) -> None:
    path = tmp_path / "t.csv"
    path.write_text(text)
    result = cli("accept", "repeat", path)
    assert result.code == 2
    assert words in result.err
