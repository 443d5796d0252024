"""Profiles on disk: round trip, whole or nothing, and one sentence for what can not be read."""

from dataclasses import replace

import numpy as np
import pytest

from extraction.stripe import (
    EDGE,
    SATURATED,
    Profile,
    StripePeaks,
    flag_bits,
    flag_names,
    read_profile_csv,
    write_profile_csv,
    write_profile_ply,
)
from geometry import InputError
from tests.pinned import pinned


def profile(n: int = 20) -> Profile:
    rng = np.random.default_rng(1)
    peaks = StripePeaks(
        section=np.arange(n, dtype=np.int32),
        uv_px=rng.uniform(0, 1000, (n, 2)),
        normal=np.tile([0.0, 1.0], (n, 1)),
        sigma_px=rng.uniform(0.01, 0.1, n),
        amplitude_dn=rng.uniform(10, 200, n),
        width_px=rng.uniform(1, 2, n),
        background_dn=rng.uniform(5, 20, n),
        chi2_per_dof=rng.uniform(0.5, 2, n),
        flag=rng.integers(0, 8, n).astype(np.uint8),
    )
    half = rng.normal(0, 0.02, (n, 2, 1))
    return Profile(peaks, rng.uniform(-50, 300, (n, 2)), half @ np.swapaxes(half, 1, 2))


@pytest.mark.parametrize("n", [0, 1, 20])
def test_csv_round_trip(tmp_path, n):
    a = profile(n)
    write_profile_csv(a, tmp_path / "p.csv")
    b = read_profile_csv(tmp_path / "p.csv")
    np.testing.assert_allclose(b.yz_mm, a.yz_mm, rtol=1e-8)
    np.testing.assert_allclose(b.cov_yz_mm2, a.cov_yz_mm2, rtol=1e-6, atol=1e-15)
    np.testing.assert_array_equal(b.peaks.flag, a.peaks.flag)
    np.testing.assert_allclose(b.peaks.uv_px, a.peaks.uv_px, rtol=1e-8)
    assert [f.name for f in tmp_path.iterdir()] == ["p.csv"], "no temporary file stays"


def test_ply_is_read_by_trimesh(tmp_path):
    import trimesh

    a = profile()
    write_profile_ply(a, tmp_path / "p.ply")
    cloud = trimesh.load(tmp_path / "p.ply")
    np.testing.assert_allclose(cloud.vertices[:, 1:], a.yz_mm, rtol=1e-7)
    assert np.all(cloud.vertices[:, 0] == 0)


def test_failed_write_leaves_the_old_file(tmp_path):
    with pytest.raises(InputError, match="can not be written") as refused:
        write_profile_csv(profile(), tmp_path / "missing" / "p.csv")
    pinned(str(refused.value).replace(str(tmp_path), ""))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda t: "", "empty"),
        (lambda t: t.replace("y_mm", "why", 1), "line 1"),
        (lambda t: t.replace(t.splitlines()[3], "1,2,3"), "line 4"),
        (lambda t: t.replace(t.splitlines()[2].split(",")[1], "nan"), "line 3"),
        (lambda t: t[:-1] + "odd\n", "unknown flag"),
    ],
)
def test_broken_csv_is_named(tmp_path, change, message):
    path = tmp_path / "p.csv"
    write_profile_csv(profile(), path)
    path.write_text(change(path.read_text()))
    with pytest.raises(InputError, match=message) as refused:
        read_profile_csv(path)
    pinned(str(refused.value).replace(str(tmp_path), ""))


def test_flags_round_trip():
    assert flag_names(0) == ""
    assert flag_names(SATURATED | EDGE) == "saturated+edge"
    assert all(flag_bits(flag_names(k)) == k for k in range(8))


def test_the_sensors_own_part_stands_behind_the_columns_and_comes_back(tmp_path):
    """Only where the sensor's file states σ; other files keep their header."""
    plain = profile()
    write_profile_csv(plain, tmp_path / "plain.csv")
    assert "sensor" not in (tmp_path / "plain.csv").read_text()
    own = np.broadcast_to(np.array([[4e-4, 1e-4], [1e-4, 9e-4]]), plain.cov_yz_mm2.shape)
    write_profile_csv(replace(plain, sensor_cov_yz_mm2=own), tmp_path / "own.csv")
    header = (tmp_path / "own.csv").read_text().splitlines()[0]
    assert header.endswith(",flag,sigma_sensor_y_mm,sigma_sensor_z_mm,cov_sensor_yz_mm2")
    back = read_profile_csv(tmp_path / "own.csv")
    np.testing.assert_allclose(back.sensor_cov_yz_mm2, own, rtol=0, atol=1e-12)
    np.testing.assert_allclose(back.cov_yz_mm2, plain.cov_yz_mm2, rtol=0, atol=1e-10)
    write_profile_ply(back, tmp_path / "own.ply")
    text = (tmp_path / "own.ply").read_text().splitlines()
    assert "property float sigma_sensor_z" in text
    assert text[text.index("end_header") + 1].split()[-1] == "0.03"
