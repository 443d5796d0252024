"""A dataset calibrated in one call: what the command `calibrate` does, for scripts and notebooks."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from calib import CalibrationResult
from geometry import json_text
from workbench.cell import Observed, ProfileSettings, Progress, observe, solve
from workbench.files import Cell, Settings, read_cell, read_settings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, eq=False)
class CalibratedCell:
    """A dataset, its frames as measured, and the answer; ``print`` shows it on a screen."""

    cell: Cell
    observed: Observed
    result: CalibrationResult
    settings: Settings

    def __str__(self) -> str:
        """The answer on a screen."""
        return str(self.result)

    def as_object(self) -> dict[str, Any]:
        """The object of ``calibrate --json``, with the files and their hashes."""
        from workbench.report import calibration_object

        return calibration_object(self.result, self.observed.complaints, self.cell)

    def to_json(self) -> str:
        """The same as text."""
        return json_text(self.as_object())

    def save(self, folder: str | Path) -> None:
        """Write what ``calibrate --out`` writes: result.json, points.csv, fig7.png, the settings, the robot."""
        from workbench.report import write_results

        write_results(Path(folder), self.cell, self.observed, self.result, self.settings)

    def report(self, path: str | Path) -> str:
        """Write the HTML report, one file; why it has no picture of the cell, "" where it has one."""
        from workbench.report import ReportInput, cell_image, write_report

        picture, remark = cell_image(self.cell, self.result)
        write_report(Path(path), ReportInput(self.cell, self.observed, self.result, self.settings, picture))
        return remark

    def plot(self) -> Figure:
        """The paper's Fig. 7: distance deviations of every location, by design and as solved."""
        from workbench.report import draw_fig7

        return draw_fig7(self.result)


def calibrate_cell(
    dataset: str | Path | Cell, settings: Settings | None = None, progress: Progress | None = None
) -> CalibratedCell:
    """Measure every frame of a dataset and solve the sensor centre position.

    Parameters
    ----------
    dataset
        Folder of a cell dataset, its cell.toml, or a cell that was read.
    settings
        Of extraction and calibration, as ``workbench.files.read_settings`` gives them; None: the defaults.
    progress
        Told the frames done and the frames in all.

    Returns
    -------
    CalibratedCell

    Raises
    ------
    InputError
        Where the files can not be used; the sentence names file and key.

    """
    cell = dataset if isinstance(dataset, Cell) else read_cell(Path(dataset))
    told = settings or read_settings([])
    observed = observe(cell, told.extraction, progress, ProfileSettings.of(told))
    return CalibratedCell(cell, observed, solve(cell, observed, told.calib), told)
