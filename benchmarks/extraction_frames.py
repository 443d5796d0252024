"""Time of string frames, image in memory to points with covariance, on one core.

Every frame of a dataset, the least of several runs each: processor time of this thread alone, so that other programs
count little. "Ordinary" frames have fewer than 100 peaks that are looked at; more come with a lit wall.
Run: python benchmarks/extraction_frames.py [dataset, default the sample cell] [runs a frame, default 9]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

import cv2
import numpy as np

import assets
from extraction import extract, extract_stages
from workbench.files import read_cell, read_image

CROWDED = 100


def frame_ms(image: np.ndarray, sensor, runs: int) -> float:
    """Least processor time of the runs [ms]."""
    times = []
    for _ in range(runs):
        start = time.thread_time()
        extract(image, sensor)
        times.append(time.thread_time() - start)
    return 1e3 * min(times)


def main() -> None:
    """Print the median and the largest time of ordinary frames and of crowded ones."""
    cv2.setNumThreads(1)
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else assets.path("samples", "cell_a")
    runs = int(sys.argv[2]) if len(sys.argv) > 2 else 9
    cell = read_cell(folder)
    sensor = cell.sensor
    images = [read_image(cell.folder / row.image, sensor) for row in cell.frames]
    crowded = np.array([len(extract_stages(image, sensor).candidates) >= CROWDED for image in images])
    times = np.array([frame_ms(image, sensor, runs) for image in images])
    print(f"{len(images)} frames of {sensor.camera.width_px} × {sensor.camera.height_px} px")
    for name, which in (("ordinary", ~crowded), ("crowded", crowded)):
        if which.any():
            middle, most = np.median(times[which]), times[which].max()
            print(f"{name:9s} {which.sum():3d} frames: median {middle:.1f} ms, largest {most:.1f} ms")
    print(f"frames within 5 ms: {100 * np.mean(times <= 5.0):.0f} %")


if __name__ == "__main__":
    main()
