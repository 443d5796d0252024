"""Numbers that no thing can have are refused by name; what lies just within is taken."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from geometry import Board, DhRobot, Frame, InputError, Pose, Sensor, Sheet
from geometry.robot.axes_to_dh import robot_from_axes
from geometry.sensor import Camera, DirectMap, Optics, ProfileOutput, SensorUncertainty
from geometry.unknowns import Block, State, Unknowns
from tests.geometry.strategies import line_sensor

LENS = line_sensor().camera
assert LENS is not None
PLACE = LENS.T_sensor_camera
OPTICS = Optics(wavelength_nm=660.0, pixel_um=5.0, f_number=8.0, focus_distance_mm=300.0)
CHECKERED = Board("checkerboard", 9, 6, 10.0)
CHARUCO = Board("charuco", 9, 6, 10.0, 7.0, "DICT_4X4_50")
PROFILER = ProfileOutput("csv", 0.01, 0.01, pitch_mm=0.1)
DIRECT = DirectMap(homography=np.eye(3))
POLYNOMIAL = DirectMap(polynomial=((0, 0, 1.0, 2.0), (1, 0, 0.1, 0.2)))
ARM = DhRobot.from_dh(np.zeros(2), [0.0, 10.0], [100.0, 0.0], [0.0, 0.5])
NAN, INF = float("nan"), float("inf")


def _at(x: float, y: float = 0.0, z: float = 0.0) -> Pose:
    return Pose(PLACE.R, PLACE.t * 0 + [x, y, z])


def _looking(x: float, z: float = 0.0) -> Pose:
    """A camera there that looks at the sheet."""
    side = np.sign(x)
    way = np.array([-side, 0.0, 1.0]) / np.sqrt(2)
    R = np.column_stack([np.cross([0.0, 1.0, 0.0], way), [0.0, 1.0, 0.0], way])
    return Pose(R, np.array([x, 0.0, z]))


Case = tuple[Any, str, Any, Any, str]
CASES: list[Case] = [
    *((OPTICS, name, 1e-9, bad, f"{name} = {bad:g} of the optics: must be positive and finite")
      for name in ("wavelength_nm", "pixel_um", "f_number", "focus_distance_mm") for bad in (0.0, -0.5, INF, NAN)),
    (LENS, "width_px", 2000, 65536, "image size 65536 ×"),
    (LENS, "height_px", 1, 0, "× 0 px: width and height must lie in 1 … 65535"),
    (LENS, "bit_depth", 10, 9, "bit_depth 9: must be one of"),
    (LENS, "black_level", 254.9, 255, "black_level 255: must lie in 0 … 254 at 8 bits"),
    (LENS, "black_level", 0, -0.1, "black_level -0.1"),
    (LENS, "stated_saturation_dn", 1, 0, "saturation_dn = 0: must lie above black_level = 0"),
    (LENS, "stated_saturation_dn", 255, 256, "and at most at 255, the full scale of 8 bits"),
    (LENS, "fx_px", 0.0501 * 1280, 0.05 * 1280, "fx_px = 64 px with an image of 1280 px: no lens sees so wide"),
    (LENS, "fy_px", 1279e3, 1280e3, "fy_px = 1.28e+06 px with an image of 1280 px"),
    (LENS, "fx_px", 1000.0, 0.0, "focal lengths fx_px = 0, fy_px ="),
    (LENS, "cx_px", 63_999.0, 64_000.0, "the principal point lies far off the image"),
    (LENS, "cy_px", -63_999.0, -64_000.0, "the principal point lies far off the image"),
    (LENS, "cx_px", 600.0, NAN, "the camera holds a number that is not finite"),
    (LENS, "distortion", (0.0,) * 12, (0.0,) * 11, "11 terms: OpenCV's model takes 0, 4, 5, 8, 12 or 14"),
    (LENS, "distortion", (0.0,) * 12 + (0.79, 0.0), (0.0,) * 12 + (0.81, 0.0), "τx"),
    (LENS, "distortion", (0.0,) * 12 + (0.0, -0.79), (0.0,) * 12 + (0.0, -0.81), "τy"),
    (LENS, "T_sensor_camera", _looking(9.9e4), _looking(1e5), "the camera stands 100000 mm from the origin"),
    (LENS, "T_sensor_camera", _looking(1.0), _looking(0.99), "0.99 mm from the laser plane x = 0, where no camera has"),
    (LENS, "T_sensor_camera", _looking(-1.0), _looking(1e-7), "it sees the sheet edge-on and measures no depth"),
    (Sheet(), "fan_rad", 3.14, np.pi, "fan_deg = 180: must lie between 0 and 180"),
    (Sheet(), "fan_rad", 1e-6, 0.0, "fan_deg = 0: must"),
    (Sheet(), "origin_mm", np.array([9e-7, 0, 1]), np.array([2e-6, 0, 1]), "the emitter lies in the laser plane"),
    (Sheet(), "origin_mm", np.zeros(3), np.zeros(2), "origin_mm must be three finite numbers"),
    (Sheet(), "origin_mm", np.zeros(3), np.array([0, INF, 0]), "origin_mm must be three finite numbers"),
    (CHECKERED, "kind", "circles", "chess", 'kind = "chess" is no board'),
    (CHECKERED, "columns", 3, 2, "the board has 2 columns: must lie in 3 …"),
    (CHARUCO, "rows", 2, 1, "the board has 1 rows: must lie in 2 …"),
    (CHECKERED, "pitch_mm", 1e-3, 0.0, "the board's pitch is 0 mm: must be positive and finite"),
    (CHECKERED, "pitch_mm", 1e-3, INF, "the board's pitch is inf mm"),
    (CHARUCO, "marker_mm", 9.99, 10.0, "marker_mm = 10: a marker is smaller than its square of 10 mm"),
    (CHARUCO, "marker_mm", 0.01, 0.0, "marker_mm = 0: a marker"),
    (PROFILER, "format", "csv", "cvs", '[profile] format = "cvs" is unknown: did you mean "csv"?'),
    *((PROFILER, name, 1e-9, bad, f"[profile] {name} = {bad:g}: must be positive and finite")
      for name in ("sigma_y_mm", "sigma_z_mm", "pitch_mm") for bad in (0.0, -1.0, INF)),
    (PROFILER, "width", 999_999, 1_000_000, "[profile] width = 1000000: must be 1 … 999999"),
    (PROFILER, "unit", 1, 0, "[profile] unit = 0: must be 1 … 999999"),
    (PROFILER, "start_mm", -5.0, NAN, "[profile] start_mm = nan: must be finite"),
    (PROFILER, "field_of_view_mm", np.array([[0, 1], [1, 1], [0, 2.0]]), np.array([[0, 1], [1, 1.0]]), "three or more"),
    (PROFILER, "field_of_view_mm", np.array([[0, 1], [1, 1], [0, 2]]), np.array([[0, 1], [1, 2], [2, 3]]), "no area"),
    (DIRECT, "homography", np.diag([1, 1, 1e-3]), np.diag([1, 1, 0.0]), "must be an invertible 3 × 3 matrix"),
    (DIRECT, "homography", np.eye(3), np.eye(4), "must be an invertible 3 × 3 matrix"),
    (DIRECT, "rms_mm", 0.0, -1e-9, "rms_mm = -1e-09: must be finite and not negative"),
    (DIRECT, "seen_px", (0, 0, 1, 1), (0, 0, 0, 1), "seen_px is [least u, least v, largest u, largest v]"),
    (DIRECT, "seen_px", (0, 0, 1, 1), (0, 1, 1, 1), "seen_px is [least u, least v, largest u, largest v]"),
    (POLYNOMIAL, "polynomial", ((0, 0, 1.0, 1.0),), ((0, 0, 1.0, 1.0), (0, 0, 2.0, 1.0)), "two rows of the same"),
    (POLYNOMIAL, "polynomial", ((0, 0, 1.0, 1.0),), ((-1, 0, 1.0, 1.0),), "the row [-1, 0, 1, 1]: two powers"),
    (POLYNOMIAL, "polynomial", ((0, 0, 1.0, 1.0),), ((0, 0, NAN, 1.0),), "two finite coefficients are right"),
    (POLYNOMIAL, "homography", None, np.eye(3), "exactly one of them"),
    (line_sensor(), "housing_mm", np.array([[-1, -1, -1], [1, 1, 1]]), np.array([[-1, 1, -1], [1, 1, 1]]), "[housing]"),
    (ARM, "sign", np.array([1.0, -1.0]), np.array([1.0, 0.5]), "joint 2: sign = 0.5, must be 1 or -1"),
    (ARM, "min_rad", np.full(2, -1.0), np.array([-1.0, 99.0]), "joint 2: the lower limit must be below the upper one"),
    (ARM, "d", np.array([1.0, 2.0]), np.array([1.0, NAN]), "joint 2: d is not a finite number"),
    (ARM, "a", np.array([1.0, 2.0]), np.array([1.0]), "the robot's a has 1 values for 2 joints"),
    (ARM, "convention", "modified", "dh", 'robot convention "dh": must be "standard" or "modified"'),
    (ARM, "coupling", np.diag([1, 1.01e-6]), np.diag([1, 0.99e-6]), "matrix is singular"),
    (ARM, "coupling", np.eye(2), np.eye(3), "[coupling] matrix must be 2 × 2 finite numbers"),
    (ARM, "unstated", (True, False), (True,), "stated limits are told of 1 joints of 2"),
]  # fmt: skip


@pytest.mark.parametrize(("thing", "name", "good", "bad", "words"), CASES)
def test_a_limit_is_named(thing: Any, name: str, good: Any, bad: Any, words: str) -> None:
    replace(thing, **{name: good})
    with pytest.raises(InputError, match=re.escape(words)):
        replace(thing, **{name: bad})


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: SensorUncertainty.from_sigma({"fx_px": -1e-9}), "fx_px = -1e-09: a standard deviation is finite"),
        (lambda: SensorUncertainty.from_sigma({"fx_px": INF}), "fx_px = inf: a standard deviation is finite"),
        (lambda: SensorUncertainty.from_sigma({"fx_p": 1.0}), '"fx_p" is no parameter of a sensor: did you mean "fx'),
        (lambda: SensorUncertainty.from_sigma({"fx_px": 1.0}, "guess"), 'source = "guess": must be one of'),
        (lambda: Sensor(Sheet(), LENS, profile=PROFILER), "[camera] or [profile], not both"),
        (lambda: Sensor(Sheet(), direct=DIRECT), "it needs [image] and [camera] beside it"),
        (lambda: Unknowns((Block.vector("x", np.ones(1)), Block.vector("x", np.ones(1)))), "are called x"),
        (lambda: State({"x": np.zeros(1)}).pose("x"), "the block x holds numbers, not a pose"),
        (lambda: State({"x": Pose.identity()}).vector("x"), "the block x holds a pose, not numbers"),
        (lambda: robot_from_axes(np.zeros((2, 3)), np.zeros((3, 3)), Pose.identity()), "not (2, 3) and (3, 3)"),
        (lambda: robot_from_axes(np.zeros((0, 3)), np.zeros((0, 3)), Pose.identity()), "must both be (n, 3)"),
        (lambda: ARM.pose(np.zeros(3)), "3 joint values for a robot of 2 joints"),
        (lambda: ARM.corrected(np.zeros(99)), "99 corrections for a robot of"),
        (lambda: ARM.with_changes(delta=np.zeros(2)), "a robot's table has theta, d, a, alpha, beta, not delta"),
        (lambda: Pose.from_matrix(np.eye(3)), "a transform must be 4 × 4, not 3 × 3"),
        (lambda: Pose.from_matrix(np.diag([1.0, 1, -1, 1])), "the matrix is a reflection"),
    ],
)  # fmt: skip
def test_what_can_not_be_made_is_said(make: Callable[[], object], words: str) -> None:
    with pytest.raises(InputError, match=re.escape(words)):
        make()


def test_a_frame_without_a_pose_says_so() -> None:
    frame = Frame(number=3, location="A", role="calibrate")
    with pytest.raises(ValueError, match="frame 3 has no hand pose yet"):
        _ = frame.at


def test_a_camera_that_a_lens_bends_beyond_use_is_refused() -> None:
    """Half way to the corner a lens of these terms moves points by 0.55 and 0.65 of their distance from the centre."""
    half = np.hypot(*(np.array([LENS.width_px, LENS.height_px]) / 4 / LENS.fx_px))
    for share, refused in ((0.55, False), (0.65, True)):
        terms = (share / half**2, 0.0, 0.0, 0.0)
        if not refused:
            assert Camera(**_fields(terms)).distortion == terms
            continue
        with pytest.raises(InputError, match="distortion"):
            Camera(**_fields(terms))


def _fields(terms: tuple[float, ...]) -> dict[str, Any]:
    return {
        "width_px": LENS.width_px, "height_px": LENS.height_px, "fx_px": LENS.fx_px, "fy_px": LENS.fx_px,
        "cx_px": (LENS.width_px - 1) / 2, "cy_px": (LENS.height_px - 1) / 2, "T_sensor_camera": PLACE,
        "distortion": terms,
    }  # fmt: skip
