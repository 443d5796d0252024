"""How well a given SCP predicts frames that it was not solved from: places are fitted, nothing else."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib.answer import LEAST_FRAMES, figured, location_pose, measured
from calib.config import CalibConfig
from calib.copies import copy_notes, in_order, without_copies
from calib.figures import OffsetsFromTarget, agreeing_pose, fit_location
from calib.hands import chain_poses, placed, with_joints
from calib.label import label_frames, relabel
from calib.mount import Mount, chain_of, seen_from
from calib.result import LocationResult
from calib.stages import by_target
from calib.surface import begin_on_surfaces
from geometry import Frame, InputError, Pose, Robot, Sensor, SheetPoints, State, Target, locations_of, target_at


@dataclass(frozen=True, eq=False)
class Verification:
    """The figures of an SCP on frames of any role.

    Parameters
    ----------
    T_hand_sensor, T_hand_sensor_design : Pose
        The SCP that was judged, and the one that the cell started from.
    locations : dict of str to LocationResult
        ``solved`` figures are those of the judged SCP.
    frames : tuple of Frame
        Labelled, with residuals, or the reason why not.
    left_out_mm : dict of str to float or None
        By location, the rms distance of the points of a frame from the target as its other frames place it, every
        frame left out in turn; None for fewer than three frames.
    notes : tuple of str
    """

    T_hand_sensor: Pose
    T_hand_sensor_design: Pose
    locations: dict[str, LocationResult]
    frames: tuple[Frame, ...]
    left_out_mm: dict[str, float | None]
    notes: tuple[str, ...] = ()

    @property
    def largest_rms_mm(self) -> float | None:
        """The largest point rms of a location; None where there is none to judge by."""
        known = [p.point_rms_mm.solved for p in self.locations.values() if p.point_rms_mm.solved is not None]
        return max(known, default=None)


def verify(
    frames: Sequence[Frame],
    target: Target | Mapping[str, Target],
    robot: Robot | None,
    sensor: Sensor,
    T_hand_sensor: Pose,
    places: Mapping[str, Pose] | None = None,
    config: CalibConfig | None = None,
    T_hand_sensor_design: Pose | None = None,
    mount: Mount = "hand",
) -> Verification:
    """Judge an SCP on frames without solving for it: every location's place is fitted, its points' distances remain.

    Parameters
    ----------
    frames : sequence of Frame
        As for `calibrate`; their roles do not matter.
    target : Target or mapping of str to Target
        What was measured, or by location.
    robot : Robot or None
        That the SCP goes with; None where every frame has T_base_hand.
    sensor : Sensor
    T_hand_sensor : Pose
        The SCP to be judged.
    places : mapping of str to Pose, optional
        T_base_target of locations where it is known; it then decides between symmetric poses.
    config : CalibConfig, optional
    T_hand_sensor_design : Pose, optional
        For the ``design`` figures; by default the same.
    mount : "hand" or "fixed"
        As for `calibrate`.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        Where the input can not be used at all.
    """
    if not frames:
        raise InputError("the dataset has no frames")
    settings, known = config or CalibConfig(), places or {}
    joined = seen_from(mount, with_joints(in_order(frames), robot))
    robot = chain_of(mount, robot)
    given = without_copies(placed(joined, robot))
    chain, design = (T_hand_sensor, robot), (T_hand_sensor_design or T_hand_sensor, robot)
    begun = begin_on_surfaces(given, target, robot, T_hand_sensor, settings)
    given, target, stands = begun.frames, begun.target, {**begun.places, **known}
    labelled = by_target(
        target, lambda t, group: label_frames(group, t, sensor, T_hand_sensor, stands, settings), given
    )
    if any(not f.labels_given for f in given):
        named = locations_of(labelled).items()
        found = {n: T for n, g in named if (T := location_pose(g, target_at(target, n), chain)) is not None}
        labelled = by_target(
            target,
            lambda t, before, fresh: relabel(before, fresh, t, sensor, T_hand_sensor, found, known, settings),
            labelled,
            given,
        )
    locations, done, left_out = dict[str, LocationResult](), dict[int, Frame](), dict[str, float | None]()
    for name, group in locations_of(labelled).items():
        here = target_at(target, name)
        locations[name], answered = figured(group, here, design, chain)
        done |= {f.number: f for f in answered}
        left_out[name] = _left_out(group, here, T_hand_sensor, robot)
    ordered = tuple(done[f.number] for f in labelled)
    return Verification(T_hand_sensor, design[0], locations, ordered, left_out, copy_notes(labelled))


def _left_out(group: Sequence[Frame], target: Target, T_hand_sensor: Pose, robot: Robot | None) -> float | None:
    """Rms distance [mm] of every frame's points from the target as the other frames of the location place it."""
    usable = measured(group)
    if len(usable) < LEAST_FRAMES:
        return None
    points = SheetPoints.of([f.axis for f in usable], target.features)
    sensors = chain_poses(usable, robot) @ T_hand_sensor
    start = agreeing_pose([sensors[i] @ f.candidates for i, f in enumerate(usable)])[0]
    squares, every = [], np.arange(len(usable))
    for i in range(len(usable)):
        others = every[every != i]
        place = fit_location(points[others], sensors[others], target, start).T_base_target
        seen = points.present[i]
        term = OffsetsFromTarget((sensors[i] @ points.xyz_mm[i])[seen], points.feature[i][seen], target)
        squares.append(np.sum(term.residual(State({"target": place})) ** 2, axis=-1))
    return float(np.sqrt(np.mean(np.concatenate(squares))))
