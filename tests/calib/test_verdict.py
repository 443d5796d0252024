"""Which verdict at which side of each limit, what it says, and that the gravest is said first."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.config import CalibConfig
from calib.judge.verdict import Contradiction, Facts, Motion, direction_in_words, judge, judge_motion, misfit_limit
from calib.judge.words import accusation, place_of
from calib.result import Culprit, Pull

SOUND = Facts(
    converged=True, iterations=5, chi2_per_dof=1.0, explained=1.0, dof=10_000, condition=30.0,
    noise_covariance=1e-8 * np.eye(6), outlier_share=0.0, outlying_strings=(), rival=np.inf, locations=3,
)  # fmt: skip
MOVED = Motion(frames=21, pairs=18, distinct=18, rotation_deg=64.4, second_deg=20.0, lever_mm=80.0)
CONFIG = CalibConfig()
PAPER = CalibConfig(method="paper")
A2 = Culprit("robot", "a2", 2, 1.23, "mm", 6.04, ("a3", "d4"))
JUST = 1 + 1e-9


def _sigmas(mm: float, deg: float) -> np.ndarray:
    """Covariance of an SCP whose y and rotation about z are known so well, all else far better."""
    sigma = np.full(6, 1e-6)
    sigma[1], sigma[5] = mm, np.deg2rad(deg)
    return np.diag(sigma**2)


@pytest.mark.parametrize(
    ("change", "within", "beyond", "code"),
    [
        ("outlier_share", 0.25, 0.2501, "outliers"),
        ("explained", 1.9, 30.001, "outliers"),
        ("rival", 12.001, 12.0, "ambiguous_pose"),
        ("noise_covariance", _sigmas(0.999, 0.299), _sigmas(1.001, 0.0), "weak"),
        ("noise_covariance", _sigmas(0.0, 0.299), _sigmas(0.0, 0.301), "weak"),
        ("noise_covariance", _sigmas(0.9, 0.0), _sigmas(20.001, 0.0), "not_observable"),
        ("noise_covariance", _sigmas(0.0, 0.2), _sigmas(0.0, 5.001), "not_observable"),
        ("condition", 999.0, 1000.0, "weak"),
        ("condition", 999.0, np.inf, "not_observable"),
        ("explained", 2.5, 2.5 * JUST, "model_misfit"),
        ("largest_pull", 5.0, 5.0 * JUST, "model_misfit"),
        ("outlying_strings", (), ("string 2",), "outliers"),
        ("converged", True, False, "not_converged"),
        ("noise_covariance", _sigmas(0.1, 0.1), np.full((6, 6), np.nan), "not_converged"),
    ],
)
def test_a_limit_divides_ok_from_what_is_said_beyond_it(change: str, within: object, beyond: object, code: str) -> None:
    assert judge(replace(SOUND, **{change: within}), MOVED, CONFIG).code == "ok"
    assert judge(replace(SOUND, **{change: beyond}), MOVED, CONFIG).code == code


def test_between_weak_and_not_observable_lies_weak() -> None:
    for covariance in (_sigmas(19.99, 0.0), _sigmas(0.0, 4.99)):
        assert judge(replace(SOUND, noise_covariance=covariance), MOVED, CONFIG).code == "weak"


def test_words_of_outliers_name_what_they_are() -> None:
    share = judge(replace(SOUND, outlier_share=0.4), MOVED, CONFIG).text
    assert share.startswith("40% of the points contradict the rest (limit 25%)")
    strings = judge(replace(SOUND, outlying_strings=("left", "top")), MOVED, CONFIG).text
    assert "the points of string left, top contradict" in strings
    gross = judge(replace(SOUND, explained=44.44), MOVED, CONFIG).text
    assert "χ² 44.4 per degree of freedom even with all DH parameters free" in gross


def test_what_ok_says_of_residuals() -> None:
    def text(**changed: float) -> str:
        return judge(replace(SOUND, **changed), MOVED, CONFIG).text

    assert text() == (
        "21 frames at 3 locations, rotations up to 64°: the residuals agree with the noise (χ² 1.00 per degree of "
        "freedom)"
    )
    assert "agree with the noise" in text(explained=1.5)
    assert "are 1.2 times what σ of points and joints say" in text(explained=1.5 * JUST)
    assert "once errors" not in text(chi2_per_dof=2.5)
    assert "with the model asked for it is 2.6" in text(chi2_per_dof=2.6)


def test_the_paper_needs_a_lever_and_has_no_other_model() -> None:
    near, far = (replace(MOVED, lever_mm=mm) for mm in (5.0, 5.001))
    assert judge(SOUND, near, PAPER).code == "lever_constant"
    assert judge(replace(SOUND, converged=False), near, PAPER).code == "lever_constant"  # why it did not settle
    assert judge(SOUND, far, PAPER).code == judge(SOUND, near, CONFIG).code == "ok"
    misfit = judge(replace(SOUND, chi2_per_dof=2.6), MOVED, PAPER)
    assert (misfit.code, misfit.withheld) == ("model_misfit", False)
    assert judge(replace(SOUND, chi2_per_dof=2.5, explained=2.6, largest_pull=9.0), MOVED, PAPER).code == "ok"


def test_poses_whose_joints_are_guessed_are_a_misfit_only_where_neither_explains() -> None:
    hands = replace(SOUND, inferred=True)
    assert judge(replace(hands, chi2_per_dof=2.6), MOVED, CONFIG).code == "ok"
    assert judge(replace(hands, chi2_per_dof=2.5, explained=2.6), MOVED, CONFIG).code == "ok"
    for changed in ({"explained": 2.6}, {"largest_pull": 5.001}):
        verdict = judge(replace(hands, chi2_per_dof=2.6, **changed), MOVED, CONFIG)
        assert (verdict.code, verdict.withheld) == ("model_misfit", True)


@pytest.mark.parametrize(
    ("facts", "rest", "gross", "withheld", "words"),
    [
        (SOUND, 5.0, False, False, "The σ given allow for it"),
        (SOUND, 5.0 * JUST, False, True, "another number is pulled by 5.0 σ"),
        (replace(SOUND, explained=2.6), 1.0, False, True, "do not fit together (χ² 2.6 per degree"),
        (SOUND, 1.0, True, True, "none that σ can be given for"),
    ],
)
def test_a_contradicted_number(facts: Facts, rest: float, gross: bool, withheld: bool, words: str) -> None:
    for culprit, code in ((A2, "priors_contradict"), (replace(A2, block="sensor"), "sensor_suspect")):
        verdict = judge(replace(facts, contradiction=Contradiction(culprit, rest, gross)), MOVED, CONFIG)
        assert (verdict.code, verdict.withheld) == (code, withheld)
        assert words in verdict.text
        assert accusation(culprit) in verdict.text


def test_the_gravest_is_said_first() -> None:
    """All is wrong; what is mended one after the other uncovers the next."""
    facts = replace(
        SOUND, converged=False, outlier_share=0.5, rival=1.0, noise_covariance=_sigmas(25.0, 0.0), explained=2.6,
        contradiction=Contradiction(A2, 1.0),
    )  # fmt: skip
    mends: list[tuple[str, dict[str, object]]] = [
        ("not_converged", {"converged": True}),
        ("outliers", {"outlier_share": 0.0}),
        ("ambiguous_pose", {"rival": np.inf}),
        ("not_observable", {"noise_covariance": _sigmas(2.0, 0.0)}),
        ("priors_contradict", {"contradiction": None}),
        ("model_misfit", {"explained": 1.0}),
        ("weak", {"noise_covariance": _sigmas(0.1, 0.0)}),
        ("ok", {}),
    ]
    for code, mend in mends:
        assert judge(facts, MOVED, CONFIG).code == code
        facts = replace(facts, **mend)


@pytest.mark.parametrize(
    ("changed", "code"),
    [
        ({}, None),
        ({"pairs": 2, "distinct": 2}, None),
        ({"pairs": 1}, "too_few_poses"),
        ({"distinct": 1}, "poses_not_distinct"),
        ({"rotation_deg": 3.0}, None),
        ({"rotation_deg": 2.999}, "rotation_too_small"),
        ({"second_deg": 0.5}, None),
        ({"second_deg": 0.499}, "rotation_too_small"),
    ],
)
def test_what_is_said_of_the_motion_alone(changed: dict[str, int], code: str | None) -> None:
    found = judge_motion(replace(MOVED, **changed), CONFIG)
    assert (found and found.code) == code


def test_words_of_the_motion() -> None:
    few = judge_motion(replace(MOVED, frames=4, pairs=1), CONFIG)
    alike = judge_motion(replace(MOVED, distinct=1), CONFIG)
    small = judge_motion(replace(MOVED, rotation_deg=1.234, second_deg=0.1234), CONFIG)
    assert few is not None
    assert "4 usable calibrate frames give 1 relative motions" in few.text
    assert alike is not None
    assert alike.text.startswith("only 2 of 21 configurations differ by more than 1 mm or 0.1°")
    assert small is not None
    assert "by at most 1.2° between the frames of a location, and by 0.12° rms" in small.text


@pytest.mark.parametrize(
    ("dof", "least", "limit"), [(0, 2.5, 15.1367), (1, 2.5, 15.1367), (100, 1.2, 1.6176), (100, 2.5, 2.5)]
)
def test_the_limit_of_a_misfit_is_of_chance_where_data_are_few(dof: int, least: float, limit: float) -> None:
    """χ² that chance exceeds once in ten thousand, a degree of freedom (tables: 15.137 of 1, 161.32 of 100)."""
    assert misfit_limit(dof, least) == pytest.approx(limit, rel=4e-3)


@pytest.mark.parametrize(
    ("covariance", "words"),
    [
        (_sigmas(2.0, 0.0), "mostly translation along y of the sensor (σ 2 mm at 300 mm)"),
        (_sigmas(0.0, 0.5), "mostly rotation about z of the sensor (σ 2.6 mm at 300 mm)"),
        (
            np.diag([1e-12, 1.0, 1e-12, 1e-12, 1e-12, 1e-12])
            + np.outer([1, 0, 0, 0, 0.8 / 300, 0], [1, 0, 0, 0, 0.8 / 300, 0]) * 4,
            "mostly translation along x of the sensor with rotation about y of the sensor (σ 2.6 mm at 300 mm)",
        ),
    ],
)
def test_the_weakest_direction_in_words(covariance: np.ndarray, words: str) -> None:
    assert direction_in_words(covariance) == words


@pytest.mark.parametrize(
    ("culprit", "words"),
    [
        (
            A2,
            "the data contradict a of joint 2 (a_mm of robot.toml): changed by +1.23 mm it would fit (a pull of 6.0 σ, "
            "where sound data give 4 at most); the data can not tell this from a3, d4",
        ),
        (
            Culprit("robot", "theta4", 4, -0.5, "deg", -5.0, ("a", "b", "c", "d", "e")),
            "the data contradict theta of joint 4 (theta_offset_deg of robot.toml, or the readings of joint 4): "
            "changed by -0.5° it would fit (a pull of 5.0 σ, where sound data give 4 at most); the data can not "
            "tell this from a, b, c, d",
        ),
        (
            Culprit("jig", "anchor 3 of the jig", None, -0.512, "mm", 7.0),
            "the data contradict anchor 3 of the jig of jig.toml: changed by 0.51 mm it would fit (a pull of 7.0 σ, "
            "where sound data give 4 at most)",
        ),
        (
            Culprit("robot", "joint_sigma_deg", None, 3.21, "times", 8.0),
            "the joint readings scatter about 3.2 times more than joint_sigma_deg of [uncertainty] of robot.toml says "
            "(evidence 8.0 σ): state it as it is",
        ),
        (
            Culprit("robot", "uncertainty", None, 3.21, "times", 8.0),
            "the errors of the robot's table are about 3.2 times larger than [uncertainty] of robot.toml says "
            "(evidence 8.0 σ): state them as they are",
        ),
    ],
)
def test_the_sentence_that_accuses(culprit: Culprit, words: str) -> None:
    assert accusation(culprit) == words


@pytest.mark.parametrize(
    ("block", "parameter", "row", "words"),
    [
        ("robot", "d3", 3, "d of joint 3 (d_mm of robot.toml)"),
        ("robot", "alpha5", 5, "alpha of joint 5 (alpha_deg of robot.toml)"),
        ("robot", "beta2", 2, "beta of joint 2 (beta_deg of robot.toml)"),
        ("robot", "own6", 6, "own of joint 6 (robot.toml)"),
        ("robot", "reading_scale3", 3, "the scale of joint 3's readings (its gear, or the unit of its column in"),
        ("robot", "readings of joint 4", 4, "the readings of joint 4, which it turns together: the zero of its enc"),
        ("sensor", "k1", None, "the lens's distortion ([camera] distortion of sensor.toml)"),
        ("sensor", "plane_tilt_y_deg", None, "the laser plane's tilt about y ([camera.pose] of sensor.toml)"),
        ("sensor", "scale_y", None, "scale_y of sensor.toml"),
    ],
)
def test_where_a_number_stands(block: str, parameter: str, row: int | None, words: str) -> None:
    assert place_of(Pull(block, parameter, row, 1.0, "mm", 5.0)).startswith(words)
