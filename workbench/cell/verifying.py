"""An SCP judged on a dataset, without solving: a result's, or the design's."""

from __future__ import annotations

from dataclasses import replace

from calib import CalibConfig, Verification, verify
from geometry import InputError, Pose
from workbench.cell.pipeline import Observed
from workbench.files import Cell, SavedResult, sha256_of


def verify_cell(cell: Cell, observed: Observed, saved: SavedResult | None, config: CalibConfig) -> Verification:
    """The figures of a result's SCP on a dataset, or of [scp_initial].

    Parameters
    ----------
    cell, observed
        The dataset and its frames as `observe` measured them.
    saved
        The result whose SCP is judged; None: the design's.
    config
        Of labelling.

    Returns
    -------
    Verification

    Raises
    ------
    InputError
        Where the result has no SCP, or belongs to another sensor.toml.

    """
    T, words = (cell.design, "the SCP judged is [scp_initial]") if saved is None else scp_of(cell, saved)
    found = verify(
        observed.frames,
        cell.target,
        cell.robot,
        cell.sensor,
        T,
        cell.T_base_jig,
        config,
        cell.T_hand_sensor_design,
        cell.mount,
    )
    return replace(found, notes=(words, *cell.remarks, *observed.remarks, *found.notes))


def scp_of(cell: Cell, saved: SavedResult) -> tuple[Pose, str]:
    """The SCP that goes with the cell's robot file, and which it is, in words."""
    theirs = saved.hashes.get("sensor")
    if theirs and cell.sensor_path is not None and theirs != sha256_of(cell.sensor_path):
        raise InputError(
            f"{saved.path}: its SCP belongs to another sensor.toml (SHA-256 {theirs[:12]}…) than {cell.sensor_path}: "
            "calibrate with this one, or verify with the sensor.toml of that calibration"
        )
    same_table = cell.robot_path is not None and saved.hashes.get("robot") == sha256_of(cell.robot_path)
    if saved.nominal is not None and saved.nominal.T_hand_sensor is not None and same_table:
        return (
            saved.nominal.T_hand_sensor,
            f"the SCP judged is T_hand_sensor_nominal of {saved.path}: the robot's file is the nominal one",
        )
    if saved.solved.T_hand_sensor is None:
        raise InputError(f"{saved.path}: holds no SCP (verdict {saved.verdict}): calibrate again")
    return saved.solved.T_hand_sensor, f"the SCP judged is T_hand_sensor of {saved.path}"
