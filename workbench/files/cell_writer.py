"""A cell dataset written to a folder; every file appears whole or not at all, cell.toml last."""

from __future__ import annotations

from pathlib import Path

from geometry import Pose, rounded, rounded_number, target_at, toml_value
from jig_cad import Jig, jig_text
from workbench.files.atomic import write_text
from workbench.files.cell import Cell
from workbench.files.robots import robot_text
from workbench.files.sensor_file import sensor_text
from workbench.files.tables import frames_text
from workbench.files.target_file import target_text
from workbench.files.truth_file import write_truth


def write_cell(cell: Cell, folder: Path, decimals: int = 6) -> None:
    """Write ``cell`` into ``folder`` under the usual file names; images and points.csv are the caller's.

    decimals: digits after the point of the joint readings [deg] in frames.csv.
    """
    write_text(folder / "sensor.toml", sensor_text(cell.sensor, cell.emulator))
    for name, text in target_files(cell).items():
        write_text(folder / name, text)
    write_text(folder / "robot.toml", robot_text(cell.arm))
    write_text(folder / "frames.csv", frames_text(cell.frames, decimals))
    if cell.truth is not None:
        write_truth(folder / "truth.json", cell.truth)
    write_text(folder / "cell.toml", cell_text(cell))


def target_files(cell: Cell) -> dict[str, str]:
    """File names and texts of the cell's targets, in their order."""
    if isinstance(cell.target, Jig):
        return {"jig.toml": jig_text(cell.target)}
    if len(cell.targets) == 1:
        return {"target.toml": target_text(cell.targets[0])}
    return {f"target_{k + 1}.toml": target_text(t) for k, t in enumerate(cell.targets)}


def cell_text(cell: Cell) -> str:
    """The text of cell.toml."""
    lines = ["# a cell: which jig location each frame saw, with the joint readings, is in frames.csv"]
    lines += [f"name = {toml_value(cell.name)}"] if cell.name else []
    files = list(target_files(cell))
    named = 'jig = "jig.toml"' if files == ["jig.toml"] else f"target = {toml_value(files[0])}"
    lines += ['sensor = "sensor.toml"', named, 'robot = "robot.toml"', 'frames = "frames.csv"']
    lines += ["[scp_initial]       # T_hand_sensor by design: rotations about fixed X, Y, Z (R = Rz Ry Rx)"]
    design = cell.design
    lines += [f"rotation_deg = {_numbers(design.fixed_xyz_deg)}", f"translation_mm = {_numbers(design.t)}"]
    lines += ["[mount]", f"sensor = {toml_value(cell.mount)}"] if cell.mount != "hand" else []
    for name, pose in cell.T_base_jig.items():
        key = "T_hand_jig" if cell.mount == "fixed" else "T_base_jig"
        lines += [f"[locations.{toml_value(name)}]", f"{key} = {_matrix(pose)}"]
        if len(files) > 1:
            lines += [f"target = {toml_value(files[cell.targets.index(target_at(cell.target, name))])}"]
    return "\n".join(lines) + "\n"


def _numbers(values: object) -> str:
    return "[" + ", ".join(repr(rounded_number(float(v))) for v in values) + "]"  # type: ignore[attr-defined]


def _matrix(pose: Pose) -> str:
    return toml_value(rounded(pose.matrix, "T_base_jig"))
