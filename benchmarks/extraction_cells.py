"""String spots of emulated cells: found, false, mislabelled, and the error of the strings' axis points.

Cells of the nominal sensor with posts, a wall behind, gloss, speckle and an arm with errors, 21 frames each, drawn by
seed. The speckle is learnt from six frames a cell, labels are those of the calibration. "Visible": at least 0.9 of the
lit patch is seen. Errors and σ are of rightly labelled, visible spots without a flag; bias and scatter (standard
deviation), and the scatter without the outer 1 % to show the tails; per string label the bias. σ/scatter is the root
mean square σ over the scatter.
Run: python benchmarks/extraction_cells.py [CPU seconds, default 240] [first seed]
"""

from __future__ import annotations

import sys
import time

import cv2
import numpy as np

from calib import FrameObservation, Observations, calibrate
from extraction import extract, learn_speckle
from geometry import PerceptronEmuError
from workbench.campaign.emulated import emulated_cell
from workbench.campaign.settings import TrialSettings
from workbench.campaign.trial import render_frame
from workbench.scoring import score_frame

SETTINGS = TrialSettings.model_validate({"clutter": True, "poses": {"plans": 6}})
LEARNT = 6
EXTREMES = (0.5, 99.5)  # percentiles between which the trimmed scatter is taken


def measured_cell(seed: int):
    """Counts (visible, found, false, mislabelled, labelled, flagged) and rows (error, σ) (K, 4), labels, frames."""
    sequence = np.random.SeedSequence(seed)
    emulated = emulated_cell(SETTINGS, np.random.default_rng(sequence))
    sensor = emulated.cell.sensor.model
    frames = [render_frame(emulated, c, sequence) for c in emulated.configurations]
    step = max(1, len(frames) // LEARNT)
    config = learn_speckle((f.image for f in frames[::step][:LEARNT]), sensor)
    spots = [extract(f.image, sensor, config) for f in frames]
    observed = tuple(
        FrameObservation(c.frame, c.location, c.role, p, joints_rad=c.reading_rad)
        for c, p in zip(emulated.configurations, spots, strict=True)
    )
    observations = Observations(observed, sensor, emulated.cell.T_hand_sensor_design)
    result = calibrate(observations, emulated.cell.jig, emulated.cell.robot)
    counts, rows, labels = np.zeros(6, int), [], []
    for frame, answer in zip(frames, result.frames, strict=True):
        points = answer.points
        score = score_frame(frame.truth.strings, points.label, points.uv_px, points.yz_mm)
        flagged = np.array([bool(flag) for flag in points.flag], dtype=bool)
        counts += [score.visible, score.found, score.false, score.mislabelled, len(points.label), flagged.sum()]
        for i, error in zip(score.point, score.error_mm, strict=True):
            if not flagged[i]:
                rows.append([*error, *points.sigma_yz_mm[i]])
                labels.append(points.label[i])
    return counts, np.array(rows).reshape(-1, 4), labels, len(frames)


def trimmed(values: np.ndarray) -> float:
    """Standard deviation without the extreme percentiles."""
    low, high = np.percentile(values, EXTREMES)
    return float(values[(values >= low) & (values <= high)].std())


def report(counts: np.ndarray, rows: np.ndarray, labels: np.ndarray, frames: int, cells: int) -> None:
    """Print the table."""
    visible, found, false, wrong, labelled, flagged = counts
    print(f"{cells} cells, {frames} frames, {visible} visible spots, {labelled} labelled points")
    print(f"visible spots found       {100 * found / visible:8.2f} %   ({visible - found} missed)")
    print(f"false after labelling     {100 * false / labelled:8.3f} %   ({false})")
    print(f"mislabelled               {100 * wrong / labelled:8.3f} %   ({wrong})")
    print(f"flagged                   {100 * flagged / labelled:8.2f} %")
    for k, axis in enumerate("yz"):
        error, sigma = rows[:, k], rows[:, 2 + k]
        normal = error / sigma
        print(
            f"{axis}: bias {error.mean():+.4f} mm, scatter {error.std():.4f} (inner 99 % {trimmed(error):.4f}) mm, "
            f"σ/scatter {np.sqrt(np.mean(sigma**2)) / error.std():.2f} "
            f"(scatter of error/σ {normal.std():.2f}, inner 99 % {trimmed(normal):.2f}), "
            f"|error| > 5 σ {100 * np.mean(np.abs(normal) > 5):.2f} %"
        )
    for label in sorted(set(labels)):
        mean, count = rows[labels == label, :2].mean(axis=0), int(np.sum(labels == label))
        print(f"  {label:2s} bias y {mean[0]:+.4f}, z {mean[1]:+.4f} mm ({count} points)")


def main() -> None:
    """Cells until the time is spent, then the table."""
    cv2.setNumThreads(1)
    budget = float(sys.argv[1]) if len(sys.argv) > 1 else 240.0
    seed = int(sys.argv[2]) if len(sys.argv) > 2 else 1
    counts, rows, labels, frames, cells = np.zeros(6, int), [], [], 0, 0
    while time.process_time() < budget:
        try:
            more, errors, names, shot = measured_cell(seed)
        except PerceptronEmuError as error:
            print(f"seed {seed}: {error}")
        else:
            counts, frames, cells = counts + more, frames + shot, cells + 1
            rows.append(errors)
            labels += names
        seed += 1
    report(counts, np.concatenate(rows), np.array(labels), frames, cells)
    print(f"{time.process_time():.0f} s of processor time")


if __name__ == "__main__":
    main()
