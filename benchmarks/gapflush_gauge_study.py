"""A gauge study of gap and flush on emulated panels: parts × operators × trials, judged by `accept gauge`.

Ten parts of a series (gap 3.5 ± 0.3 mm, flush ± 0.3 mm, radii 2 ± 0.1 mm), three operators, three trials. An
operator is a way to hold the sensor: his own stand-off, turn in the sheet and place aside; a trial is another placing
by him with the scatter of a hand, another place along the gap (so another speckle), and a frame of its own.
Run: python benchmarks/gapflush_gauge_study.py [folder] [--parts N] [--operators N] [--trials N] [--plain]
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from assets import path as asset
from extraction import GapFlushConfig, extract_profile, measure_gap_flush
from geometry import NoAnswerError, Pose, Sensor
from perceptron_emu import EmulatorConfig, Material, Scene, render
from perceptron_emu.solids import PanelPair
from workbench.accept import Record, accept_gauge
from workbench.files import read_sensor, write_text

SEED = 21
MATERIAL = Material(0.6)
TOLERANCE_MM = {"gap": 1.0, "flush": 1.0}  # ± 0.5 mm, as on closures of car bodies
GAP_MM, FLUSH_MM, RADIUS_MM = (3.5, 0.3), (0.0, 0.3), (2.0, 0.1)  # mean and σ of the parts
HELD = (8.0, 3.0, 8.0)  # σ among operators of the stand-off [mm], the turn [°], the place aside [mm]
HAND = (2.0, 1.0, 2.0)  # the same, of one operator from trial to trial
STAND_OFF_MM = 305.0
DEFINITIONS = ("extreme", "tangent", "edge", "fixed_radius", "gauge")
By = dict[str, list[float]]
CONFIG = GapFlushConfig(fixed_radius_mm=(RADIUS_MM[0], RADIUS_MM[0]), gauge_depth_mm=2.5, gauge_offset_mm=5.0)


def parts(count: int, rng: np.random.Generator) -> list[PanelPair]:
    """Panels of a series."""
    out = []
    for _ in range(count):
        gap, flush = rng.normal(*GAP_MM), rng.normal(*FLUSH_MM)
        left, right = rng.normal(*RADIUS_MM, size=2)
        out.append(PanelPair(float(gap), float(flush), (float(left), float(right))))
    return out


def placed(held: np.ndarray, rng: np.random.Generator) -> Pose:
    """Where the panels stand before a sensor that an operator holds."""
    away, turn_deg, aside = held + rng.normal(size=3) * HAND
    turn = np.deg2rad(turn_deg)
    c, s = np.cos(turn), np.sin(turn)
    return Pose(np.array([[1, 0, 0], [0, c, -s], [0, s, c]]), np.array([0.0, aside, STAND_OFF_MM + away]))


def study(
    sensor: Sensor, n_parts: int, n_operators: int, n_trials: int, done: dict[str, By], *, speckle: bool
) -> Iterator[tuple[int, int, int, PanelPair, By]]:
    """Every measurement: part, operator, trial, the truth, and gap, σ, flush, σ by definition; those done are taken."""
    series = parts(n_parts, np.random.default_rng([SEED, 0]))
    held = np.random.default_rng([SEED, 1]).normal(size=(n_operators, 3)) * HELD
    config = EmulatorConfig.model_validate({"exposure": {"time_ms": 0.3}, "speckle": {"enabled": speckle}})
    for i, panels in enumerate(series):
        for j in range(n_operators):
            for k in range(n_trials):
                if (key := f"{i},{j},{k}") in done:
                    yield i, j, k, panels, done[key]
                    continue
                rng = np.random.default_rng([SEED, 2, i, j, k])
                solids = panels.solids(placed(held[j], rng), MATERIAL)
                profile = extract_profile(render(Scene(sensor, None, solids=solids), config, rng).image, sensor)
                try:
                    by = measure_gap_flush(profile, CONFIG).definitions
                except NoAnswerError as error:
                    sys.exit(f"part {i + 1}, operator {j + 1}, trial {k + 1}: {error}")
                rows = {n: [x.gap_mm, x.sigma_gap_mm, x.flush_mm, x.sigma_flush_mm] for n, x in by.items()}
                yield i, j, k, panels, rows


def judged(folder: Path, name: str, rows: list[tuple[int, int, int, float, float]], tolerance: float) -> Record:
    """The record of one quantity, through a table as users have it."""
    lines = ["part,operator,trial,value,reference"]
    lines += [f"{i + 1},{'ABCDEFGH'[j]},{k + 1},{value:.6f},{true:.6f}" for i, j, k, value, true in rows]
    path = folder / f"{name}.csv"
    write_text(path, "\n".join(lines) + "\n")
    return accept_gauge(path, tolerance_mm=tolerance)


def main() -> None:
    """Print a row for gap and flush by every definition."""
    ask = argparse.ArgumentParser()
    ask.add_argument("folder", nargs="?", default="gauge_study")
    for name, value in (("parts", 10), ("operators", 3), ("trials", 3)):
        ask.add_argument(f"--{name}", type=int, default=value)
    ask.add_argument("--most", type=int, default=0, help="frames of this run; run again to go on")
    ask.add_argument("--plain", action="store_true", help="without speckle")
    told = ask.parse_args()
    folder = Path(told.folder)
    folder.mkdir(parents=True, exist_ok=True)
    sensor = read_sensor(asset("sensors", "nominal"))
    store = folder / ("plain.json" if told.plain else "speckle.json")
    done: dict[str, By] = json.loads(store.read_text(encoding="utf-8")) if store.exists() else {}
    made, measured = [], 0
    for row in study(sensor, told.parts, told.operators, told.trials, done, speckle=not told.plain):
        made.append(row)
        key = f"{row[0]},{row[1]},{row[2]}"
        if key not in done:
            done[key], measured = row[4], measured + 1
            write_text(store, json.dumps(done))
            if measured == told.most:
                sys.exit(f"{len(done)} frames measured: run again to go on")
    print("quantity               EV     AV    GRR  [95 %]           PV   %GRR of T  ndc    Cg   Cgk   median σ  bias")
    for quantity, column in (("gap", 0), ("flush", 2)):
        for name in DEFINITIONS:
            rows, sigma = [], []
            for i, j, k, panels, by in made:
                if name in by:
                    rows.append((i, j, k, by[name][column], true_value(panels, quantity, name)))
                    sigma.append(by[name][column + 1])
            record = judged(folder, f"{quantity}_{name}", rows, TOLERANCE_MM[quantity])
            f = {x.name: x for x in record.figures}
            bounds = f["GRR"].bounds
            interval = "" if bounds is None else f"{bounds.low:.4f} … {bounds.high:.4f}"
            error = np.array([r[3] - r[4] for r in rows])
            print(
                f"{quantity + ', ' + name:19s} {f['EV'].value:.4f} {f['AV'].value:.4f} {f['GRR'].value:.4f}  {interval}"
                f"  {f['PV'].value:.3f}  {f['percent_GRR_tolerance'].value:8.1f}  {f['ndc'].value:4.0f}"
                f"  {f['Cg'].value:5.2f} {f['Cgk'].value:5.2f}  {np.median(sigma):.4f}  {error.mean():+.4f}",
                flush=True,
            )


def true_value(panels: PanelPair, quantity: str, definition: str) -> float:
    """The part's own value by a definition, from its outline."""
    left, right = panels.radii_mm
    if quantity == "gap":
        if definition == "tangent":
            return panels.gap_mm + left + right
        if definition != "gauge":
            return panels.gap_mm
        depth = float(CONFIG.gauge_depth_mm or 0.0)
        return panels.gap_mm + _short(left, left - depth) + _short(right, right - panels.flush_mm - depth)
    return panels.flush_mm


def _short(radius: float, above: float) -> float:
    """How far a feeler stays from the extreme point where its tip ends so far above it."""
    return radius - float(np.sqrt(radius**2 - above**2)) if above > 0 else 0.0


if __name__ == "__main__":
    main()
