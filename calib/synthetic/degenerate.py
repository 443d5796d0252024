"""Synthetic frames that allow no answer: mirror images that nothing resolves, a lever that stands still."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from calib.synthetic.cell import CellFrames, Noise, SyntheticCell, axis_points, default_sensor
from geometry import AxisPoints, Frame, Pose, cross_plane_x0, exp_so3, stack_poses

Array = NDArray[np.float64]

_MIRROR_POINT_MM = 0.5  # poor spots: sharp ones tell the mirrors apart by the little that the pitch varies
_PITCH_DEG, _PITCH_STEP_DEG = 20.0, 0.7


def mirror_frames(cell: SyntheticCell, rng: np.random.Generator, noise: Noise, frames: int = 3) -> CellFrames:
    """Frames of one location that see B' and C' at equal height, turned in the sheet and hardly out of it.

    Turned in the sheet alone, the frames' mirror images agree with one another as well as the true poses do. A second
    axis beyond the least that is asked for would tell them apart.
    """
    height = cell.jig.height_mm / 2
    pivot = np.array([height, 0.0, np.sqrt(3) / 2 * cell.jig.side_mm / 2])  # between B' and C'
    roll = np.linspace(-30.0, 30.0, frames) + rng.uniform(-3, 3, frames)
    step = _PITCH_STEP_DEG * (np.arange(frames) % 2 * 2 - 1)
    Rs = [
        exp_so3(np.deg2rad([r, 0.0, 0.0])) @ exp_so3(np.deg2rad([0.0, _PITCH_DEG + s, 0.0]))
        for r, s in zip(roll, step, strict=True)
    ]
    Ts = stack_poses([Pose(R, np.array([0.0, 0.0, 290.0]) - R @ pivot) for R in Rs])
    return _observed(cell, Ts, rng, replace(noise, point_mm=_MIRROR_POINT_MM))


def constant_lever(cell: SyntheticCell, rng: np.random.Generator, noise: Noise, frames: int = 7) -> CellFrames:
    """Frames of one location in which the jig turns about its own origin, which the sensor sees at one place."""
    found: list[Pose] = []
    pivot = np.array([-cell.jig.height_mm / 2, 0.0, 240.0])
    while len(found) < frames:
        T = Pose(exp_so3(np.deg2rad(rng.uniform(-20, 20, 3))), pivot)
        fraction = cross_plane_x0(T @ cell.jig.starts, (cell.jig.ends - cell.jig.starts) @ T.R.T)[1]
        if np.all((fraction > 0.05) & (fraction < 0.95)):
            found.append(T)
    return _observed(cell, stack_poses(found), rng, noise)


def _observed(cell: SyntheticCell, Ts_sensor_jig: Pose, rng: np.random.Generator, noise: Noise) -> CellFrames:
    """Noisy labelled points of frames at one location, with their hand poses as exactly known."""
    jig = cell.T_base_jig["A"]
    hands = jig @ Ts_sensor_jig.inverse() @ cell.T_hand_sensor.inverse()
    yz = axis_points(Ts_sensor_jig, cell.jig)
    yz = yz + rng.normal(size=yz.shape) * noise.point_mm
    covariance = np.broadcast_to(np.eye(2) * noise.point_mm**2, (yz.shape[1], 2, 2))
    spot, labels = np.full(yz.shape[1], -1), cell.jig.strings
    frames = tuple(
        Frame(
            i,
            "A",
            T_base_hand=hands[i],
            axis=AxisPoints(labels, spot, yz[i], covariance, ("",) * len(labels)),
            labels_given=True,
        )
        for i in range(len(yz))
    )
    return CellFrames(frames, default_sensor(), cell.design)
