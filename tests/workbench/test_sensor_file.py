"""sensor.toml: profile sensors, uncertainty, saturation and channel; what is wrong said in one sentence.

That a profile sensor's points are measured aright is not shown here: nothing reads profiles yet.
"""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from geometry import InputError, field_of_view
from geometry.sensor import Optics, calibration_covariance
from perceptron_emu import EmulatorConfig
from tests.workbench.helpers import Cli
from workbench.cell import find_emulator, find_sensor
from workbench.files import read_emulator, read_sensor, sensor_text

CAMERA = sensor_text(find_sensor("nominal"), find_emulator("nominal"))
PROFILE = """
name = "line profiler"
[profile]
format = "keyence_lj_x"
sigma_z_mm = 0.005
field_of_view_mm = [[-40, 150], [40, 150], [60.0, 300], [-60, 300]]
pitch_mm = 0.1
start_mm = -40.0
z_towards_sensor = true
"""
SIGMAS = '[uncertainty]\nsource = "data sheet"\nscale_y = 1e-3\nplane_tilt_y_deg = 0.5\nplane_shift_mm = 0.2\n'
MATRIX = """[uncertainty]
source = "calibrated"
parameters = ["fx_px", "fy_px", "plane_tilt_z_deg"]
covariance = [[4.0, 3.9, 0.01], [3.9, 4.0, 0.01], [0.01, 0.01, 1e-4]]
"""


TANGENT = "tangent_covariance = [[1.0, 0.9, 0.0], [0.9, 1.0, 0.0], [0.0, 0.0, 1e-4]]\n"


def _written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "sensor.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_profile_sensor_has_no_camera(tmp_path: Path) -> None:
    sensor = read_sensor(_written(tmp_path, PROFILE))
    assert sensor.camera is None
    assert sensor.profile is not None
    given = sensor.profile
    assert (given.format, given.sigma_y_mm, given.sigma_z_mm) == ("keyence_lj_x", None, 0.005)
    assert (given.pitch_mm, given.start_mm, given.z_towards_sensor) == (0.1, -40.0, True)
    assert field_of_view(sensor).tolist() == [[-40, 150], [40, 150], [60, 300], [-60, 300]]
    with pytest.raises(InputError, match=r'"line profiler" has no camera'):
        sensor.require_camera()


@pytest.mark.parametrize("text", [CAMERA, PROFILE, CAMERA + SIGMAS, PROFILE + SIGMAS, CAMERA + MATRIX])
def test_a_sensor_survives_writing(tmp_path: Path, text: str) -> None:
    """All but the rotation, whose last bits change as it is made orthogonal again."""
    path = _written(tmp_path, text)
    first = sensor_text(read_sensor(path), read_emulator(path))
    path.write_text(first, encoding="utf-8")
    again = sensor_text(read_sensor(path), read_emulator(path))
    kept = [[line for line in t.splitlines() if not line.startswith("rotation")] for t in (first, again)]
    assert kept[0] == kept[1]
    assert all(key in first for key in re.findall(r"^\w+", text, re.MULTILINE))


def test_sigmas_become_a_covariance_in_radians(tmp_path: Path) -> None:
    uncertainty = read_sensor(_written(tmp_path, PROFILE + SIGMAS)).uncertainty
    assert uncertainty is not None
    assert uncertainty.source == "data sheet"
    expected = {"scale_y": 1e-3, "plane_tilt_y_rad": np.deg2rad(0.5), "plane_shift_mm": 0.2}
    assert uncertainty.sigma == pytest.approx(expected, rel=1e-12)


def test_a_covariance_is_carried_in_radians(tmp_path: Path) -> None:
    uncertainty = read_sensor(_written(tmp_path, CAMERA + MATRIX)).uncertainty
    assert uncertainty is not None
    assert uncertainty.parameters == ("fx_px", "fy_px", "plane_tilt_z_rad")
    one = np.deg2rad(1.0)
    expected = [[4.0, 3.9, 0.01 * one], [3.9, 4.0, 0.01 * one], [0.01 * one, 0.01 * one, 1e-4 * one**2]]
    np.testing.assert_allclose(uncertainty.covariance, expected, rtol=0, atol=1e-15)


def test_what_points_take_from_the_parameters_is_carried(tmp_path: Path) -> None:
    """tangent_covariance in the file's units; it survives writing, and is what points and drawn errors follow."""
    sensor = read_sensor(_written(tmp_path, CAMERA + MATRIX + TANGENT))
    again = read_sensor(_written(tmp_path, sensor_text(sensor, EmulatorConfig())))
    for known in (sensor.uncertainty, again.uncertainty):
        assert known is not None
        assert known.tangent_covariance is not None
        one = np.deg2rad(1.0)
        np.testing.assert_allclose(np.diag(known.of_points), [1.0, 1.0, 1e-4 * one**2], rtol=1e-12)
        assert known.sigma["fx_px"] == pytest.approx(2.0, abs=1e-12)
        basis = known.independent()[1]
        np.testing.assert_allclose(basis @ basis.T, known.of_points, rtol=0, atol=1e-12)
    own = calibration_covariance(sensor, np.array([[10.0, 250.0]]))
    alone = replace(sensor, uncertainty=replace(sensor.uncertainty, covariance=sensor.uncertainty.tangent_covariance))
    np.testing.assert_array_equal(own, calibration_covariance(alone, np.array([[10.0, 250.0]])))


def test_saturation_and_channel_are_carried(tmp_path: Path) -> None:
    text = CAMERA.replace("black_level = 4.0", 'black_level = 4.0\nsaturation_dn = 250\nchannel = "red"')
    camera = read_sensor(_written(tmp_path, text)).require_camera()
    assert (camera.saturation_dn, camera.full_scale_dn, camera.channel) == (250, 255, "red")
    silent = read_sensor(_written(tmp_path, CAMERA)).require_camera()
    assert (silent.saturation_dn, silent.channel) == (255, None)


def test_optics_are_what_the_file_states(tmp_path: Path) -> None:
    optics = read_sensor(_written(tmp_path, CAMERA.replace("f_number = 4.0\n", ""))).optics
    assert optics == Optics(wavelength_nm=660.0, pixel_um=5.3)
    assert read_sensor(_written(tmp_path, PROFILE)).optics is None


BAD = {
    "neither camera nor profile": ('name = "nothing"\n[laser]\nfan_deg = 40.0\n', ("[image] is missing", "[profile]")),
    "camera beside profile": (CAMERA + PROFILE.split("\n", 2)[2], ("[image] and [profile]", "images or profiles")),
    "unknown format": (PROFILE.replace("keyence_lj_x", "keyence_lj"), ("keyence_lj", "did you mean")),
    "unknown key": (PROFILE.replace("pitch_mm", "pich_mm"), ("line 7", "pich_mm", '"pitch_mm"')),
    "sigma of zero": (PROFILE.replace("0.005", "0.0"), ("line 5", "sigma_z_mm", "greater than 0")),
    "infinite start": (PROFILE.replace("-40.0\n", "-inf\n"), ("start_mm", "finite")),
    "field without area": (PROFILE.replace("300]", "150]"), ("field_of_view_mm", "no area")),
    "field of two corners": (PROFILE.replace(", [60.0, 300], [-60, 300]", ""), ("field_of_view_mm", "three or more")),
    "unknown sigma": (CAMERA + SIGMAS.replace("scale_y", "scal_y"), ("scal_y", '"scale_y"')),
    "sigma of no number": (CAMERA + SIGMAS.replace("1e-3", "nan"), ("scale_y", "finite")),
    "unknown source": (CAMERA + SIGMAS.replace("data sheet", "guess"), ("source", "guess")),
    "a camera's sigma": (PROFILE + "[uncertainty]\nfx_px = 1.0\n", ("fx_px", "the sensor has none")),
    "unknown parameter": (CAMERA + MATRIX.replace('"fy_px"', '"fz_px"'), ("fz_px", "did you mean")),
    "a parameter twice": (CAMERA + MATRIX.replace('"fy_px"', '"fx_px"'), ("fx_px", "2 times")),
    "covariance of another size": (CAMERA + MATRIX.replace(", [0.01, 0.01, 1e-4]", ""), ("covariance", "3 × 3")),
    "ragged covariance": (CAMERA + MATRIX.replace("[3.9, 4.0, 0.01]", "[3.9, 4.0]"), ("covariance", "3 × 3")),
    "not symmetric": (CAMERA + MATRIX.replace("[3.9,", "[3.8,"), ("covariance", "not symmetric")),
    "not positive": (CAMERA + MATRIX.replace("3.9", "4.1"), ("covariance", "negative eigenvalue")),
    "tangent of another size": (CAMERA + MATRIX + "tangent_covariance = [[1.0]]\n", ("tangent_covariance", "3 × 3")),
    "tangent not symmetric": (CAMERA + MATRIX + TANGENT.replace("[0.9", "[0.8"), ("tangent_covariance", "symmetric")),
    "a tangent alone": (CAMERA + "[uncertainty]\ntangent_covariance = [[1.0]]\n", ("parameters is missing",)),
    "no parameters": (CAMERA + "[uncertainty]\ncovariance = [[1.0]]\n", ("parameters is missing",)),
    "sigma beside covariance": (CAMERA + MATRIX + "cx_px = 1.0\n", ("cx_px", "beside covariance")),
    "saturation out of range": (CAMERA.replace("bit_depth = 8", "bit_depth = 8\nsaturation_dn = 256"), ("256", "255")),
    "unknown channel": (CAMERA.replace("bit_depth = 8", 'bit_depth = 8\nchannel = "rot"'), ("channel", "rot")),
}


@pytest.mark.parametrize("case", BAD)
def test_what_is_wrong_is_one_sentence(tmp_path: Path, case: str) -> None:
    text, words = BAD[case]
    with pytest.raises(InputError) as error:
        read_sensor(_written(tmp_path, text))
    message = str(error.value)
    assert message.startswith(str(tmp_path / "sensor.toml"))
    assert "\n" not in message
    assert all(word in message for word in words), message


@pytest.mark.parametrize(
    "command",
    [
        ("extract", "DATASET", "--sensor", "SENSOR", "--csv", "OUT/points.csv"),
        ("extract", "IMAGE", "--sensor", "SENSOR", "--csv", "OUT/points.csv"),
        ("profile", "IMAGE", "--sensor", "SENSOR", "--csv", "OUT/profile.csv"),
        ("gapflush", "IMAGE", "--sensor", "SENSOR"),
        ("validate", "--sensor", "SENSOR", "--frames", "2", "--out", "OUT/report"),
        ("tune", "DATASET", "--sensor", "SENSOR", "--no-browser"),
    ],
    ids=lambda command: " ".join(command[:2]),
)
def test_a_command_that_needs_images_says_so(
    cli: Cli, recording: Path, tmp_path: Path, command: tuple[str, ...]
) -> None:
    sensor = _written(tmp_path, PROFILE)
    places = {"SENSOR": sensor, "DATASET": recording, "IMAGE": recording / "images" / "000.png", "OUT": tmp_path}
    words = [str(places[w]) if w in places else w.replace("OUT", str(tmp_path)) for w in command]
    result = cli(*words)
    assert result.code == 2
    by_profiles = command[:2] in (("extract", "DATASET"), ("tune", "DATASET"))  # with such a sensor, a dataset of these
    assert ("names no profile" if by_profiles else "has no camera") in result.err
    assert len(result.err.strip().splitlines()) <= 2
