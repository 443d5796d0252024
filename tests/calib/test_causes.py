"""What spoils a whole data set of unlabelled points is named by file and column: place, units, columns, jig."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest

from calib import calibrate
from calib.synthetic.cell import CellFrames, Noise, SyntheticCell, made_cell, observe, random_cell
from calib.synthetic.problem import CALIBRATE_ONLY
from geometry import AxisPoints, DhRobot, Frame, Pose, SurfacePoints, exp_so3
from jig_cad import Jig
from tests.pinned import pinned

PIXEL_SIGMA = 0.2


@dataclass(frozen=True, eq=False)
class Files:
    """What a user gives."""

    frames: tuple[Frame, ...]
    jig: Jig
    robot: DhRobot
    design: Pose


@pytest.fixture(scope="module")
def files() -> Files:
    rng = np.random.default_rng(4)
    # spots are put on the axes themselves: strings of no thickness
    cell = random_cell(rng, CALIBRATE_ONLY, Jig.nominal(string_diameter_mm=1e-3))
    seen = observe(cell, made_cell(cell, rng, Noise()), rng, Noise())
    frames = tuple(_unlabelled(f) for f in seen.frames)
    return Files(frames, cell.jig, cell.robot, seen.design)


def _unlabelled(f: Frame) -> Frame:
    """The frame's points as spots without names, those of the last string first."""
    yz, n = f.axis.yz_mm[::-1], len(f.axis)
    order = np.arange(n)[::-1]
    points = SurfacePoints(
        np.zeros((n, 2)),
        np.broadcast_to(PIXEL_SIGMA**2 * np.eye(2), (n, 2, 2)),
        yz,
        f.axis.cov_yz_mm2[order],
        np.full(n, 0.9),
        ("",) * n,
        np.zeros(n),
        np.ones((n, 2)),
        np.full(n, np.nan),  # as of a points.csv
    )
    return replace(f, points=points, axis=AxisPoints.empty(), labels_given=False)


def _turned(files: Files, rotvec_deg: list[float]) -> Files:
    return replace(files, design=files.design @ Pose(exp_so3(np.deg2rad(rotvec_deg)), np.zeros(3)))


def _hands(files: Files, times: float) -> Files:
    def posed(f: Frame) -> Frame:
        T = files.robot.pose(np.asarray(f.joints_rad))
        return replace(f, joints_rad=None, T_base_hand=Pose(T.R, T.t * times))

    return replace(files, frames=tuple(map(posed, files.frames)))


def _points(files: Files, change: Callable[[np.ndarray], np.ndarray]) -> Files:
    def changed(f: Frame) -> Frame:
        return replace(f, points=replace(f.points, yz_mm=change(f.points.yz_mm)))

    return replace(files, frames=tuple(map(changed, files.frames)))


def _sized(jig: Jig, side: float, height: float) -> Jig:
    return Jig.nominal(jig.side_mm * side, jig.height_mm * height, jig.string_diameter_mm, strings=jig.strings)


def _table(robot: DhRobot, times: float) -> DhRobot:
    return replace(robot, d=robot.d * times, a=robot.a * times)


def _rows(files: Files, order: Sequence[int], places: bool = False) -> Files:
    """Every image with the readings of another row; the names of places with the readings or with the images."""

    def changed(f: Frame, k: int) -> Frame:
        other = files.frames[k]
        return replace(f, joints_rad=other.joints_rad, location=other.location if places else f.location)

    return replace(files, frames=tuple(changed(f, k) for f, k in zip(files.frames, order, strict=True)))


SPOILT: dict[str, Callable[[Files], Files]] = {
    "half a turn off, 179° about z of the sensor: the sensor is mounted the other way round (a roll of 180°)": (
        lambda f: _turned(f, [0, 0, 180])
    ),
    "about x of the sensor": lambda f: _turned(f, [180, 0, 0]),
    "a quarter turn about z": lambda f: _turned(f, [0, 0, 90]),
    "x_mm, y_mm, z_mm of frames.csv hold metres": lambda f: _hands(f, 1e-3),
    "x_mm, y_mm, z_mm of frames.csv hold inches": lambda f: _hands(f, 1 / 25.4),
    "y_mm, z_mm of points.csv are metres": lambda f: _points(f, lambda yz: yz * 1e-3),
    "y and z of the points are exchanged": lambda f: _points(f, lambda yz: yz[:, ::-1]),
    "side_mm with height_mm of jig.toml is in centimetres": lambda f: replace(f, jig=_sized(f.jig, 0.1, 0.1)),
    "its side_mm is about 100, not 90": lambda f: replace(f, jig=_sized(f.jig, 0.9, 1.0)),
    "d_mm and a_mm of robot.toml hold metres": lambda f: replace(f, robot=_table(f.robot, 1e-3)),
    "different orders: one of them stands the other way round, last first": (
        lambda f: _rows(f, range(len(f.frames))[::-1])
    ),
    "different orders: one of them stands sorted as text": (
        lambda f: _rows(f, sorted(range(len(f.frames)), key=str), places=True)
    ),
    "are not each other's rows: the image of frame 0 goes with the readings of frame 8, 1 with 9": (
        lambda f: _rows(f, np.roll(np.arange(len(f.frames)), 8))
    ),
    'the table of robot.toml is convention = "standard"': lambda f: replace(
        f, robot=replace(f.robot, convention="modified")
    ),
}


@pytest.mark.parametrize("words", SPOILT)
def test_the_file_and_its_fault_are_named(words: str, files: Files, default: CellFrames) -> None:
    f = SPOILT[words](files)
    result = calibrate(f.frames, f.jig, f.robot, default.sensor, f.design)
    pinned(result)
    assert not result.verdict.trustworthy
    named = result.verdict.text.split("In all")[0].replace("177°", "179°").replace("178°", "179°")
    assert words in named


@pytest.fixture(scope="module")
def default() -> CellFrames:
    rng = np.random.default_rng(4)
    cell: SyntheticCell = random_cell(rng, CALIBRATE_ONLY)
    return observe(cell, cell, rng, Noise())


def test_sound_frames_without_names_are_answered(files: Files, default: CellFrames) -> None:
    assert calibrate(files.frames, files.jig, files.robot, default.sensor, files.design).verdict.code == "ok"
