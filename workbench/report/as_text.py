"""The result of calibrate for people: Table 1 and Fig. 7 of the paper, frames left out, verdict with advice."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from rich.console import Console
from rich.markup import escape
from rich.table import Table
from rich.text import Text

from calib import CalibrationResult, DesignSolved, printed_sigmas
from geometry import CONVENTIONS, Pose, express

AXES = ("X", "Y", "Z")
COLOURS = {"ok": "green"} | dict.fromkeys(("model_misfit", "priors_contradict", "sensor_suspect", "weak"), "yellow")


def print_calibration(console: Console, result: CalibrationResult, complaints: dict[int, str] | None = None) -> None:
    """Print the whole result."""
    console.print(_scp_table(result))
    _print_nominal(console, result)
    if result.T_hand_sensor is not None:
        apart = result.nominal_apart
        if apart is None:
            _print_conventions(console, result.T_hand_sensor, "The same pose as makers write it")
        else:
            _print_conventions(
                console, apart.T_hand_sensor, "The pose for a controller with its nominal table, as makers write it"
            )
    console.print(_location_table(result))
    _print_points(console, result)
    _print_left_out(console, result, complaints or {})
    _print_equal_weights(console, result)
    for note in (*result.weak_directions, *result.notes):
        console.print(f"note: {escape(note)}", soft_wrap=True)
    print_verdict(console, result)


def print_verdict(console: Console, result: CalibrationResult) -> None:
    """Print the verdict with its advice."""
    colour = COLOURS.get(result.verdict.code, "red")
    if not result.verdict.trustworthy:
        colour = "red"
    misfit = "" if result.chi2_per_dof is None else f"   (χ² per degree of freedom {result.chi2_per_dof:.2f})"
    console.print(Text.assemble(("verdict: ", "bold"), (result.verdict.code, f"bold {colour}"), misfit))
    console.print(Text(result.verdict.text), soft_wrap=True)


def _scp_table(result: CalibrationResult) -> Table:
    method, model = result.method, result.model
    table = Table(title=f"Sensor centre position T_hand_sensor   ({method}, {model})", title_justify="left")
    for heading in ("", "design", "solved", "σ", "change"):
        table.add_column(heading, justify="left" if not heading else "right", no_wrap=True)
    pose, design = result.T_hand_sensor, result.T_hand_sensor_design
    rotation = None if pose is None else pose.fixed_xyz_deg
    translation = None if pose is None else pose.t
    drawn = (None, None) if design is None else (design.fixed_xyz_deg, design.t)
    _scp_rows(table, "rotation", "°", drawn[0], rotation, result.sigma_rotation_deg)
    _scp_rows(table, "translation", "mm", drawn[1], translation, result.sigma_translation_mm)
    return table


def _scp_rows(table: Table, what: str, unit: str, design: object, solved: object, sigma: object) -> None:
    """Three rows; what could not be solved shows a dash."""
    d = np.full(3, np.nan) if design is None else np.round(np.asarray(design, dtype=float), 9) + 0.0  # no minus zero
    s = np.full(3, np.nan) if solved is None else np.asarray(solved, dtype=float)
    e = np.full(3, np.nan) if sigma is None else np.asarray(sigma, dtype=float)
    for i, axis in enumerate(AXES):
        cells = [number(d[i], 4), number(s[i], 4), number(e[i], 4), number(s[i] - d[i], 4, sign=True)]
        table.add_row(f"{what} {axis} [{unit}]".replace("[", "\\["), *cells)


def _print_nominal(console: Console, result: CalibrationResult) -> None:
    """The SCP that goes with the nominal table, where that is another."""
    nominal = result.nominal_apart
    if nominal is None:
        return
    rotation, translation = nominal.T_hand_sensor.fixed_xyz_deg, nominal.T_hand_sensor.t
    sigma = printed_sigmas(nominal.T_hand_sensor, nominal.covariance)
    numbers = [f"{a:z.4f} ± {s:.4f}" for a, s in zip([*rotation, *translation], np.concatenate(sigma), strict=True)]
    console.print(
        f"with the robot's nominal table: {', '.join(numbers[:3])} °, {', '.join(numbers[3:])} mm", soft_wrap=True
    )


def _print_conventions(console: Console, pose: Pose, heading: str) -> None:
    """A pose in every maker's numbers, each with its formula, one line a maker."""
    console.print(Text(heading))
    for name, convention in CONVENTIONS.items():
        numbers = ", ".join(f"{_short(label)} {value:.7g}" for label, value in express(pose, name).items())
        unit = "mm" if convention.length_mm == 1 else "m"
        console.print(Text(f"  {convention.maker} ({unit}): {numbers}   [{convention.formula}]"), soft_wrap=True)


def _short(label: str) -> str:
    return label.split(" / ", maxsplit=1)[0]


def _location_table(result: CalibrationResult) -> Table:
    table = Table(title="Locations, design → solved, in mm", title_justify="left")
    table.add_column("location", no_wrap=True)
    table.add_column("role", no_wrap=True)
    for heading in ("frames", "distance deviation, max (Fig. 7)", "3-D spread, max", "point rms"):
        table.add_column(heading, justify="right")
    for name, location in result.locations.items():
        used = sum(f.used for f in result.frames if f.location == name)
        total = sum(f.location == name for f in result.frames)
        figures = [arrow(f) for f in (location.max_deviation_mm, location.spread_3d_mm, location.point_rms_mm)]
        table.add_row(escape(name), location.role, f"{used} of {total}", *figures)
    return table


def arrow(pair: DesignSolved) -> str:
    """``2.10 → 0.21``."""
    return f"{number(pair.design, 3)} → {number(pair.solved, 3)}"


def number(value: float | None, digits: int, *, sign: bool = False) -> str:
    """A number, or a dash where there is none."""
    if value is None or not np.isfinite(value):
        return "–"
    return f"{value:+.{digits}f}" if sign else f"{value:.{digits}f}"


def _print_points(console: Console, result: CalibrationResult) -> None:
    used = [f for f in result.frames if f.used]
    n = sum(len(f.axis) for f in used)
    flagged = sum(bool(flag) for f in used for flag in f.axis.flag)
    residuals = np.concatenate([f.residual_mm for f in used]) if used else np.zeros(0)
    finite = residuals[np.isfinite(residuals)]
    rms = f", rms distance from the target {np.sqrt(np.mean(finite**2)):.3f} mm" if len(finite) else ""
    console.print(f"{len(used)} of {len(result.frames)} frames used, {n} points ({flagged} flagged){rms}")


def _print_left_out(console: Console, result: CalibrationResult, complaints: dict[int, str]) -> None:
    for frame in result.frames:
        if not frame.used:
            why = complaints.get(frame.number, f"{frame.image or 'points'}, location {frame.location}")
            console.print(f"frame {frame.number} not used: {escape(str(frame.reason))} ({escape(why)})", soft_wrap=True)


def _print_equal_weights(console: Console, result: CalibrationResult) -> None:
    """The answer that hangs on no noise, in a line: what others quote."""
    alike = result.equal_weights
    if alike is None or result.T_hand_sensor is None:
        return
    pose = alike.T_hand_sensor
    deg, mm = printed_sigmas(pose, alike.covariance)
    angles = ", ".join(f"{a:z.3f} ± {s:.2f}" for a, s in zip(pose.fixed_xyz_deg, deg, strict=True))
    lengths = ", ".join(f"{t:.2f} ± {s:.2f}" for t, s in zip(pose.t, mm, strict=True))
    console.print(
        f"with all points weighted alike: rotation {angles} °, translation {lengths} mm, points "
        f"{alike.point_rms_mm:.3f} mm, leaving a frame out {alike.left_out_rms_mm:.3f} mm (σ by the jackknife)",
        soft_wrap=True,
    )


def join(words: Sequence[str]) -> str:
    """``a, b and c``."""
    return " and ".join([", ".join(words[:-1]), words[-1]]) if len(words) > 1 else "".join(words)
