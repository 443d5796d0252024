"""Whole answers kept as they are, numbers and sentences: of sound, wrong and poor cells, by every method and model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from calib import CalibConfig, CalibrationResult, calibrate
from calib.as_json import result_object
from calib.bundle.information import covariances_with, frame_information, observability, scaled, scp_covariance
from calib.configurations import standing
from calib.hands import placed
from calib.judge.culprits import culprit
from calib.judge.culprits_jig import wrong_jig
from calib.label.all_frames import label_frames
from calib.pose.closed_form import closed_forms
from calib.pose.crossing import crossings
from calib.synthetic.boards import BoardNoise, observe_boards, synthetic_sensor
from calib.synthetic.cell import (
    Layout,
    Noise,
    SyntheticCell,
    default_sensor,
    industrial_arm,
    made_cell,
    observe,
    random_cell,
)
from calib.synthetic.problem import made_problem, true_jigs
from calib.synthetic.surfaces import ProfileNoise, observe_surface, surface_cell
from calib.synthetic.views import random_pose
from calib.verify import verify
from geometry import ArmConfiguration, Frame, Pose, stack_poses
from jig_cad import Edge, Jig, Plane, Sphere, Wedge
from tests.pinned import pinned

Frames = tuple[Frame, ...]
Changed = tuple[Frames, Jig, object]


@cache
def _cell() -> tuple[SyntheticCell, Frames]:
    rng = np.random.default_rng(11)
    cell = random_cell(rng, Layout(places=(("A", "calibrate", 6), ("B", "calibrate", 5), ("D", "verify", 4))))
    return cell, observe(cell, made_cell(cell, rng, Noise()), rng, Noise()).frames


def _joints(frames: Frames, change: Callable[[np.ndarray], np.ndarray], only: tuple[int, ...] = ()) -> Frames:
    return tuple(
        replace(f, joints_rad=change(np.asarray(f.joints_rad))) if not only or f.number in only else f for f in frames
    )


def _turned(f: Frame) -> Frame:
    names = tuple(map(Jig.nominal().symmetries[0].relabelled, f.axis.label))
    return replace(f, axis=replace(f.axis, label=names))


def _poses(frames: Frames) -> Frames:
    arm = industrial_arm()
    return tuple(replace(f, joints_rad=None, T_base_hand=arm.pose(f.joints_rad)) for f in frames)


SOUND: dict[str, CalibConfig] = {
    "auto": CalibConfig(),
    "scp": CalibConfig(model="scp"),
    "offsets": CalibConfig(model="scp+offsets"),
    "full": CalibConfig(model="full"),
    "paper": CalibConfig(method="paper"),
}
WRONG: dict[str, Callable[[SyntheticCell, Frames], Changed]] = {
    "a length": lambda c, f: (f, c.jig, c.robot.with_changes(a=[0, 3.0, 0, 0, 0, 0])),
    "another length": lambda c, f: (f, c.jig, c.robot.with_changes(d=[0, 0, 0, -142.0, 0, 0])),
    "a jig's side": lambda c, f: (f, Jig.nominal(side_mm=c.jig.side_mm + 0.6), c.robot),
    "another jig": lambda c, f: (f, Jig.nominal(side_mm=0.8 * c.jig.side_mm), c.robot),
    "radians": lambda c, f: (_joints(f, np.deg2rad), c.jig, c.robot),
    "exchanged": lambda c, f: (_joints(f, lambda q: q[[0, 2, 1, 3, 4, 5]]), c.jig, c.robot),
    "the other way": lambda c, f: (_joints(f, lambda q: q * [1, 1, 1, -1, 1, 1]), c.jig, c.robot),
    "one joint once": lambda c, f: (_joints(f, lambda q: q + 0.02 * np.eye(6)[2], (3,)), c.jig, c.robot),
    "misnamed": lambda c, f: (tuple(replace(x, location="B") if x.number == 2 else x for x in f), c.jig, c.robot),
    "half turns": lambda c, f: (tuple(_turned(x) if x.number in (1, 8) else x for x in f), c.jig, c.robot),
    "copied": lambda c, f: (tuple(replace(f[k - k % 2], number=x.number) for k, x in enumerate(f)), c.jig, c.robot),
    "few": lambda c, f: (f[:3], c.jig, c.robot),
    "one place": lambda c, f: (f[:6], c.jig, c.robot),
    "poses": lambda c, f: (_poses(f), c.jig, None),
    "poses of a table": lambda c, f: (_poses(f), c.jig, c.robot),
    "no points": lambda c, f: (tuple(replace(x, axis=x.axis.empty()) for x in f), c.jig, c.robot),
}
TOLD = ("another length", "another jig", "radians", "exchanged", "the other way", "half turns")
SURFACES = {
    "sphere": Sphere(40.0),
    "sphere of unknown diameter": Sphere(diameter_sigma_mm=np.inf),
    "plane": Plane(),
    "edge": Edge(),
    "wedge": Wedge(80.0),
    "wedge of unknown angle": Wedge(angle_known=False),
}


def _kept(result: CalibrationResult) -> None:
    pinned(result)
    pinned({"printed": str(result), "object": result_object(result, {1: "its image is dark"})})


@pytest.mark.parametrize("name", SOUND)
def test_answers_by_every_model(name: str) -> None:
    cell, frames = _cell()
    _kept(calibrate(frames, cell.jig, cell.robot, default_sensor(), cell.design, config=SOUND[name]))


@pytest.mark.parametrize("name", [n for n in WRONG if n not in TOLD])
def test_what_is_said_of_wrong_data(name: str) -> None:
    cell, frames = _cell()
    given, jig, robot = WRONG[name](cell, frames)
    _kept(calibrate(given, jig, robot, default_sensor(), cell.design))  # type: ignore[arg-type]


@pytest.mark.parametrize("name", [*TOLD, "misnamed"])
def test_what_a_reader_of_the_data_is_told(name: str) -> None:
    cell, frames = _cell()
    given, jig, robot = WRONG[name](cell, frames)
    labelled = label_frames(
        placed(given, robot),
        jig,  # type: ignore[arg-type]
        default_sensor(),
        cell.design,
        {},
        CalibConfig(),
    )
    pinned({"jig": wrong_jig(labelled, jig), "data": culprit(labelled, jig, robot)})  # type: ignore[arg-type]


@pytest.mark.parametrize(("name", "drawn"), [*((n, False) for n in SURFACES), ("sphere", True), ("edge", True)])
def test_answers_on_surfaces(name: str, drawn: bool) -> None:
    rng = np.random.default_rng(5)
    cell = surface_cell(SURFACES[name], rng, (("A", "calibrate", 8), ("B", "calibrate", 8), ("D", "verify", 5)))
    seen = observe_surface(cell, rng, ProfileNoise(), points=60, labelled=False)
    _kept(calibrate(seen.frames, SURFACES[name], cell.robot, seen.sensor, seen.design if drawn else None))


@pytest.mark.parametrize("off_mm", [0.0, 0.5])
def test_what_verifies(off_mm: float) -> None:
    """Strings and a ball by a mounting that is true, and by one that is not."""
    cell, frames = _cell()
    T = cell.T_hand_sensor @ Pose(np.eye(3), np.array([off_mm, 0.0, -off_mm]))
    found = verify(frames, cell.jig, cell.robot, default_sensor(), T, T_hand_sensor_design=cell.design)
    pinned(found)
    pinned(verify(frames[:5], cell.jig, cell.robot, default_sensor(), T, dict(cell.T_base_jig)))
    rng = np.random.default_rng(6)
    ball = surface_cell(Sphere(40.0), rng, (("A", "calibrate", 7),))
    seen = observe_surface(ball, rng, ProfileNoise(), points=60, labelled=False)
    pinned(verify(seen.frames, Sphere(40.0), ball.robot, seen.sensor, ball.T_hand_sensor))


def test_what_views_tell_before_they_are_taken() -> None:
    """One more frame makes the covariance that its information adds; the robot's own errors only widen it."""
    bundle, cell, _ = made_problem(3, Noise())
    jigs = true_jigs(cell)
    for model in ("scp", "full"):
        info = frame_information(bundle, cell.T_hand_sensor, jigs, model)  # type: ignore[arg-type]
        every = np.flatnonzero(info.location == info.location[0])
        base, others = every[:4], every[4:6]
        with_one = covariances_with(info, base, others)
        for k, added in enumerate(others):
            alone = scp_covariance(info, [*base, added])
            np.testing.assert_allclose(with_one[k], alone, rtol=0, atol=1e-9 * np.abs(alone).max())
        noise = scp_covariance(info, base, noise_alone=True)
        assert np.linalg.eigvalsh(scp_covariance(info, base) - noise)[0] > -1e-9 * np.abs(noise).max()
        pinned(
            {
                "one more": with_one,
                "noise": noise,
                "scaled": scaled(noise, 300.0),
                "observed": observability(with_one[0], 5),
                "both": len(info.followed_by(info[base]).location),
            }
        )


def test_closed_forms_are_the_same() -> None:
    rng = np.random.default_rng(2)
    jig = Jig.nominal(115.0, 90.0)
    T = stack_poses([random_pose(rng, jig, d, (2.0, 35.0)) for d in np.linspace(130, 380, 12)])
    yz = crossings(T, jig.starts, jig.directions)[0] + rng.normal(0, 0.02, (12, 5, 2))
    pinned(closed_forms(yz, 115.0, 90.0))


def test_joints_of_a_configuration() -> None:
    arm, rng = industrial_arm(), np.random.default_rng(8)
    found = []
    for c in (
        ArmConfiguration(letters="NUT"),
        ArmConfiguration(letters="FUT", turns=(0, 0, 0)),
        ArmConfiguration(status=2),
        ArmConfiguration(status=6, turn=0),
        ArmConfiguration(quadrants=(0, 0, 0, 0)),
        ArmConfiguration(quadrants=(-1, 0, -1, 0)),
    ):
        for q in rng.uniform(-1, 1, (1, 6)):
            joints = standing(arm, arm.pose(q), c, np.random.default_rng(1))
            found.append(np.zeros(0) if joints is None else joints)
    pinned({"joints": found})


@pytest.mark.parametrize("tilt_deg", [0.0, 5.0])
def test_boards_as_they_are_made(tilt_deg: float) -> None:
    rng = np.random.default_rng(3)
    sensor = synthetic_sensor(rng, tilt_deg)
    views = observe_boards(sensor, rng, 3, step=12, noise=BoardNoise())
    pinned({"sensor": sensor, "views": [[v.corners, v.stripe] for v in views]})
