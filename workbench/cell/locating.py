"""Where the jig stands in a cell that was recorded without saying so: solved from its own frames."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from calib import CalibConfig
from geometry import NoAnswerError
from workbench.cell.pipeline import observe, solve
from workbench.files import Cell


def located(cell: Cell, progress: Callable[[int, int], None] | None = None) -> Cell:
    """The cell with T_base_jig of every place that its frames name, and the SCP that they give, where one is missing.

    Given places are kept. NoAnswerError where the frames give no trustworthy answer.
    """
    missing = {row.location for row in cell.frames} - set(cell.T_base_jig)
    if not missing:
        return cell
    result = solve(cell, observe(cell, None, progress), CalibConfig())
    if not result.verdict.trustworthy or result.T_hand_sensor is None:
        raise NoAnswerError(
            f"{cell.folder / 'cell.toml'}: [locations.NAME] T_base_jig is missing, and the frames do not tell it "
            f"({result.verdict.code}: {result.verdict.text})"
        )
    found = {name: p.T_base_target for name, p in result.locations.items() if p.T_base_target is not None}
    return replace(cell, T_base_jig={**found, **cell.T_base_jig}, T_hand_sensor_design=result.T_hand_sensor)
