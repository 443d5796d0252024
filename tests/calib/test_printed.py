"""Printed numbers of a pose scatter by their printed σ, also where two axes become one."""

from __future__ import annotations

import re

import numpy as np
import pytest

from calib.printed import gimbal_note, nees, printed_sigmas
from geometry import Pose

SHARE = 0.03  # five σ of a scatter of 20,000


def _covariance(seed: int) -> np.ndarray:
    a = np.random.default_rng(seed).normal(size=(6, 6)) * np.array([0.1] * 3 + [4e-4] * 3)[:, None]
    return np.asarray(a @ a.T)


def _drawn(T: Pose, covariance: np.ndarray, count: int = 20_000) -> Pose:
    rng = np.random.default_rng(9)
    return T @ Pose.exp(rng.multivariate_normal(np.zeros(6), covariance, count, method="cholesky"))


@pytest.mark.parametrize("angles", [(0, 0, 0), (20, -40, 130), (-170, 60, 10), (5, 80, -95)])
def test_numbers_scatter_by_their_sigma(angles: tuple[float, float, float]) -> None:
    T, covariance = Pose.from_fixed_xyz_deg(angles, [100.0, -50.0, 30.0]), _covariance(sum(angles) % 7)
    rotation, translation = printed_sigmas(T, covariance)
    drawn = _drawn(T, covariance)
    off = (drawn.fixed_xyz_deg - T.fixed_xyz_deg + 180) % 360 - 180
    np.testing.assert_allclose(off.std(axis=0), rotation, rtol=SHARE)
    np.testing.assert_allclose(drawn.t.std(axis=0), translation, rtol=SHARE)
    assert nees(T, T, covariance) == 0.0
    assert np.mean([nees(drawn[i], T, covariance) for i in range(2000)]) == pytest.approx(6.0, abs=0.4)
    assert gimbal_note(T, covariance) == ()


@pytest.mark.parametrize("y", [90.0, -90.0])
def test_at_gimbal_lock_sum_or_difference_is_what_is_known(y: float) -> None:
    T, covariance = Pose.from_fixed_xyz_deg([30.0, y, 12.5], [0.0, 0.0, 0.0]), _covariance(3)
    rotation, _ = printed_sigmas(T, covariance)
    assert np.isinf(rotation[[0, 2]]).all()
    tilt = np.rad2deg(np.arccos(np.clip(np.abs(_drawn(T, covariance).R[:, 2, 0]), 0, 1)))
    about = printed_sigmas(T, covariance)[0][1]
    assert np.sqrt(np.mean(tilt**2)) > about  # Y leaves 90° by turns about y and z of the sensor
    (note,) = gimbal_note(T, covariance)
    sign, both, sigma = re.search(r"X ([-+]) Z = (\S+) ± (\S+)° is what is known", note).groups()  # type: ignore[union-attr]
    assert sign == ("-" if y > 0 else "+")
    x, _, z = T.fixed_xyz_deg
    assert float(both) == pytest.approx((x - z if y > 0 else x + z + 180) % 360 - (0 if y > 0 else 180), abs=1e-3)
    assert float(sigma) == pytest.approx(np.rad2deg(np.sqrt(covariance[3, 3])), abs=1e-4)
    rows = [[float(v) for v in row.split(",")] for row in re.search(r"matrix is \[(.*?)\]", note)[1].split(";")]  # type: ignore[index]
    np.testing.assert_allclose(rows, T.R, atol=6e-8)


@pytest.mark.parametrize(("y", "said"), [(87.2, True), (87.0, False), (-87.2, True), (-87.0, False)])
def test_within_three_degrees_of_it_a_note_is_given(y: float, said: bool) -> None:
    assert bool(gimbal_note(Pose.from_fixed_xyz_deg([10.0, y, -20.0], [0, 0, 0]), _covariance(1))) == said
