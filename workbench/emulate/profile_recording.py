"""Recording a cell in emulation as a profile sensor would: files in a maker's format, with truth."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from calib.mount import chain_of
from geometry import DH_ROWS, Arm, Frame, InputError, Pose, Sensor, Target, target_at
from geometry.sensor import AUTO
from jig_cad import Jig, sample_tolerance
from workbench.emulate.recording import READING_DECIMALS, Configuration
from workbench.emulate.sheet_profile import profile_sensor, profiler, sheet_profile
from workbench.files import Cell, Truth, TruthFrame, write_cell
from workbench.profiles import SUFFIXES, WRITERS, Told, fitting_unit, write_scan_lines

Progress = Callable[[int, int], None]
_IN_COUNTS = "keyence_lj_x"  # whose files do not tell their unit


def record_profiles(
    folder: Path,
    cell: Cell,
    true_arm: Arm,
    T_hand_sensor: Pose,
    configurations: Sequence[Configuration],
    form: str,
    seed: int,
    built: bool = True,
    progress: Progress | None = None,
) -> Cell:
    """Write every configuration's profile into ``folder`` as a dataset with truth.json.

    Parameters
    ----------
    folder
        Made where it is not there.
    cell
        What a user knows; a sensor with a camera becomes one that gives profiles of the same field.
    true_arm, T_hand_sensor
        What stands behind the profiles.
    configurations
        One a frame.
    form
        A format that can be written; "auto" is the sensor's own, or csv.
    seed
        The same seed gives the same bytes.
    built
        Whether a jig's anchors are drawn within their tolerance.
    progress
        Told the frames done and the frames in all.

    Returns
    -------
    Cell
        The dataset as it stands in the folder.

    Raises
    ------
    InputError
        Where the format can not be written or a target not be emulated.

    """
    asked = cell.sensor.profile.format if form == AUTO and cell.sensor.profile is not None else form
    name = "csv" if asked == AUTO else asked
    if name not in WRITERS:
        raise InputError(f'profiles can not be written as "{name}"; {", ".join(WRITERS)} can')
    sensor = _counting(profile_sensor(cell.sensor, name), name)
    what = profiler(sensor)
    targets = _as_built(cell.target, np.random.default_rng([seed, 2**30]), built)
    rows, frames = [], []
    for i, c in enumerate(configurations):
        T_base_sensor = chain_of(cell.mount, true_arm).pose(c.true_rad) @ T_hand_sensor
        T_sensor_target = T_base_sensor.inverse() @ cell.T_base_jig[c.location]
        line = sheet_profile(what, target_at(targets, c.location), T_sensor_target, np.random.default_rng([seed, i]))
        path = f"profiles/{c.frame:03d}{SUFFIXES[name]}"
        told = Told(name, what.output.pitch_mm, float(what.y_mm[0]), what.output.unit)
        write_scan_lines(folder / path, [line], told)
        rows.append(Frame(c.frame, c.location, c.role, c.reading_rad, profile=path))
        frames.append(TruthFrame(frame=c.frame, T_sensor_jig=T_sensor_target.matrix.tolist(), points=()))
        if progress:
            progress(i + 1, len(configurations))
    truth = _truth(cell, targets, true_arm, T_hand_sensor, frames)
    done = replace(cell, folder=folder, sensor=sensor, frames=tuple(rows), truth=truth)
    write_cell(done, folder, READING_DECIMALS)
    return done


def _counting(sensor: Sensor, form: str) -> Sensor:
    """The sensor with the unit of its counts, where the format has them: one for all files, that holds the field."""
    output = sensor.profile
    if output is None or form != _IN_COUNTS or output.unit is not None:
        return sensor
    return replace(sensor, profile=replace(output, unit=fitting_unit(output.require_field_of_view()[:, 1])))


def _as_built(
    target: Target | Mapping[str, Target], rng: np.random.Generator, built: bool
) -> Target | Mapping[str, Target]:
    if built and isinstance(target, Jig) and not target.measured:
        return sample_tolerance(target, rng)
    return target


def _truth(
    cell: Cell, targets: Target | Mapping[str, Target], arm: Arm, T: Pose, frames: Sequence[TruthFrame]
) -> Truth:
    table = arm.dh_part()
    columns = {row.file_key: row.to_file(getattr(table, row.column)) for row in DH_ROWS}
    anchors = {}
    if isinstance(targets, Jig):
        anchors = {a: tuple(p) for a, p in zip(targets.anchors, targets.anchors_mm.tolist(), strict=True)}
    return Truth(
        T_hand_sensor=T.matrix.tolist(),
        dh=[{key: float(column[i]) for key, column in columns.items()} for i in range(table.n_joints)],
        anchors_mm=anchors,
        locations={name: pose.matrix.tolist() for name, pose in cell.T_base_jig.items()},
        frames=tuple(frames),
    )
