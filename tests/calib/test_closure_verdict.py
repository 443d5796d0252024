"""What closure says of its fits, at both sides of each limit, and the arithmetic of locations left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from calib.closure import judge
from calib.closure.judge import ClosureResult, Correction, HeldOut, Socket, closure
from calib.closure.terms import ClosureFit
from calib.synthetic.cell import industrial_arm
from geometry import InputError, Robot

ARM = industrial_arm()
FIT = ClosureFit(
    tool_mm=np.zeros(3), sockets_mm=np.zeros((2, 3)), robot=ARM, parameters=np.array([0.01, -0.4, 0.0]),
    residual_mm=np.zeros((9, 3)), rms_mm=0.4, evidence=0.0, covariance=np.diag([4.0, 1.0, 9.0]), cost=100.0,
    chi2_per_dof=1.0, prior_sigma=np.array([0.01, 0.1, 0.0]), weight=np.ones(9), seat_mm=0.1,
    distance_mm=(50.0, 0.05), learnt=2.0, converged=True,
)  # fmt: skip
GAINED = (HeldOut("A", 2.0, 1.0, 2.0, 1.0), HeldOut("B", 2.1, 1.0, 2.0, 1.0), HeldOut("C", 1.9, 1.0, 2.0, 1.0))


def _closed(
    monkeypatch: pytest.MonkeyPatch,
    calibrated: ClosureFit = FIT,
    nominal: ClosureFit = FIT,
    tried: ClosureFit = FIT,
    held_out: Sequence[HeldOut] = GAINED,
) -> ClosureResult:
    """``closure`` on two sockets a location, with fits that are given in place of solved ones."""
    left = {h.location: h for h in held_out}

    def solved(problem: object, larger: np.ndarray, free: bool) -> ClosureFit:
        return tried if free else calibrated if larger.any() else nominal

    def rms(fit: ClosureFit, own: Sequence[Socket], kind: str) -> float:
        which = "calibrated" if fit is calibrated else "nominal"
        return float(getattr(left[own[0].location], f"{which}_{kind}"))

    monkeypatch.setattr(judge, "solve_closure", solved)
    monkeypatch.setattr(judge, "held_out_rms", lambda fit, own: rms(fit, own, "mm"))
    monkeypatch.setattr(judge, "predicted_rms", lambda fit, own: rms(fit, own, "sigma_mm"))
    joints = np.linspace(-0.5, 0.5, 18).reshape(3, 6)
    sockets = [Socket(h.location, name, joints) for h in held_out for name in ("one", "two")]
    return closure(sockets, ARM, distance_mm=50.0)


def _fit(base: ClosureFit = FIT, **changed: object) -> ClosureFit:
    return replace(base, **changed)  # type: ignore[arg-type]


OTHER = _fit()  # as FIT, yet another object


@pytest.mark.parametrize(
    ("fits", "code"),
    [
        ({}, "ok"),
        ({"nominal": _fit(rms_mm=50.0)}, "ok"),
        ({"nominal": _fit(rms_mm=50.01)}, "robot_contradicts"),
        ({"calibrated": _fit(chi2_per_dof=30.0)}, "ok"),
        ({"calibrated": _fit(chi2_per_dof=30.01), "tried": _fit(chi2_per_dof=30.0)}, "robot_contradicts"),
        ({"calibrated": _fit(chi2_per_dof=30.01, cost=900.0)}, "distance_contradicts"),
        ({"calibrated": _fit(converged=False)}, "not_converged"),
        ({"calibrated": _fit(cost=120.0)}, "ok"),
        ({"calibrated": _fit(cost=120.01)}, "distance_contradicts"),
        ({"calibrated": _fit(cost=120.01), "tried": _fit(chi2_per_dof=1.01)}, "ok"),
        ({"calibrated": _fit(cost=120.01), "tried": _fit(chi2_per_dof=0.5)}, "distance_contradicts"),
        ({"calibrated": _fit(cost=900.0), "tried": _fit(parameters=np.array([0.2, 0.0, 0.0]))}, "ok"),
        ({"calibrated": _fit(parameters=np.array([0.2, 0.0, 0.0]))}, "ok"),
        ({"calibrated": _fit(parameters=np.array([-0.2001, 0.0, 0.0]))}, "priors_contradict"),
        ({"held_out": GAINED[:1]}, "too_few_locations"),
        ({"held_out": GAINED[:2]}, "ok"),
    ],
)
def test_a_limit_divides_what_is_said(monkeypatch: pytest.MonkeyPatch, fits: dict[str, object], code: str) -> None:
    result = _closed(monkeypatch, **({"nominal": OTHER} | fits))  # type: ignore[arg-type]
    assert result.code == code
    assert result.trustworthy == (code == "ok")


def test_words_name_distance_and_parameters(monkeypatch: pytest.MonkeyPatch) -> None:
    away = _closed(monkeypatch, nominal=OTHER, calibrated=_fit(cost=136.0), tried=_fit(distance_mm=(48.123, 0.456)))
    assert "puts them 48.12 ± 0.46 mm apart, not 50 (6 σ)" in away.text
    assert away.found_distance_mm == (48.123, 0.456)
    names = [p.name for p in ARM.parameters][:3]
    pulled = _closed(monkeypatch, nominal=OTHER, calibrated=_fit(parameters=np.array([0.3, 0.5, 0.0])))
    assert [p.parameter for p in pulled.pulls] == [names[0], names[1], names[2]]
    assert pulled.pulls[0] == Correction(names[0], pytest.approx(np.rad2deg(0.3)), "deg", pytest.approx(30.0))
    assert f"{names[0]} is changed by +17.2 deg (30 σ), {names[1]} is changed by" in pulled.text
    alone = _closed(monkeypatch, nominal=OTHER, calibrated=_fit(rms_mm=1.0), held_out=GAINED[:1])
    assert alone.text.startswith("one location only")


def test_a_gain_is_shown_by_students_test(monkeypatch: pytest.MonkeyPatch) -> None:
    """Falls of 3.00, 3.41 and 2.61 mm²: mean 3.007, standard error 0.231; one-sided 95 % of 2 degrees: 2.92."""
    result = _closed(monkeypatch, nominal=OTHER)
    assert result.gain_mm2 == (pytest.approx(3.00667, abs=1e-5), pytest.approx(0.23096, abs=1e-5))
    assert result.gains
    assert result.keep is result.calibrated
    assert "falls by 3.007 ± 0.231 mm² (standard error over 3 locations; 2.9 standard errors would" in result.text
    hardly = (HeldOut("A", 1.0, 0.0, 1.0, 1.0), HeldOut("B", 3.0, 0.0, 1.0, 1.0), HeldOut("C", 2.0, 0.0, 1.0, 1.0))
    for shift, gains in ((0.0, False), (1.0, True)):  # of squares 1, 9, 4 and 2, 10, 5: 4.67 and 5.67 ± 2.33
        left = tuple(replace(h, nominal_mm=float(np.sqrt(h.nominal_mm**2 + 2.2 * shift))) for h in hardly)
        found = _closed(monkeypatch, nominal=OTHER, held_out=left)
        assert (found.gains, found.code) == (gains, "ok" if gains else "no_gain")
        assert found.keep is (found.calibrated if gains else found.nominal)
        assert found.trustworthy


def test_sigmas_follow_what_the_locations_left_out_show(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of the model that is kept: σ expected 1 mm and seen 2 mm at each of three: all are doubled; never narrowed."""
    seen = tuple(replace(h, calibrated_mm=2.0, nominal_mm=9.0, calibrated_sigma_mm=1.0) for h in GAINED)
    wide = _closed(monkeypatch, nominal=OTHER, held_out=seen)
    assert wide.widened == pytest.approx(2.0)
    assert wide.predicted_sigma_mm == pytest.approx(2.0)
    np.testing.assert_allclose(wide.tool_covariance, 4 * np.diag([4.0, 1.0, 9.0]))
    narrow = tuple(replace(h, nominal_mm=0.5, calibrated_mm=3.0, nominal_sigma_mm=k) for k, h in enumerate(GAINED, 1))
    kept = _closed(monkeypatch, nominal=OTHER, held_out=narrow)
    assert kept.keep is kept.nominal
    assert kept.widened == 1.0
    assert kept.predicted_sigma_mm == pytest.approx(np.sqrt((1 + 4 + 9) / 3))
    alone = _closed(monkeypatch, nominal=OTHER, held_out=GAINED[:1])
    assert (alone.held_out, alone.widened, alone.predicted_sigma_mm, alone.gains) == ((), 1.0, None, False)
    assert np.isnan(alone.gain_mm2).all()


@pytest.mark.parametrize(
    ("joints", "words"),
    [
        (np.zeros((3, 7)), "socket A/one has joint rows of 7 values, the robot 6 joints"),
        (np.zeros(6), "has joint rows of 6 values"),
        (np.zeros((2, 6)), "has 2 configurations: at least 3 are needed"),
        (np.full((3, 6), np.nan), "holds a joint reading that is not finite"),
    ],
)
def test_readings_that_are_none_are_refused(joints: np.ndarray, words: str) -> None:
    robot: Robot = ARM
    with pytest.raises(InputError, match=words):
        closure([Socket("A", "one", joints)], robot)
