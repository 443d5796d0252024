"""Plans: what is accepted, what is refused in one sentence, and which points a design has."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from geometry import InputError
from workbench.campaign import Plan, TrialSettings, read_plan
from workbench.campaign.asked.design import design_points
from workbench.campaign.asked.settings import leaf_paths, with_values
from workbench.campaign.trial.emulated import planned_diameter_mm


def plan_file(folder: Path, text: str) -> Path:
    path = folder / "plan.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_grid_is_every_combination_in_order(tmp_path: Path) -> None:
    plan = read_plan(
        plan_file(
            tmp_path,
            """
            [factors]
            "jig.string_diameter_mm" = [0.2, 0.3]
            "poses.per_location" = { low = 3, high = 9, steps = 3 }
            """,
        )
    )
    points = design_points(plan)
    assert [tuple(p.values()) for p in points] == [(d, n) for d in (0.2, 0.3) for n in (3, 6, 9)]
    assert all(isinstance(p["poses.per_location"], int) for p in points)


@pytest.mark.parametrize("design", ["random", "latin_hypercube", "sobol"])
def test_sampled_designs_stay_inside_and_repeat(design: str) -> None:
    plan = Plan.model_validate(
        {
            "design": design,
            "samples": 37,
            "factors": {
                "jig.tolerance_mm": {"low": 0.01, "high": 1.0, "log": True},
                "poses.locations": {"low": 2, "high": 5},
                "calib.model": ["scp", "full"],
            },
        }
    )
    points = design_points(plan)
    assert points == design_points(plan)
    assert len(points) == 37
    tolerance = np.array([p["jig.tolerance_mm"] for p in points])
    assert tolerance.min() >= 0.01
    assert tolerance.max() <= 1.0
    assert abs(np.median(np.log10(tolerance)) + 1) < 0.4  # equal ratios: half the points below the geometric middle
    assert {p["poses.locations"] for p in points} == {2, 3, 4, 5}
    assert {p["calib.model"] for p in points} == {"scp", "full"}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[factors]\n"jig.string_diameter" = [0.3]', ["line 2", "unknown factor", "jig.string_diameter_mm"]),
        ('[factors]\n"jig.string_diameter_mm" = []', ["line 2", "no values", "empty"]),
        ('[factors]\n"jig.string_diameter_mm" = [-1.0]', ["line 2", "jig.string_diameter_mm", "greater than 0"]),
        ('[factors]\n"jig.string_diameter_mm" = 0.3', ["line 2", "list of values"]),
        ("[factors]\njig.string_diameter_mm = [0.3]", ["quotes"]),
        ('[factors]\n"jig.tolerance_mm" = { low = 0.0, high = 0.1 }', ["line 2", "steps"]),
        ('[factors]\n"jig.tolerance_mm" = { low = 0.2, high = 0.1, steps = 3 }', ["line 2", "above low"]),
        ('[factors]\n"jig.tolerance_mm" = { low = 0.0, hihg = 0.1 }', ["line 2", "hihg"]),
        ('design = "sobol"', ["samples"]),
        ("samples = 4", ["line 1", "random design"]),
        ("repeats = 0", ["line 1", "repeats"]),
        ("repeat = 3", ["line 1", "unknown key", "repeats"]),
        ("keep_images = nan", ["line 1", "keep_images"]),
        ("[base.jig]\nside = 3", ["line 2", "unknown key", "side_mm"]),
        ('[factors]\n"jig.side_mm" = [1.0, 2.0]\n[base]\nclutter = 3', ["line 4", "clutter"]),
        ('[base.robot]\npreset = "no such arm"', ["line 2", "robot.preset", "no such arm"]),
        ('[factors]\n"sensor.preset" = ["none.toml"]', ["line 2", "sensor.preset", "none.toml"]),
    ],
)
def test_bad_plans_are_refused_in_one_sentence(tmp_path: Path, text: str, words: list[str]) -> None:
    with pytest.raises(InputError) as caught:
        read_plan(plan_file(tmp_path, text))
    message = str(caught.value)
    assert "plan.toml" in message
    assert "\n" not in message
    for word in words:
        assert word in message


def test_a_grid_beyond_reason_is_refused() -> None:
    steps = {"low": 0.1, "high": 1.0, "steps": 10_000}
    plan = Plan.model_validate({"factors": {"jig.tolerance_mm": steps, "jig.string_diameter_mm": steps}})
    with pytest.raises(InputError, match="trials"):
        design_points(plan)


def test_fingerprint_tells_plans_apart_and_not_their_names() -> None:
    one = Plan.model_validate({"name": "a", "repeats": 3})
    assert one.fingerprint == Plan.model_validate({"name": "b", "repeats": 3}).fingerprint
    assert one.fingerprint != Plan.model_validate({"name": "a", "repeats": 4}).fingerprint


def test_every_setting_is_a_factor_by_its_dotted_name() -> None:
    known = leaf_paths(TrialSettings)
    assert {"jig.string_diameter_mm", "emulator.noise.read_noise_e", "calib.model", "clutter"} <= set(known)
    assert with_values(TrialSettings(), {"emulator.noise.read_noise_e": 3.0}).emulator.noise.read_noise_e == 3.0


def test_strings_of_many_diameters_share_few_plans() -> None:
    """Not planned thicker than they are, and a random diameter does not ask for a plan of its own."""
    diameters = np.linspace(0.05, 1.0, 200)
    planned = np.array([planned_diameter_mm(d) for d in diameters])
    assert np.all(planned <= diameters)
    assert np.all(planned[diameters >= 0.3] == 0.3)
    assert len(set(planned.tolist())) == 4
