"""The paper's experiment as an ensemble."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.table import Table

from workbench.console import say_on_stdout, standard_output

if TYPE_CHECKING:
    from calib.paper_ensemble import EnsembleRow

PAPER_MM = {"design": 5.0, "paper": 1.4}  # Fig. 7's largest deviations as printed


def command(
    runs: Annotated[int, typer.Option(min=1, help="Cells to draw and calibrate.")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all that is drawn.")] = 1,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Repeat the paper's experiment with errors drawn anew: Table 1 and Fig. 7 with spreads, and what explains them."""
    from calib.paper_ensemble import paper_ensemble
    from workbench.console import progress_bar
    from workbench.results.as_json import json_text

    with progress_bar("calibrating", runs) as progress:
        rows = paper_ensemble(np.random.default_rng(seed), runs, progress=progress)
    if as_json:
        say_on_stdout(json_text(_object(rows)))
    else:
        _show(rows)


def _object(rows: tuple[EnsembleRow, ...]) -> dict[str, Any]:
    from calib.paper_ensemble import METHODS, SOURCES, largest_deviations

    deviations = {source: {m: largest_deviations(rows, source, m) for m in ("design", *METHODS)} for source in SOURCES}
    return {"max_deviation_mm": deviations, "as_printed_mm": PAPER_MM}


def _show(rows: tuple[EnsembleRow, ...]) -> None:
    from calib.paper_ensemble import METHODS, SOURCES, largest_deviations

    console = standard_output()
    table = Table(
        "errors drawn", "design", *METHODS, title="Fig. 7: largest deviation in mm, mean ± spread of the runs"
    )
    for source in SOURCES:
        cells = [_spread(largest_deviations(rows, source, m)) for m in ("design", *METHODS)]
        table.add_row(source, *cells)
    table.add_row("the paper, as printed", f"{PAPER_MM['design']:.1f}", f"{PAPER_MM['paper']:.1f}", "", "")
    console.print(table)
    scp = Table("method", "rotation about X, Y, Z, deg", "translation, mm", title="Table 1: mean ± spread, all sources")
    for method in METHODS:
        poses = [r.T_hand_sensor for r in rows if r.source == "all sources" and r.method == method]
        known = [p for p in poses if p is not None]
        if known:
            angles, shifts = np.array([p.fixed_xyz_deg for p in known]), np.array([p.t for p in known])
            scp.add_row(method, ", ".join(_spread(a, 4) for a in angles.T), ", ".join(_spread(a, 3) for a in shifts.T))
    scp.add_row("truth", "-1.5241, 1.5871, 22.5287", "-16.8786, -75.5423, 116.5369")
    console.print(scp)


def _spread(values: np.ndarray, digits: int = 2) -> str:
    if not len(values):
        return "none"
    return f"{np.mean(values):.{digits}f} ± {np.std(values):.{digits}f}"
