"""Random poses, robots and sensors for the laws; the near-singular ones on purpose."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from geometry import Camera, DhRobot, Pose, Sensor, Sheet, nearest_rotation

ANGLES_RAD = st.one_of(
    st.floats(0.0, np.pi),
    st.sampled_from([0.0, 1e-15, 1e-9, 1e-6, 0.99e-4, 1.01e-4, np.pi / 2, np.pi - 1e-6, np.pi - 1e-9, np.pi]),
)
SEEDS = st.integers(0, 2**32 - 1)


@st.composite
def rotation_vectors(draw: st.DrawFn, angles: st.SearchStrategy[float] = ANGLES_RAD) -> np.ndarray:
    """Rotation vectors (3,) [rad], near 0 and near π among them."""
    axis = np.random.default_rng(draw(SEEDS)).normal(size=3)
    if draw(st.booleans()):
        axis = np.round(axis)  # axes along the coordinate axes and their diagonals
    norm = np.linalg.norm(axis)
    return draw(angles) * (axis / norm if norm > 0 else np.array([0.0, 0.0, 1.0]))


@st.composite
def tangents(draw: st.DrawFn) -> np.ndarray:
    """Tangent vectors (6,): translation up to some metres [mm], rotation [rad]."""
    translation = np.random.default_rng(draw(SEEDS)).uniform(-1, 1, 3) * draw(st.sampled_from([0.0, 1.0, 3000.0]))
    return np.concatenate([translation, draw(rotation_vectors())])


@st.composite
def poses(draw: st.DrawFn) -> Pose:
    """Poses with translations up to some metres."""
    return Pose.exp(draw(tangents()))


def random_robot(rng: np.random.Generator, joints: int = 6, convention: str = "standard") -> DhRobot:
    """An arm with every feature that a table can have: signs, coupling, β, poses before and after the chain."""
    coupling = np.eye(joints)
    if joints > 2:
        coupling[2, 1] = rng.uniform(-1, 1)
    return DhRobot.from_dh(
        rng.uniform(-np.pi, np.pi, joints),
        rng.uniform(-500, 500, joints),
        rng.uniform(-500, 500, joints),
        rng.uniform(-np.pi, np.pi, joints),
        beta=rng.uniform(-0.1, 0.1, joints),
        sign=rng.choice([-1.0, 1.0], joints),
        coupling=coupling,
        convention=convention,
        T_base_first=Pose.exp(rng.normal(size=6)),
        T_last_hand=Pose.exp(rng.normal(size=6) * [50, 50, 50, 1, 1, 1]),
    )


def six_axis_arm() -> DhRobot:
    """An ordinary industrial arm with ordinary limits."""
    return DhRobot.from_dh(
        np.deg2rad([0, -90, 0, 0, 0, 180]),
        [780, 0, 0, 1142, 0, 200],
        [320, 1075, 200, 0, 0, 0],
        np.deg2rad([-90, 0, -90, 90, -90, 0]),
        min_rad=np.deg2rad([-170, -65, -180, -300, -120, -360]),
        max_rad=np.deg2rad([170, 85, 70, 300, 120, 360]),
    )


def line_sensor(**changes: object) -> Sensor:
    """A line sensor of 120 mm base that looks 22.5° down to the sheet."""
    rotation = nearest_rotation([[0, -0.924, -0.382], [1, 0, 0], [0, -0.382, 0.924]])
    keys: dict[str, object] = {
        "width_px": 1280,
        "height_px": 1024,
        "fx_px": 2300.0,
        "fy_px": 2310.0,
        "cx_px": 640.2,
        "cy_px": 509.8,
        "T_sensor_camera": Pose(rotation, np.array([120.0, 3.0, 5.0])),
        "fan_rad": np.deg2rad(44.0),
        **changes,
    }
    sheet = {k: keys.pop(k) for k in ("origin_mm", "fan_rad") if k in keys}
    return Sensor(Sheet(**sheet), Camera(**keys))  # type: ignore[arg-type]
