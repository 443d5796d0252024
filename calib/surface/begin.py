"""Frames on surfaces made ready: their points named, shapes and places begun, the SCP found without a drawing."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.bundle import make_bundle
from calib.config import CalibConfig
from calib.surface.condense import condensed
from calib.surface.constellation import with_names
from calib.surface.faces import exchanged
from calib.surface.starts import SurfaceStart, begun, surface_start
from geometry import AxisPoints, Frame, Pose, Robot, Surface, Target, target_at
from jig_cad import Wedge

Targets = Target | Mapping[str, Target]


@dataclass(frozen=True, eq=False)
class Begun:
    """What a calibration begins with. found: whether the SCP follows from the data alone, without a design.

    rival: how much larger the χ² of the next best SCP that follows from them is. beyond_drawing: whether so few frames
    lead to one that is farther from the design than a drawing is from its part.
    """

    frames: tuple[Frame, ...]
    target: Targets
    T_hand_sensor: Pose | None
    places: Mapping[str, Pose]
    found: bool = False
    rival: float = np.inf
    beyond_drawing: bool = False


def begin_on_surfaces(
    frames: Sequence[Frame],
    target: Targets,
    robot: Robot | None,
    design: Pose | None,
    config: CalibConfig,
    search: bool = True,
) -> Begun:
    """The frames with their points on surfaces, and where to begin; frames on strings stay as they are.

    search: whether the data are asked for a start where the design gives none.
    """
    ready = tuple(_on_surface(f, target_at(target, f.location)) for f in frames)
    mine = tuple(f for f in ready if f.usable and len(f.axis) and isinstance(target_at(target, f.location), Surface))
    if not mine:
        return Begun(ready, target, design, {})
    small = condensed(mine, target).frames
    started = _begun(target, small)
    solved = tuple(f for f in small if f.role == "calibrate")
    start: SurfaceStart | None = None
    if solved or design is not None:
        bundle = make_bundle(solved, started, robot, config) if solved else None
        known = config.labelling
        sigma = np.array([known.scp_sigma_mm] * 3 + [np.deg2rad(known.scp_sigma_deg)] * 3)
        start = surface_start(small, started, bundle, design, sigma, search)
    if start is None:
        return Begun(ready, started, design, {})
    named = {
        f.number: dict(zip(f.axis.label, g.axis.label, strict=True)) for f, g in zip(small, start.frames, strict=True)
    }
    ready = tuple(with_names(f, named[f.number]) if f.number in named else f for f in ready)
    return Begun(ready, started, start.T_hand_sensor, start.places, start.found, start.rival, start.beyond_drawing)


def _begun(target: Targets, small: Sequence[Frame]) -> Targets:
    """The targets with shapes begun; one that stands at several locations stays one."""
    if not isinstance(target, Mapping):
        return begun(target, small)
    new = {id(t): begun(t, [f for f in small if target_at(target, f.location) is t]) for t in target.values()}
    return {name: new[id(t)] for name, t in target.items()}


def _in_order_of_y(f: Frame) -> Frame:
    """A frame whose face 1 lies at smaller y: which face that is is told later, by the chain."""
    y = {name: f.axis.yz_mm[[label == name for label in f.axis.label], 0] for name in set(f.axis.label)}
    if len(y) != 2:
        return f
    first, second = sorted(y)
    return exchanged(f) if float(np.mean(y[first])) > float(np.mean(y[second])) else f


def _on_surface(f: Frame, target: Target) -> Frame:
    """All points of a frame on a target of one feature, where nothing else was said of them."""
    if isinstance(target, Wedge) and len(f.axis) and not f.labels_given:
        return _in_order_of_y(f)
    if not isinstance(target, Surface) or len(f.axis) or len(target.features) != 1 or not len(f.points):
        return f
    p, n = f.points, len(f.points)
    axis = AxisPoints(target.features * n, np.arange(n), p.yz_mm, p.cov_yz_mm2, p.flag)
    return replace(f, axis=axis, n_points=f.n_points or n)
