"""Views from which a surface does not tell the SCP are refused by their name, with noise and robot errors as built."""

from __future__ import annotations

import numpy as np
import pytest

from calib import CalibConfig, calibrate
from calib.synthetic.cell import TRUTH, industrial_arm
from calib.synthetic.surfaces import ProfileNoise, SurfaceCell, observe_surface
from geometry import Pose, Surface, draw_errors, exp_so3, inverse_kinematics
from jig_cad import Edge, Plane, Sphere, Wedge

FRAMES = 9
PLACES = {"A": (-700.0, 0.3), "B": (0.0, 0.0), "C": (650.0, -0.4)}
LOOKING = np.diag([1.0, -1.0, -1.0])


def _cell(target: Surface, kind: str, rng: np.random.Generator) -> SurfaceCell:
    """Views spoilt in one way; a plane stands at one place alone."""
    robot, joints, location = industrial_arm(), [], []
    places: dict[str, Pose] = {}
    for name, (y, turn) in ({"A": PLACES["A"]} if isinstance(target, Plane) else PLACES).items():
        R = np.array([[0.0, 0.0, -1.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]) @ exp_so3(np.array([0.1, turn, 0.2]))
        places[name] = Pose(R, np.array([1500.0, y, 800.0]))
        found = inverse_kinematics(robot, places[name] @ _views(kind, rng, 60) @ TRUTH.inverse(), rng, max_starts=6)
        count = 2 * FRAMES if isinstance(target, Plane) else FRAMES
        good = found.joints[found.converged][:count]
        assert len(good) == count
        joints += list(good)
        location += [name] * count
    built = robot.corrected(draw_errors(robot, rng))
    roles = ("calibrate",) * len(location)
    return SurfaceCell(target, robot, built, TRUTH, places, tuple(location), roles, np.array(joints))


def _views(kind: str, rng: np.random.Generator, n: int) -> Pose:
    """T_target_sensor."""
    tilt, roll = np.deg2rad(rng.uniform(-30, 30, (n, 2))), np.deg2rad(rng.uniform(-50, 50, n))
    off = np.column_stack([rng.uniform(-12, 12, n), rng.uniform(-15, 15, n), -rng.uniform(275, 305, n)])
    if kind == "translation":
        tilt, roll = np.full((n, 2), 0.15), np.full(n, 0.2)
    if kind == "one axis":
        tilt[:, 1], roll = 0.1, np.zeros(n)
    if kind == "middle":
        off[:, 0] = 0.0
    if kind == "square":
        tilt[:, 1], roll = 0.0, np.zeros(n)
    about_normal = np.zeros(n)
    if kind == "three tilts":
        tilt, about_normal, roll = (
            np.array([[0.3, 0.1], [-0.2, 0.2], [0.1, -0.35]])[np.arange(n) % 3],
            roll,
            np.zeros(n),
        )
    if kind == "tilts about one axis":
        tilt[:, 1], about_normal, roll = 0.0, roll, np.zeros(n)
    nothing = np.zeros((n, 2))
    R = exp_so3(np.column_stack([nothing, about_normal])) @ exp_so3(np.column_stack([tilt, np.zeros(n)])) @ LOOKING
    R = R @ exp_so3(np.column_stack([nothing, roll]))
    return Pose(R, (R @ off[..., None])[..., 0])


@pytest.mark.parametrize("by_design", [True, False])
@pytest.mark.parametrize(
    ("target", "kind", "words"),
    [
        (Sphere(40.0), "translation", "shifted and hardly turned"),
        (Sphere(40.0), "one axis", "one axis only"),
        (Sphere(40.0), "middle", "through its middle"),
        (Plane(), "three tilts", "3 different tilts"),
        (Plane(), "tilts about one axis", "about one axis only"),
        (Edge(), "square", "one axis only|crosses the edge's line square"),
        (Wedge(90.0), "translation", "shifted and hardly turned"),
    ],
)
def test_it_is_refused_by_name_with_what_to_add(target: Surface, kind: str, words: str, by_design: bool) -> None:
    rng = np.random.default_rng(5)
    cell = _cell(target, kind, rng)
    seen = observe_surface(cell, rng, ProfileNoise(), points=60, labelled=False)
    design = seen.design if by_design else None
    result = calibrate(seen.frames, target, cell.robot, seen.sensor, design, config=CalibConfig(model="full"))
    assert not result.verdict.trustworthy
    assert result.T_hand_sensor is None
    assert result.covariance is None
    assert any(w in result.verdict.text for w in words.split("|")), result.verdict.text
    assert "add poses" in result.verdict.text
