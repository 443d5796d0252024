"""What the demo prints: Table 1 and Fig. 7 beside the paper's and beside the truth."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from calib import CalibrationResult
from geometry import Pose
from workbench.emulate import PAPER_DEVIATION_MM
from workbench.files import Truth
from workbench.report import AXES, arrow, number, print_verdict

CHI2_6_95 = 12.59  # 95 % of true errors lie below this squared Mahalanobis distance, six degrees of freedom


def print_demo(console: Console, result: CalibrationResult, truth: Truth, out: Path) -> None:
    """Print both comparisons, the verdict and where the files are."""
    console.print(_table1(result, truth))
    _print_consistency(console, result, truth)
    console.print(_figure7(result))
    left_out = [f for f in result.frames if not f.used]
    for frame in left_out:
        console.print(f"frame {frame.number} not used: {frame.reason}")
    print_verdict(console, result)
    _print_nominal(console, result)
    pictures = "fig7.png, cell.png" if (out / "cell.png").exists() else "fig7.png"
    console.print(
        f"\n{out}: dataset (cell.toml …, images, truth.json), report.html, {pictures}, overlays, result.json\n"
        f"the same again, as with any recorded cell: perceptron-emu calibrate {out}",
        soft_wrap=True,
        markup=False,
    )


def _print_nominal(console: Console, result: CalibrationResult) -> None:
    """One line on what the SCP that goes with the nominal table reaches where it had no part in the solution."""
    there = [loc for loc in result.locations.values() if loc.role == "verify"]
    figures = ([loc.max_deviation_mm.nominal for loc in there], [loc.point_rms_mm.nominal for loc in there])
    shown = (number(max((v for v in values if v is not None), default=None), 3) for values in figures)
    console.print(
        "with the robot's nominal table (T_hand_sensor_nominal), at the verifying place: distance deviation {} mm, "
        "point rms {} mm".format(*shown),
        soft_wrap=True,
    )


def _table1(result: CalibrationResult, truth: Truth) -> Table:
    table = Table(title="Table 1: sensor centre position", title_justify="left")
    for heading in ("", "design", "solved", "σ", "true", "error", "error / σ"):
        table.add_column(heading, justify="left" if not heading else "right", no_wrap=True)
    true = Pose.from_matrix(truth.T_hand_sensor)
    for part, unit in (("rotation", "°"), ("translation", "mm")):
        for i, axis in enumerate(AXES):
            table.add_row(f"{part} {axis} \\[{unit}]", *_table1_row(result, true, part, i))
    return table


def _table1_row(result: CalibrationResult, true: Pose, part: str, i: int) -> list[str]:
    def value(pose: Pose | None) -> float:
        if pose is None:
            return float("nan")
        return float((pose.fixed_xyz_deg if part == "rotation" else pose.t)[i])

    sigmas = result.sigma_rotation_deg if part == "rotation" else result.sigma_translation_mm
    design, solved, truth = value(result.T_hand_sensor_design), value(result.T_hand_sensor), value(true)
    sigma = float("nan") if sigmas is None else float(sigmas[i])
    numbers = [number(v, 4) for v in (round(design, 9) + 0.0, solved, sigma, truth)]
    return [*numbers, number(solved - truth, 4, sign=True), number((solved - truth) / sigma, 1, sign=True)]


def _print_consistency(console: Console, result: CalibrationResult, truth: Truth) -> None:
    if result.T_hand_sensor is None or result.covariance is None:
        return
    xi = (result.T_hand_sensor.inverse() @ Pose.from_matrix(truth.T_hand_sensor)).log()
    nees = float(xi @ np.linalg.solve(result.covariance, xi))
    console.print(
        f"all six together: squared error in σ {nees:.1f} (6 expected, 95 % below {CHI2_6_95:.1f}); "
        f"position off by {np.linalg.norm(xi[:3]):.3f} mm, direction by {np.rad2deg(np.linalg.norm(xi[3:])):.3f}°"
    )


def _figure7(result: CalibrationResult) -> Table:
    table = Table(title="Fig. 7: design → calibrated, in mm", title_justify="left")
    table.add_column("location")
    table.add_column("role")
    for heading in ("distance deviation, max", "3-D spread, max", "point rms"):
        table.add_column(heading, justify="right")
    for name, location in result.locations.items():
        pairs = (location.max_deviation_mm, location.spread_3d_mm, location.point_rms_mm)
        table.add_row(name, location.role, *(arrow(p) for p in pairs))
    paper = PAPER_DEVIATION_MM
    table.add_section()
    table.add_row("paper", "calibrate", f"{paper['design']:.1f} → {paper['solved']:.1f}", "", "")
    return table
