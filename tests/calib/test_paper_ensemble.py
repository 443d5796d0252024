"""The paper's experiment as it was done: the last three joints move, whatever arm, sensor, jig and mounting."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from calib.synthetic import PaperSetting, industrial_arm, largest_deviations, paper_ensemble, random_cell
from calib.synthetic.cell import axis_points
from calib.synthetic.ensemble import ALL, NONE
from geometry import NoAnswerError, Pose, field_of_view, inside_polygon
from jig_cad import Jig
from tests.geometry.strategies import line_sensor
from tests.pinned import pinned

ATOL_RAD = 1e-12


def test_the_last_joints_alone_move_within_a_place_and_every_string_is_seen() -> None:
    setting = PaperSetting()
    cell = random_cell(np.random.default_rng(1), setting.layout, truth_jig := Jig.nominal(), None, setting.truth)
    for name in "ABC":
        q = cell.joints_rad[[n == name for n in cell.location]]
        assert len(q) == 7
        np.testing.assert_allclose(q[:, :3] - q[0, :3], 0, atol=ATOL_RAD)
        assert np.min(np.ptp(q[:, 3:], axis=0)) > np.deg2rad(3)
        T = (cell.robot.pose(q) @ setting.truth).inverse() @ cell.T_base_jig[name]
        assert setting.layout.field_mm is not None
        assert np.all(inside_polygon(axis_points(T, truth_jig), setting.layout.field_mm))


def test_what_the_first_joints_hide_is_no_deviation() -> None:
    """DH errors are almost common to a place's views where only the wrist moves; where all joints do, they show."""
    sources = {"DH errors alone": replace(NONE, robot=True)}
    left = {}
    for moving in (3, None):
        rows = paper_ensemble(np.random.default_rng(3), 1, sources, setting=PaperSetting(moving))
        pinned(rows)
        left[moving] = float(largest_deviations(rows, "DH errors alone", "bundle scp")[0])
    assert left[3] < 0.15 < left[None]


def test_another_mounting_is_as_far_off_as_the_papers() -> None:
    design = Pose.from_fixed_xyz_deg([0.0, 90.0, 0.0], [50.0, 0.0, 150.0])
    setting = PaperSetting(design=design, truth=PaperSetting.mounted(design), robot=industrial_arm())
    off, papers = (s.design.inverse() @ s.truth for s in (setting, PaperSetting()))
    np.testing.assert_allclose(off.matrix, papers.matrix, atol=1e-9)
    rows = paper_ensemble(np.random.default_rng(2), 1, {"all sources": ALL}, setting=setting)
    pinned(rows)
    assert all(r.error is not None and np.linalg.norm(r.error[:3]) < 5.0 for r in rows)


def test_a_jig_that_the_sensor_can_not_hold_is_said() -> None:
    with pytest.raises(NoAnswerError, match="field of view") as refused:
        paper_ensemble(np.random.default_rng(2), 1, {}, setting=PaperSetting(jig=Jig.nominal(side_mm=400.0)))
    pinned(str(refused.value))


def test_a_given_sensor_stands_about_the_middle_of_its_field() -> None:
    """By seven hundredths of its distance to either side."""
    setting = PaperSetting(sensor=line_sensor())
    z = field_of_view(line_sensor())[:, 1]
    middle = (z.min() + z.max()) / 2
    np.testing.assert_allclose(setting.layout.standoff_mm, (0.93 * middle, 1.07 * middle), rtol=1e-12)
    assert PaperSetting().layout.standoff_mm != setting.layout.standoff_mm


def test_an_arm_of_half_the_size_has_its_places_half_as_far() -> None:
    half = replace(industrial_arm(), a=industrial_arm().a / 2, d=industrial_arm().d / 2)
    small, plain = PaperSetting(robot=half).layout, PaperSetting().layout
    np.testing.assert_allclose(small.radius_mm, np.array(plain.radius_mm) / 2, rtol=1e-12)
    np.testing.assert_allclose(small.height_mm, np.array(plain.height_mm) / 2, rtol=1e-12)
