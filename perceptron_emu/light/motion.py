"""The sensor on its way: what the chip sees at the moments of one exposure."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from geometry import Pose
from perceptron_emu.config import EmulatorConfig
from perceptron_emu.scene import Scene

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Moment:
    """A part of the exposure.

    Parameters
    ----------
    drift : Pose or None
        How the scene stands in {P} then, T_then = drift @ T; None where it stands still.
    rows : Array
        Share of the part that each row of the chip takes (H,).
    """

    drift: Pose | None
    rows: Array


def moments(config: EmulatorConfig, height_px: int) -> list[Moment]:
    """The exposure as equal parts, each at its middle; one alone where nothing moves.

    The sensor moves by Exp(ξ t) in its own axes, so the scene stands at Exp(−ξ t) then, t = 0 at mid-exposure of the
    middle row. A global shutter gives every row the same share of every part; with a rolling one row v is open for the
    exposure time about t_v = (v − (H − 1)/2) · row_time.

    Parameters
    ----------
    config : EmulatorConfig
        Its motion and exposure.
    height_px : int
        Rows H of the chip.

    Returns
    -------
    list of Moment
        In order of time.
    """
    velocity = np.array([*config.motion.velocity_mm_s, *np.deg2rad(config.motion.angular_deg_s)])
    if not np.any(velocity):
        return [Moment(None, np.ones(height_px))]
    time_s, n = config.exposure.time_ms * 1e-3, config.motion.samples
    rolling = config.exposure.shutter == "rolling"
    delay_s = config.exposure.row_time_us * 1e-6 * (np.arange(height_px) - (height_px - 1) / 2) * rolling
    span_s = time_s + (delay_s[-1] - delay_s[0])
    # as many parts more as the shutter's run is longer than one exposure
    n = int(np.ceil(n * span_s / time_s))
    edges = np.linspace(-span_s / 2, span_s / 2, n + 1)
    out = []
    for start, end in pairwise(edges):
        open_, close = delay_s - time_s / 2, delay_s + time_s / 2
        share = np.maximum(np.minimum(end, close) - np.maximum(start, open_), 0) / time_s
        out.append(Moment(Pose.exp(-velocity * (start + end) / 2), share))
    return out


def moved(scene: Scene, drift: Pose | None) -> Scene:
    """The scene with everything in it moved.

    Parameters
    ----------
    scene : Scene
        As it stands at mid-exposure.
    drift : Pose or None
        In {P}; None moves nothing.

    Returns
    -------
    Scene
        Before the same sensor.
    """
    if drift is None:
        return scene
    solids = tuple(replace(s, T_sensor_mesh=drift @ s.T_sensor_mesh) for s in scene.solids)
    return replace(scene, T_sensor_jig=drift @ scene.T_sensor_jig, solids=solids)
