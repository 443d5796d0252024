"""The paper's experiment as an ensemble."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer
from rich.table import Table

from workbench.cli.console import say_on_stdout, standard_output

if TYPE_CHECKING:
    from calib.synthetic import EnsembleRow, PaperSetting

PAPER_MM = {"design": 5.0, "paper": 1.4}  # Fig. 7's largest deviations as printed
METHOD_WORDS = {"paper": "the paper's method", "bundle scp": "bundle, scp", "bundle full": "bundle, full"}


def command(
    runs: Annotated[int, typer.Option(min=1, help="Cells to draw and calibrate.")] = 10,
    seed: Annotated[int, typer.Option(min=0, help="Seed of all that is drawn.")] = 1,
    moving: Annotated[
        str, typer.Option(help="Joints that move between the configurations of a place: how many of the last, or all.")
    ] = "3",
    robot: Annotated[str | None, typer.Option(help="robot.toml or preset; without it a six-axis arm of 2.5 m.")] = None,
    sensor: Annotated[str | None, typer.Option(help="sensor.toml or preset; without it one at 290 mm.")] = None,
    jig: Annotated[str | None, typer.Option(help="jig.toml or preset; without it the paper's pillar.")] = None,
    mounting: Annotated[
        tuple[float, float, float, float, float, float] | None,
        typer.Option(
            metavar="X Y Z RX RY RZ",
            help="T_hand_sensor by design in mm and degrees about fixed X, Y, Z; without it Table 1's. The sensor is "
            "mounted as far off as there.",
        ),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object on standard output.")] = False,
) -> None:
    """Repeat the paper's experiment with errors drawn anew: Table 1 and Fig. 7 with spreads, and what explains them."""
    from calib.synthetic import paper_ensemble
    from geometry import json_text
    from workbench.cli.console import progress_bar

    setting = _setting(moving, robot, sensor, jig, mounting)
    with progress_bar("calibrating", runs) as progress:
        rows = paper_ensemble(np.random.default_rng(seed), runs, progress=progress, setting=setting)
    if as_json:
        say_on_stdout(json_text(_object(rows, runs) | {"moving_joints": setting.moving}))
    else:
        _show(rows, runs, setting)


def _setting(
    moving: str, robot: str | None, sensor: str | None, jig: str | None, mounting: tuple[float, ...] | None
) -> PaperSetting:
    from calib.synthetic import DESIGN, PaperSetting, industrial_arm
    from geometry import InputError, Pose
    from workbench.cell import find_jig, find_robot, find_sensor

    arm = None if robot is None else find_robot(robot).dh_part()
    joints = (arm or industrial_arm()).n_joints
    known = {"all": None} | {str(n): n for n in range(1, joints + 1)}
    if moving not in known:
        raise InputError(f'--moving "{moving}": how many of the last joints, 1 to {joints}, or all is right')
    if mounting is not None and not all(np.isfinite(mounting)):
        raise InputError("--mounting takes six finite numbers: x y z in mm, then rotations about X, Y, Z in degrees")
    design = DESIGN if mounting is None else Pose.from_fixed_xyz_deg(mounting[3:], mounting[:3])
    return PaperSetting(
        known[moving],
        arm,
        None if jig is None else find_jig(jig),
        None if sensor is None else find_sensor(sensor),
        design,
        PaperSetting.mounted(design),
    )


def _object(rows: tuple[EnsembleRow, ...], runs: int) -> dict[str, Any]:
    from calib.synthetic import METHODS, SOURCES, largest_deviations, poses

    deviations = {source: {m: largest_deviations(rows, source, m) for m in ("design", *METHODS)} for source in SOURCES}
    table = {
        method: {
            "rotation_deg": [p.fixed_xyz_deg for p in poses(rows, method)],
            "translation_mm": [p.t for p in poses(rows, method)],
        }
        for method in METHODS
    }
    alone = {source: _factor(deviations[source]["paper"]) for source in SOURCES}
    return {
        "runs": runs,
        "max_deviation_mm": deviations,
        "as_printed_mm": PAPER_MM,
        "factor_to_explain_the_printed": alone,
        "scp": table,
    }


def _factor(deviations: np.ndarray) -> float | None:
    """How many times larger a source would have to be to explain the printed deviation by itself."""
    return PAPER_MM["paper"] / float(np.mean(deviations)) if len(deviations) else None


def _show(rows: tuple[EnsembleRow, ...], runs: int, setting: PaperSetting) -> None:
    console = standard_output()
    console.print(_fig7(rows, runs))
    console.print(_table1(rows, setting))
    console.print(_explained(rows), soft_wrap=True, markup=False)


def _fig7(rows: tuple[EnsembleRow, ...], runs: int) -> Table:
    from calib.synthetic import METHODS, SOURCES, largest_deviations

    title = f"Fig. 7: largest deviation of the distance in mm, mean ± spread of {runs} runs"
    table = Table("errors drawn", "uncalibrated", *(METHOD_WORDS[m] for m in METHODS), "times for 1.4", title=title)
    for source in SOURCES:
        cells = [_spread(largest_deviations(rows, source, m)) for m in ("design", *METHODS)]
        factor = _factor(largest_deviations(rows, source, "paper"))
        table.add_row(source, *cells, "–" if factor is None else f"{factor:.1f}")
    table.add_row("the paper, as printed", f"{PAPER_MM['design']:.1f}", f"{PAPER_MM['paper']:.1f}", "", "", "")
    return table


def _table1(rows: tuple[EnsembleRow, ...], setting: PaperSetting) -> Table:
    from calib.synthetic import METHODS, poses

    table = Table("six numbers, all sources", title="Table 1: mean ± spread")
    for heading in ("design", "truth here (the paper's, if not --mounting)", *(METHOD_WORDS[m] for m in METHODS)):
        table.add_column(heading, justify="right")
    known = {m: poses(rows, m) for m in METHODS}
    for i in range(6):
        what, digits = (("rotation", 4), ("translation", 3))[i // 3]

        def number(pose: Any, i: int = i) -> float:
            return float((*pose.fixed_xyz_deg, *pose.t)[i])

        solved = [_spread(np.array([number(p) for p in known[m]]), digits) for m in METHODS]
        table.add_row(
            f"{what} {'XYZ'[i % 3]}, {('°', 'mm')[i // 3]}",
            f"{number(setting.design) + 0.0:.{digits}f}",
            f"{number(setting.truth):.4f}",
            *solved,
        )
    return table


def _explained(rows: tuple[EnsembleRow, ...]) -> str:
    from calib.synthetic import SOURCES, largest_deviations

    alone = {s: largest_deviations(rows, s, "paper") for s in SOURCES}
    known = {s: float(np.mean(v)) for s, v in alone.items() if len(v)}
    everything = next(iter(SOURCES))
    if everything not in known:
        return "the paper's method gave no answer"
    parts = sorted(((v, s) for s, v in known.items() if s != everything), reverse=True)
    words = ", ".join(f"{s.removesuffix(' alone')} {v:.2f}" for v, s in parts)
    share = known[everything] / PAPER_MM["paper"]
    reached = int(np.sum(alone[everything] >= PAPER_MM["paper"]))
    return (
        f"Of the {PAPER_MM['paper']} mm that the paper's method leaves, errors of the sizes drawn here explain "
        f"{known[everything]:.2f} mm ({share:.0%}) on average; {reached} of {len(alone[everything])} runs reach "
        f"it. Each alone: {words} mm. The last column says how many times larger a source would have to be to "
        "explain all of it by itself."
    )


def _spread(values: np.ndarray, digits: int = 2) -> str:
    if not len(values):
        return "none"
    return f"{np.mean(values):.{digits}f} ± {np.std(values):.{digits}f}"
