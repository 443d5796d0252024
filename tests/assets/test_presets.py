"""Sensor, jig and sample presets: fields of view as in the data sheets, the sample a true part of its recording."""

import cv2
import numpy as np
import pytest

import assets
from geometry import InputError, field_of_view, inside_polygon
from jig_cad import read_jig
from tests.recordings import MISSING, recording
from workbench.files import read_emulator, read_sensor

# near and far [mm from the face], width near, at the reference distance (None: not published) and far, wavelength [nm]
DATA_SHEETS = {
    "keyence_lj_x8080": (73 - 20.5, 73 + 20.5, 30, 35, 39, 405),
    "keyence_lj_x8200": (245 - 34, 245 + 34, 64, 72, 80, 405),
    "keyence_lj_x8300": (288 - 53, 288 + 53, 134, 150, 160, 405),
    "lmi_gocator_2330": (90, 170, 47, None, 85, 660),
    "lmi_gocator_2340": (190, 400, 96, None, 194, 660),
    "lmi_gocator_2350": (300, 700, 158, None, 365, 660),
}
RTOL = 0.005
RTOL_REFERENCE = 0.03  # no straight-sided field meets all three of the LJ-X8300's widths
RECORDING = recording("cell_a")


def width_at(polygon: np.ndarray, depth: float) -> float:
    """Width of the field at a depth, by looking across it."""
    y = np.linspace(polygon[:, 0].min() - 1, polygon[:, 0].max() + 1, 40001)
    inside = inside_polygon(np.column_stack([y, np.full_like(y, depth)]), polygon)
    return float(np.ptp(y[inside]))


@pytest.mark.parametrize("name", DATA_SHEETS)
def test_fields_of_view_are_those_of_the_data_sheets(name: str) -> None:
    near, far, w_near, w_reference, w_far, wavelength = DATA_SHEETS[name]
    sensor = read_sensor(assets.path("sensors", name))
    polygon = field_of_view(sensor)
    depth = far - near
    np.testing.assert_allclose(polygon[:, 1].min(), near, rtol=0, atol=RTOL * depth)
    np.testing.assert_allclose(polygon[:, 1].max(), far, rtol=0, atol=RTOL * depth)
    np.testing.assert_allclose(width_at(polygon, near + 0.0005 * depth), w_near, rtol=RTOL)
    np.testing.assert_allclose(width_at(polygon, far - 0.0005 * depth), w_far, rtol=RTOL)
    if w_reference is not None:
        np.testing.assert_allclose(width_at(polygon, (near + far) / 2), w_reference, rtol=RTOL_REFERENCE)
    assert read_emulator(assets.path("sensors", name)).laser.wavelength_nm == wavelength


@pytest.mark.parametrize("name", assets.list_presets("sensors"))
def test_sensor_presets_say_what_is_assumed(name: str) -> None:
    text = assets.path("sensors", name).read_text()
    assert ("assumed" in text) == (name in DATA_SHEETS)
    assert name in DATA_SHEETS or "No maker's data" in text
    assert name in DATA_SHEETS or name == "nominal"


def test_the_nominal_sensor_sees_the_papers_jig_from_its_stand_off() -> None:
    """A triangle of 100 mm with 10 mm to spare, its front string at 290 mm, inside the field of view."""
    polygon = field_of_view(read_sensor(assets.path("sensors", "nominal")), margin_px=20.0)
    corners = np.array([[0, 280], [-60, 387], [60, 387]])
    assert np.all(inside_polygon(corners, polygon))


def test_jig_presets() -> None:
    paper, six = (read_jig(assets.path("jigs", name)) for name in ("paper", "six_strings"))
    assert (paper.side_mm, paper.height_mm, paper.string_diameter_mm, paper.tolerance_mm) == (100, 100, 0.3, 0.1)
    assert paper.strings == ("A", "B", "C", "B'", "C'")
    assert six.strings == (*paper.strings, "D'")
    assert assets.list_presets("jigs") == ("paper", "six_strings")


def test_unknown_presets_are_refused() -> None:
    with pytest.raises(InputError, match='did you mean "nominal"'):
        assets.path("sensors", "nominel")
    with pytest.raises(InputError, match='did you mean "robots"'):
        assets.path("robot")


def test_the_sample_is_small_and_whole() -> None:
    from workbench.files import read_cell

    folder = assets.path("samples", "cell_a")
    cell = read_cell(folder)
    assert sum(p.stat().st_size for p in folder.rglob("*") if p.is_file()) <= 3_000_000
    assert {f.location for f in cell.frames if f.role == "calibrate"} >= {"A", "B"}
    assert any(f.role == "verify" for f in cell.frames)
    assert len(cell.frames) >= 10


@pytest.mark.skipif(not RECORDING.is_dir(), reason=MISSING)
def test_the_samples_pixels_are_the_recordings() -> None:
    folder = assets.path("samples", "cell_a")
    lines = (RECORDING / "frames.csv").read_text().splitlines()
    assert set((folder / "frames.csv").read_text().splitlines()) <= set(lines)
    for image in sorted((folder / "images").iterdir()):
        ours, theirs = (cv2.imread(str(p), cv2.IMREAD_UNCHANGED) for p in (image, RECORDING / "images" / image.name))
        np.testing.assert_array_equal(ours, theirs)
