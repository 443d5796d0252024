"""The page of a run: bands that hold what they claim, a sentence that is honest, and all kinds of runs."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest

from geometry import clean
from workbench.campaign import AskedAccuracy, Plan, Run, advice, quantile_band, run_object, write_page
from workbench.campaign.results.summary import by_factor, worst_trials

TARGET = AskedAccuracy(0.1, 0.03, 0.95)


def run_of(error_mm: Any, **columns: list[Any]) -> Run:
    """A calibration run of these errors; other columns are factors."""
    n = len(error_mm)
    factors = {name.replace("__", "."): list(dict.fromkeys(v)) for name, v in columns.items()}
    plan = Plan.model_validate({"factors": factors, "repeats": 1})
    trials: dict[str, list[Any]] = {
        "trial": list(range(n)),
        "verdict": ["no_answer" if e is None else "ok" for e in error_mm],
        "error_mm": list(error_mm),
        "error_deg": [None if e is None else 0.01 for e in error_mm],
    }
    return Run(Path("run"), plan, trials | {name.replace("__", "."): v for name, v in columns.items()})


@pytest.mark.parametrize(("n", "q"), [(12, 0.5), (80, 0.95), (200, 0.95)])
def test_bands_hold_the_true_quantile_as_often_as_they_say(n: int, q: float) -> None:
    """At least 95 % of 2,000 drawn samples; order statistics are never below it but by chance (σ 0.5 %)."""
    rng = np.random.default_rng(3)
    true = -np.log(1 - q)
    bands = [quantile_band(np.sort(rng.exponential(size=n)), q)[1] for _ in range(2000)]
    assert np.mean([low <= true <= high for low, high in bands]) >= 0.935


def test_few_trials_have_no_upper_end() -> None:
    """71 values bound no 95 % quantile from above, 72 do."""
    assert np.isinf(quantile_band(np.arange(71.0), 0.95)[1][1])
    assert np.isfinite(quantile_band(np.arange(72.0), 0.95)[1][1])


def test_the_sentence_takes_the_fewest_poses_that_reach_it() -> None:
    poses = [3] * 100 + [5] * 100 + [7] * 100
    errors = [0.3] * 100 + [0.05] * 97 + [0.3] * 3 + [0.05] * 100
    text = advice(run_of(errors, poses__per_location=poses), TARGET)
    assert "take ≥ 15 poses with tilts up to ≥ 35°" in text
    assert "97.0 % of 100 trials" in text
    assert "More trials would be needed" in text  # its 95 % interval reaches below 95 %


def test_the_sentence_names_another_factor_where_that_decides() -> None:
    model = ["scp", "full"] * 100
    text = advice(run_of([0.3 if m == "scp" else 0.05 for m in model], calib__model=model), TARGET)
    assert "calib.model = full" in text
    assert "100.0 % of 100 trials" in text


def test_the_sentence_says_so_where_nothing_is_enough() -> None:
    text = advice(run_of([0.3] * 50), TARGET)
    assert text.startswith("No setting of this plan reaches 0.1 mm / 0.03° at 95 %")
    assert "Too few trials" in advice(run_of([0.05] * 5), TARGET)


def test_trials_without_an_answer_count_as_failures() -> None:
    run = run_of([0.05] * 90 + [None] * 10, poses__per_location=[7] * 100)
    assert "90.0 % of its 100 trials" in advice(run, TARGET)
    (group,) = by_factor(run, "poses.per_location", "error_mm")
    assert (group.trials, group.answered) == (100, 90)


def test_named_values_are_groups_of_their_own() -> None:
    model = ["scp"] * 3 + ["full"] * 4
    groups = by_factor(run_of([0.1] * 7, calib__model=model), "calib.model", "error_mm")
    assert [(g.value, g.trials, g.centre) for g in groups] == [("full", 4, None), ("scp", 3, None)]


def test_the_worst_trials_of_an_extraction_are_those_that_lost_spots(small_run: Path) -> None:
    from dataclasses import replace

    from workbench.campaign import read_run

    run = read_run(small_run)
    found = [5, 5, 3, 5, 4, 5]
    harmed = replace(run, trials=run.trials | {"spots_found": found, "spots_visible": [5] * 6})
    assert worst_trials(harmed, 2) == [2, 4]


def test_the_pages_numbers_as_json() -> None:
    """Shares and quantiles are those of the errors, groups those of the factor; open bands are None."""
    run = run_of([0.05] * 90 + [0.3] * 8 + [None] * 2, calib__model=["scp", "full"] * 50)
    run.trials["nees"] = [6.0] * 98 + [None] * 2
    told = clean(run_object(run, TARGET))
    assert (told["consistency"]["trials"], told["consistency"]["nees"]) == (98, 6.0)
    assert told["answered"] == 98
    assert told["reached"]["share"] == 0.9
    assert told["verdicts"] == {"ok": 98, "no_answer": 2}
    assert told["errors"]["error_mm"]["median"] == 0.05
    assert told["errors"]["error_mm"]["p95"] == 0.3
    groups = told["factors"]["calib.model"]["error_mm"]
    assert [(g["value"], g["trials"], g["answered"]) for g in groups] == [("full", 50, 49), ("scp", 50, 49)]
    assert groups[0]["p95_band"][1] is None


def test_a_page_of_every_kind_of_run_stands_alone(small_run: Path, tmp_path: Path) -> None:
    html = write_page(small_run, TARGET, tmp_path / "page.html").read_text(encoding="utf-8")
    rows = pq.read_table(small_run / "trials.parquet").to_pydict()
    assert f"{sum(rows['spots_found'])} of {sum(rows['spots_visible'])} visible spots found" in html
    assert html.count("<figure>") == 4
    assert "jig.string_diameter_mm" in html
    for foreign in ("<script", "http:", 'src="/'):
        assert foreign not in html.replace("http://www.w3.org", "").replace("http://purl.org", "").replace(
            "http://creativecommons.org", ""
        )
