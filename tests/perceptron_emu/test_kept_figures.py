"""Small pictures under every effect, kept as they are: no part of the light's way changes unseen."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

from geometry import InputError, Pose
from jig_cad import Jig
from perceptron_emu import EmulatorConfig, Material, Scene, Solid, mean_electrons, panel, render
from perceptron_emu.lens import defocus_radius_px, field_sigma_px, filter_transmission, focus_distance_mm, gather
from perceptron_emu.lens.optics import focal_length_mm, gathered, pupil_points_mm, sharp_sigma_px, working_f_number
from tests.perceptron_emu.conftest import TILTED, jig_before, make_sensor
from tests.pinned import pinned

SMALL = {"width_px": 320, "height_px": 256, "fx_px": 575.0, "fy_px": 580.0, "cx_px": 159.5, "cy_px": 127.5}
QUIET = {"noise": {"enabled": False, "full_well_e": 1e5}, "speckle": {"enabled": False}}
CONFIGS: dict[str, dict[str, dict[str, object]]] = {
    "as delivered": {},
    "quiet": QUIET,
    "a gaussian fan": {"laser": {"profile": "gaussian", "waist_distance_mm": 200.0}, **QUIET},
    "an even fan of one width": {"laser": {"profile": "uniform", "divergence": False}, **QUIET},
    "speckle, polarised": {"speckle": {"polarised": True}, "noise": {"enabled": False}},
    "out of focus": {"optics": {"defocus": True, "focus_distance_mm": 350.0, "aperture_points": 7}, **QUIET},
    "soft corners and glare": {"optics": {"blur_corner_px": 1.8, "veiling_glare": 0.02, "vignetting": False}, **QUIET},
    "no diffraction, a filter beside": {"optics": {"diffraction": False, "filter_centre_nm": 652.0}, **QUIET},
    "bounces": {"light": {"bounces": True}, **QUIET},
    "room": {"ambient": {"shadows": True, "samples": 2, "fill": 0.4}, **QUIET},
    "in steps": {"exposure": {"hdr_ratios": [1.0, 0.25]}},
    "moved and rolled": {
        "motion": {"velocity_mm_s": [30, 90, -40], "angular_deg_s": [5, 2, -8], "samples": 3},
        "exposure": {"time_ms": 2.0, "shutter": "rolling"},
        **QUIET,
    },
    "another chip": {"noise": {"pattern_seed": 7, "prnu": 0.05, "dsnu_e": 20.0, "adc_bits": 8, "read_noise_e": 3.0}},
}


def _scene(**more: object) -> Scene:
    """A jig before a wall, a glossy ball and a waxen box beside it."""
    sensor = make_sensor(TILTED, **(SMALL | more))
    before = jig_before(sensor)
    wall = panel(600, 600, Pose.from_fixed_xyz_deg([4, 8, 2], [0, 0, 420.0]), Material(0.5))
    ball = trimesh.creation.icosphere(subdivisions=2, radius=15)
    box = trimesh.creation.box((20, 25, 18))
    solids = (
        wall,
        Solid(ball, Material(0.3, 0.4, 0.3), Pose(np.eye(3), np.array([0.0, 50, 330]))),
        Solid(box, Material(0.6, scatter_mm=0.4), Pose.from_fixed_xyz_deg([10, 20, 30], [2, -45, 300.0])),
    )
    return Scene(sensor, before.jig, before.T_sensor_jig, solids)


@pytest.mark.parametrize("name", CONFIGS)
def test_pictures_are_the_same(name: str) -> None:
    config = EmulatorConfig.model_validate(CONFIGS[name])
    frame = render(_scene(), config, np.random.default_rng(3))
    pinned({"picture": frame.image, "truth": frame.truth, "electrons": mean_electrons(_scene(), config)[::3, ::3]})


def test_pictures_of_a_camera_of_12_bits() -> None:
    frame = render(_scene(bit_depth=12, black_level=100.0), rng=np.random.default_rng(3))
    pinned({"picture": frame.image, "truth": frame.truth})


@pytest.mark.parametrize("name", ["quiet", "out of focus", "soft corners and glare", "no diffraction, a filter beside"])
def test_what_a_lens_does(name: str) -> None:
    """Where it is sharp, how much light comes through and how wide it draws, over the image."""
    optics, sensor = EmulatorConfig.model_validate(CONFIGS[name]).optics, make_sensor(TILTED, **SMALL)
    uv = np.array([[0.0, 0.0], [159.5, 127.5], [310.0, 20.0]])
    camera_mm = np.array([[-60.0, 10.0, 250.0], [0.0, 0.0, 300.0], [40.0, 30.0, 380.0]])
    lens = gather(optics, sensor, 660.0)
    pinned(
        {
            "focus": focus_distance_mm(optics, sensor),
            "focal": focal_length_mm(optics, sensor),
            "stop": working_f_number(optics, sensor),
            "sharp": sharp_sigma_px(optics, sensor, 660.0),
            "field": field_sigma_px(optics, sensor, uv, 660.0),
            "defocus": defocus_radius_px(optics, sensor, camera_mm),
            "pupil": pupil_points_mm(optics, sensor),
            "filter": filter_transmission(optics, 660.0, np.array([1.0, 0.97, 0.9]), 658.0),
            "gathered": [gathered(lens, c, d) for c, d in ((1.0, 300.0), (0.9, 250.0))],
        }
    )


@pytest.mark.parametrize(
    "numbers",
    [(-0.1, 0.0, 0.3), (1.1, 0.0, 0.3), (0.5, -0.1, 0.3), (0.5, 0.6, 0.3), (0.5, 0.1, 0.01), (0.5, 0.1, 0.3, 5.1)],
)
def test_numbers_that_are_no_surface_are_refused(numbers: tuple[float, ...]) -> None:
    with pytest.raises(InputError) as refused:
        Material(*numbers)
    pinned(str(refused.value))


def test_limits_of_a_surface_are_one() -> None:
    assert Material(0.0, 0.0, 0.02, 5.0).scatter_mm == 5.0
    assert Material(0.5, 0.5, 1.0).roughness == 1.0
    assert Scene(make_sensor(), Jig.nominal(), Pose(np.eye(3), np.array([0.0, 0, 300]))).solids == ()
