"""Profiles brought to their frames, and points that can not be points."""

import numpy as np
import pytest

from geometry import Frame, InputError
from geometry.sensor import ProfileOutput
from workbench.profiles import ScanLine, Told, checked_profile, frame_profiles, write_scan_lines

Y = np.arange(-10.0, 10.0, 0.1)
FIELD = np.array([[-15.0, 40.0], [15.0, 40.0], [15.0, 60.0], [-15.0, 60.0]])


def scan(k=0, z=50.0):
    return ScanLine(Y, np.full(len(Y), z + k), number=k)


def frames(*names):
    return [Frame(k, "A", profile=name, line=k + 2) for k, name in enumerate(names)]


def test_a_mark_that_slips_through_is_never_a_point(tmp_path):
    """By the field of view where it is known; by its distance from all else where it is not."""
    z = np.full(len(Y), 50.0)
    z[[3, 70]] = -999.9998
    for output in (ProfileOutput(field_of_view_mm=FIELD), ProfileOutput()):
        found = checked_profile(ScanLine(Y, z), output, tmp_path / "p.csv")
        assert len(found.profile) == len(Y) - 2
        assert "2 of 200 points" in found.remarks[0]
        assert "-999.9998" in found.remarks[0]


def test_the_range_that_a_gocator_file_states_is_its_field(tmp_path):
    z = np.full(len(Y), 50.0)
    z[5] = 90.0
    found = checked_profile(ScanLine(Y, z, range_mm=np.array([[-20.0, 20.0], [40.0, 60.0]])), ProfileOutput(), tmp_path)
    assert len(found.profile) == len(Y) - 1


def test_a_profile_mostly_outside_its_field_is_refused(tmp_path):
    with pytest.raises(InputError, match="outside the field of view"):
        checked_profile(scan(z=100.0), ProfileOutput(field_of_view_mm=FIELD), tmp_path)


def test_metres_are_said(tmp_path):
    with pytest.raises(InputError, match="metres"):
        checked_profile(ScanLine(Y / 1000, np.full(len(Y), 0.3)), ProfileOutput(), tmp_path)


def test_sigmas_are_the_files_then_the_sensors_then_the_scatter(tmp_path):
    rng = np.random.default_rng(0)
    z = 50 + rng.normal(size=len(Y)) * 0.02
    of_file = checked_profile(ScanLine(Y, z, sigma_z_mm=np.full(len(Y), 0.5)), ProfileOutput(sigma_z_mm=0.1), tmp_path)
    of_sensor = checked_profile(ScanLine(Y, z), ProfileOutput(sigma_y_mm=0.2, sigma_z_mm=0.1), tmp_path)
    of_points = checked_profile(ScanLine(Y, z), ProfileOutput(), tmp_path)
    assert np.allclose(of_file.profile.cov_yz_mm2[:, 1, 1], 0.25)
    assert np.allclose(of_sensor.profile.cov_yz_mm2, np.diag([0.04, 0.01]))
    assert abs(np.sqrt(of_points.profile.cov_yz_mm2[0, 1, 1]) / 0.02 - 1) < 0.3


def test_one_file_of_many_profiles_by_number_and_in_order(tmp_path):
    write_scan_lines(tmp_path / "all.csv", [scan(k) for k in range(5)], Told("csv"))
    some = [Frame(k, "A", profile="all.csv", line=k) for k in (4, 1)]
    by_number = frame_profiles(tmp_path, some, ProfileOutput())
    assert {n: p.profile.yz_mm[0, 1] for n, p in by_number.profiles.items()} == {4: 54.0, 1: 51.0}
    named = [Frame(10 + k, "A", profile="all.csv", line=k) for k in range(5)]
    in_order = frame_profiles(tmp_path, named, ProfileOutput())
    assert {n: p.profile.yz_mm[0, 1] for n, p in in_order.profiles.items()} == {10 + k: 50.0 + k for k in range(5)}
    with pytest.raises(InputError, match=r"5 profiles, and 4 rows .* out of step"):
        frame_profiles(tmp_path, named[:4], ProfileOutput())


def test_a_file_that_fails_costs_its_frame_alone_and_all_failing_end(tmp_path):
    write_scan_lines(tmp_path / "a.csv", [scan()], Told("csv"))
    (tmp_path / "b.csv").write_text("nothing")
    found = frame_profiles(tmp_path, frames("a.csv", "b.csv", "c.csv"), ProfileOutput())
    assert set(found.profiles) == {0}
    assert "no profile format" in found.complaints[1]
    assert "no such" in found.complaints[2]
    with pytest.raises(InputError, match="no such"):
        frame_profiles(tmp_path, frames("c.csv"), ProfileOutput())


def test_mixed_formats_are_said(tmp_path):
    write_scan_lines(tmp_path / "a.csv", [scan()], Told("csv"))
    write_scan_lines(tmp_path / "b.csv", [scan()], Told("gocator"))
    found = frame_profiles(tmp_path, frames("a.csv", "b.csv"), ProfileOutput())
    assert any("csv (1), gocator (1)" in r for r in found.remarks)
