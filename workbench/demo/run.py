"""The demo from start to end: record, extract, calibrate, compare with what is true and with the paper."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractContextManager
from dataclasses import dataclass
from pathlib import Path

from calib import CalibrationResult
from geometry import Frame
from workbench.cell import Observed, label_dataset, observe, solve
from workbench.emulate import paper_experiment, record
from workbench.files import Cell, Settings, read_cell, read_image, write_png
from workbench.report import ReportInput, cell_image, save_overlays, write_report, write_results

PICTURE_COMPRESSION = 6
Bar = Callable[[str, int], AbstractContextManager[Callable[[int, int], None]]]


@dataclass(frozen=True, eq=False)
class DemoResult:
    """What the demo shows.

    remark: what could not be drawn, and why.
    """

    cell: Cell
    observed: Observed
    result: CalibrationResult
    remark: str = ""


def run_demo(out: Path, seed: int, settings: Settings, bar: Bar) -> DemoResult:
    """Record the experiment into ``out`` and calibrate it by the same path as recorded data."""
    with bar("planning", 1):
        experiment = paper_experiment(seed)
    with bar("rendering", len(experiment.configurations)) as progress:
        record(out, experiment.cell, experiment.true, experiment.configurations, seed, progress)
    cell = read_cell(out)
    with bar("extracting", len(cell.frames)) as progress:
        observed = observe(cell, settings.extraction, progress)
    with bar("calibrating", 1):
        result = solve(cell, observed, settings.calib)
        write_results(out, cell, observed, result, settings)
    tables = label_dataset(cell, observed, settings.calib, result)
    with bar("report", 1):
        picture, remark = cell_image(cell, result)
        if picture is not None:
            write_png(out / "cell.png", picture[..., ::-1], PICTURE_COMPRESSION)
        write_report(out / "report.html", ReportInput(cell, observed, result, settings, picture))
    with bar("overlays", len(tables)) as progress:
        _overlays(out / "overlays", cell, tables, progress)
    return DemoResult(cell, observed, result, remark)


def _overlays(folder: Path, cell: Cell, tables: tuple[Frame, ...], progress: Callable[[int, int], None]) -> None:
    def one(table: Frame) -> Path:
        image = read_image(cell.folder / table.image, cell.sensor)
        return save_overlays(folder, image, cell.sensor, table)

    with ThreadPoolExecutor(2) as pool:
        for done, _ in enumerate(pool.map(one, tables), start=1):
            progress(done, len(tables))
