"""String spots of emulated cells: found, false, mislabelled, and the error of the strings' axis points.

Cells of the nominal sensor with posts, a wall behind, speckle and an arm with errors, 21 frames each, drawn by seed; a
thread of random albedo, gloss and roughness a cell, which the calibration is not told. The speckle is learnt from the
frames that `calibrate` learns from, labels are the calibration's. "Visible": at least 0.9 of the lit patch is seen.
Errors and σ are of rightly labelled, visible spots without a flag. "Known reflectance": the same points with the offset
of the cell's true thread instead of that of the plausible ones. σ/scatter is the root mean square σ over the scatter;
with known reflectance σ is the spot's own, without the reserve for the thread, which is an offset and no scatter.
With `--strips`, two narrow strips a cell stand before the jig and hide strings in part: the last table says what
becomes of strings by the fraction of their light that is seen. The jig's nominal places are given then ([locations.X]
T_base_jig of a cell.toml): where the upright first frame of a location is hidden, points alone name its strings as the
half turn of the jig has them.
Run: python benchmarks/extraction_cells.py [--cells 12] [--first 1] [--jobs 1] [--strips] [--minutes M]
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
from rendered_strings import random_thread

from calib import Observed, calibrate
from calib.config import SurfaceConfig
from calib.label.surface_offset import surface_offset
from extraction import ExtractionConfig, extract
from geometry import Frame, PerceptronEmuError, Pose
from perceptron_emu import ALUMINIUM, Material, Solid, panel
from workbench.campaign import EmulatedCell, TrialSettings, emulated_cell, render_frame
from workbench.cell import dataset_config
from workbench.compare import VISIBLE, NamedPoints, match, true_strings

SETTINGS = TrialSettings.model_validate({"clutter": True, "poses": {"plans": 6}})
EXTREMES = (0.5, 99.5)  # percentiles between which the trimmed scatter is taken
SEEN_BINS = (0.0, 0.1, 0.5, 0.7, 0.8, VISIBLE, 1.001)
# columns of a string's row
SEED, SEEN, FOUND, FLAGGED = range(4)
ERROR, SIGMA, KNOWN, RESERVE = slice(4, 6), slice(6, 8), slice(8, 10), slice(10, 12)
COLUMNS = 12


@dataclass(frozen=True, eq=False)
class Measured:
    """One cell: counts (false, mislabelled, labelled, flagged), a row of each string of each frame, their labels."""

    counts: np.ndarray
    rows: np.ndarray
    labels: tuple[str, ...]
    frames: int
    seconds: float
    problem: str = ""


def strips(rng: np.random.Generator) -> tuple[Solid, ...]:
    """Two strips 4 to 12 mm wide before the jig, in its axes (x up the pillar, z away from the arm)."""
    out = []
    for number in range(2):
        a = rng.uniform(0, np.pi)
        turn = np.array([[np.cos(a), -np.sin(a), 0], [np.sin(a), np.cos(a), 0], [0, 0, 1]])
        place = np.array([rng.uniform(20, 80), rng.uniform(-45, 45), rng.uniform(-50, -15)])
        out.append(panel(rng.uniform(4, 12), 160.0, Pose(turn, place), ALUMINIUM, f"strip {number}"))
    return tuple(out)


def drawn_cell(seed: int, *, hide: bool) -> tuple[EmulatedCell, Material]:
    """The cell of a seed with its thread, and with strips before the jig where they are wanted."""
    emulated = emulated_cell(SETTINGS, np.random.default_rng(np.random.SeedSequence(seed)))
    rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(5,)))
    thread = random_thread(rng)
    solids = emulated.true.solids
    if hide:
        solids = {name: (*those, *strips(rng)) for name, those in solids.items()}
    return replace(emulated, true=replace(emulated.true, string_material=thread, solids=solids)), thread


def measured_cell(seed: int, hide: bool) -> Measured:
    """Render, extract, calibrate and score one cell."""
    cv2.setNumThreads(1)
    start = time.process_time()
    try:
        emulated, thread = drawn_cell(seed, hide=hide)
        seen_by = emulated.cell.sensor
        sequence = np.random.SeedSequence(seed)
        frames = [render_frame(emulated, c, sequence) for c in emulated.configurations]
        config = dataset_config(seen_by, ExtractionConfig(), len(frames), lambda some: [frames[i].image for i in some])
        spots = [extract(f.image, seen_by, config) for f in frames]
        observed = tuple(
            Frame(c.frame, c.location, c.role, joints_rad=c.reading_rad, points=p)
            for c, p in zip(emulated.configurations, spots, strict=True)
        )
        places = emulated.cell.T_base_jig if hide else {}
        observations = Observed(observed, seen_by, emulated.cell.T_hand_sensor_design, places)
        result = calibrate(observations, emulated.cell.jig, emulated.cell.robot)
    except PerceptronEmuError as error:
        return Measured(np.zeros(4, int), np.zeros((0, COLUMNS)), (), 0, time.process_time() - start, str(error))
    counts, rows, labels = np.zeros(4, int), [], []
    for frame, answer in zip(frames, result.frames, strict=True):
        points = answer.points
        named = NamedPoints(points.label, points.uv_px, points.yz_mm)
        compared = match(true_strings(frame.truth.strings), named, labelled=True)
        counts += [len(compared.false_points), compared.mislabelled, len(points.label), sum(map(bool, points.flag))]
        for row in string_rows(seed, frame.truth, points, emulated, thread):
            rows.append(row[1])
            labels.append(row[0])
    table = np.array(rows).reshape(-1, COLUMNS)
    return Measured(counts, table, tuple(labels), len(frames), time.process_time() - start)


def string_rows(seed: int, truth, points, emulated: EmulatedCell, thread: Material):
    """Label and row of every string of a frame that leaves any light in it."""
    jig, sensor = emulated.cell.jig, emulated.cell.sensor
    own = SurfaceConfig(known=True, diffuse=thread.diffuse, specular=thread.specular, roughness=thread.roughness)
    for k, string in enumerate(truth.strings):
        row = np.full(COLUMNS, np.nan)
        row[SEED], row[SEEN], row[FOUND], row[FLAGGED] = seed, string.visible_fraction, 0, 0
        if string.label in points.label:
            i = points.label.index(string.label)
            row[FOUND], row[FLAGGED] = np.linalg.norm(points.uv_px[i] - string.image_px) < 8.0, bool(points.flag[i])
            row[ERROR], row[SIGMA] = points.yz_mm[i] - string.axis_mm, points.sigma_yz_mm[i]
            direction = truth.T_sensor_jig.R @ jig.directions[k]
            place = (np.array(string.axis_mm)[None], direction[None], jig.string_diameter_mm / 2, sensor)
            (guessed, spread), (true, _) = (surface_offset(*place, surface) for surface in (SurfaceConfig(), own))
            row[KNOWN] = row[ERROR] + guessed[0] - true[0]
            row[RESERVE] = np.sqrt(np.diag(spread[0]))
        if np.all(np.isfinite(np.asarray(string.image_px, dtype=float))):
            yield string.label, row


def trimmed(values: np.ndarray) -> float:
    """Standard deviation without the extreme percentiles."""
    low, high = np.percentile(values, EXTREMES)
    return float(values[(values >= low) & (values <= high)].std())


def report(cells: Sequence[Measured]) -> None:
    """Print the tables."""
    false, wrong, labelled, flagged = np.sum([c.counts for c in cells], axis=0)
    rows = np.concatenate([c.rows for c in cells])
    labels = np.array([label for c in cells for label in c.labels])
    visible = rows[:, SEEN] >= VISIBLE
    count, found = visible.sum(), int(rows[visible, FOUND].sum())
    print(
        f"{len(cells)} cells, {sum(c.frames for c in cells)} frames, {count} visible spots, {labelled} labelled points"
    )
    print(f"visible spots found       {100 * found / count:8.2f} %   ({count - found} missed)")
    print(f"false after labelling     {100 * false / labelled:8.3f} %   ({false})")
    print(f"mislabelled               {100 * wrong / labelled:8.3f} %   ({wrong})")
    print(f"flagged                   {100 * flagged / labelled:8.2f} %")
    good = visible & (rows[:, FOUND] > 0) & (rows[:, FLAGGED] == 0)
    errors(rows[good], labels[good])
    by_fraction(rows)
    for cell in cells:
        if cell.problem:
            print(f"a cell without answer: {cell.problem}")
    print(f"{sum(c.seconds for c in cells):.0f} s of processor time")


def errors(rows: np.ndarray, labels: np.ndarray) -> None:
    """Bias, scatter and σ of the axis points, with unknown and with known reflectance."""
    for k, axis in enumerate("yz"):
        error, sigma, known = rows[:, ERROR][:, k], rows[:, SIGMA][:, k], rows[:, KNOWN][:, k]
        normal, rms = error / sigma, np.sqrt(np.mean(sigma**2))
        spot = np.sqrt(np.mean(sigma**2 - rows[:, RESERVE][:, k] ** 2))
        cells = np.array([error[rows[:, SEED] == seed].mean() for seed in np.unique(rows[:, SEED])])
        print(
            f"{axis}: unknown gloss: bias {error.mean():+.4f} mm (of single cells: root mean square "
            f"{np.sqrt(np.mean(cells**2)):.4f}, largest {np.abs(cells).max():.4f}), scatter {error.std():.4f} mm "
            f"(inner 99 % {trimmed(error):.4f})\n"
            f"   σ/scatter {rms / error.std():.2f}, σ/rms error {rms / np.sqrt(np.mean(error**2)):.2f} "
            f"(scatter of error/σ {normal.std():.2f}, inner 99 % {trimmed(normal):.2f}), "
            f"|error| > 5 σ {100 * np.mean(np.abs(normal) > 5):.2f} %\n"
            f"   known reflectance: bias {known.mean():+.4f} mm, scatter {known.std():.4f} mm, "
            f"σ/scatter {spot / known.std():.2f}"
        )
    for label in sorted(set(labels)):
        mine = rows[labels == label]
        (y, z), (ky, kz) = mine[:, ERROR].mean(axis=0), mine[:, KNOWN].mean(axis=0)
        print(f"  {label:2s} bias y {y:+.4f}, z {z:+.4f} mm; known y {ky:+.4f}, z {kz:+.4f} mm ({len(mine)} points)")


def by_fraction(rows: np.ndarray) -> None:
    """What becomes of strings by the fraction of their light that is seen."""
    for low, high in pairwise(SEEN_BINS):
        mine = rows[(rows[:, SEEN] > low) & (rows[:, SEEN] <= high) | ((low == VISIBLE) & (rows[:, SEEN] == VISIBLE))]
        if not len(mine):
            continue
        found = mine[mine[:, FOUND] > 0]
        clean = found[found[:, FLAGGED] == 0]
        share = 100 * len(found) / len(mine)
        line = f"seen {low:.1f} … {min(high, 1):.1f}: {len(mine):6d} strings, labelled {share:5.1f} %"
        if len(found):
            line += f", of these flagged {100 * found[:, FLAGGED].mean():5.1f} %"
        if len(clean):
            size, normal = np.abs(clean[:, ERROR]), np.abs(clean[:, ERROR] / clean[:, SIGMA])
            y, z = np.sqrt(np.mean(size**2, axis=0))
            line += (
                f"; unflagged: rms y {y:.4f}, z {z:.4f} mm, |error| > 5 σ {100 * np.mean(normal.max(axis=1) > 5):.1f} %"
            )
        print(line)


def main() -> None:
    """Measure the cells and print the tables."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cells", type=int, default=12)
    parser.add_argument("--first", type=int, default=1, help="first seed")
    parser.add_argument("--jobs", type=int, default=1, help="processes")
    parser.add_argument("--strips", action="store_true", help="strips that hide strings")
    parser.add_argument("--minutes", type=float, default=np.inf, help="report what is measured by then")
    given = parser.parse_args()
    end, cells = time.monotonic() + 60 * given.minutes, []
    with ProcessPoolExecutor(given.jobs) as pool:
        seeds = range(given.first, given.first + given.cells)
        for cell in pool.map(measured_cell, seeds, [given.strips] * given.cells):
            cells.append(cell)
            if time.monotonic() > end:
                pool.shutdown(wait=True, cancel_futures=True)
                break
    report(cells)


if __name__ == "__main__":
    main()
