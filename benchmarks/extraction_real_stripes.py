"""Real stripes by default settings beside others' ways: residual about a line over 40 sections, and that over σ.

Sets: openlmd/etna (BSD), two of them, a stripe beside a checkerboard, clipped; NeilKhera/laser_line_striping (BSD), a
faint stripe in room light, JPEG; Jesus89/3DScanScience (CC BY-SA 4.0), a bust and a pattern with their laser-off
frames. Each method's points are cut into runs of 40 sections that follow each other; a line is taken off each run.
"residual" is the median over runs of the root mean square that is left, "over σ" the same of residuals divided by the
points' stated σ; "about a cubic" the same where a cubic is taken off in the line's place; "even" that of even sections,
their line fitted to odd ones alone. Others' points are taken in the sections that we found.
"by eye": of the sections of real_stripes_truth.txt, which says how it was read, those with a point within 3 px, flagged
or not; "false": points without a flag further off, or where there is no stripe, over all points judged. Then pictures
without a laser, of which every point without a flag is false.
Run: python benchmarks/extraction_real_stripes.py FOLDER   (RIDGE_PYTHON=… names an
interpreter with ridge-detector)
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from extraction import StripePeaks, detect_stripe

RUN, REACH_PX = 40, 15
BUST, PATTERN = "ciclop/3.1. Laser segmentation", "ciclop/3.2. Laser segmentation in pattern"
SETS: dict[str, tuple[str, str, int | None]] = {  # folder, files, channel
    "etna": ("etna/data", "frame*.png", None),
    "etna, second set": ("etna/data/calib2", "frame*.png", None),
    "floor": ("floor_blocks/Red Lasers (Plane)/test", "*.jpg", 2),
    "bust": (BUST, "laser.png", 2),
    "pattern": (PATTERN, "laser-0-255-255-8.png", 2),
}
TRUTH, TOLERANCE_PX = Path(__file__).with_name("real_stripes_truth.txt"), 3.0
SHORT = {"etna2": "etna, second set"}  # the truth's name of a set
OFF = {"bust": "laser_background.png", "pattern": "laser-background-0-255-255-8.png"}
Method = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def read(path: Path, channel: int | None) -> np.ndarray:
    """Grey levels of a file."""
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    return np.ascontiguousarray(image if image.ndim == 2 else image[..., channel or 0])


def _rows(image: np.ndarray, section: np.ndarray, place: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Grey levels of each section about its place, and where they are; sections are rows of ``image``."""
    at = np.clip(np.round(place).astype(int)[:, None] + np.arange(-REACH_PX, REACH_PX + 1), 0, image.shape[1] - 1)
    return image[section[:, None], at].astype(float), at


def centre_of_mass(image: np.ndarray, section: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Of what stands above the section's ends."""
    grey, at = _rows(image, section, place)
    weight = np.maximum(grey - np.median(grey[:, [0, 1, -2, -1]], axis=1)[:, None], 0)
    return np.sum(weight * at, 1) / np.maximum(np.sum(weight, 1), 1e-9)


def log_parabola(image: np.ndarray, section: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Blur along the section, σ 3 px, then a parabola through the logarithms of the three highest."""
    blurred = cv2.GaussianBlur(image.astype(np.float32), (19, 1), 3.0)
    grey, at = _rows(blurred, section, place)
    k, n = np.clip(np.argmax(grey, axis=1), 1, grey.shape[1] - 2), np.arange(len(grey))
    level = np.log(np.maximum(grey - grey.min(axis=1)[:, None], 1e-3))
    a, b, c = level[n, k - 1], level[n, k], level[n, k + 1]
    bend = a - 2 * b + c
    return at[n, k] + np.where(bend < 0, 0.5 * (a - c) / np.where(bend < 0, bend, 1.0), 0.0)


def brightest(image: np.ndarray, section: np.ndarray, place: np.ndarray) -> np.ndarray:
    """OpenCV alone: the brightest pixel of the blurred section."""
    grey, at = _rows(cv2.GaussianBlur(image, (5, 5), 1.3), section, place)
    return at[np.arange(len(grey)), np.argmax(grey, axis=1)].astype(float)


RIDGE = """
import sys, numpy as np
from ridge_detector import RidgeDetector
d = RidgeDetector(line_widths=[8, 12, 16], low_contrast=40, high_contrast=100, min_len=100, dark_line=False)
d.detect_lines(np.load(sys.argv[1]))
np.save(sys.argv[2], np.concatenate([np.column_stack([c.col, c.row]) for c in d.contours] or [np.zeros((0, 2))]))
"""


def ridge_detector(image: np.ndarray, section: np.ndarray, place: np.ndarray) -> np.ndarray:
    """Steger's detector: its line points, interpolated at the sections, where they are within REACH_PX."""
    with tempfile.TemporaryDirectory() as folder:
        source, result = Path(folder, "in.npy"), Path(folder, "out.npy")
        np.save(source, image)
        subprocess.run([os.environ["RIDGE_PYTHON"], "-c", RIDGE, source, result], check=True, capture_output=True)  # noqa: S603
        found = np.load(result)
    out = np.full(len(section), np.nan)
    for i, (row, at) in enumerate(zip(section, place, strict=True)):
        near = found[(np.abs(found[:, 1] - row) < 1) & (np.abs(found[:, 0] - at) < REACH_PX)]
        if len(near):
            out[i] = near[np.argmin(np.abs(near[:, 1] - row)), 0]
    return out


def runs(peaks: StripePeaks) -> list[np.ndarray]:
    """Indices of runs of RUN sections on one piece."""
    out = []
    for number in np.unique(peaks.piece):
        own = np.flatnonzero(peaks.piece == number)
        whole = own[: len(own) // RUN * RUN].reshape(-1, RUN)
        out += [run for run in whole if np.ptp(peaks.section[run]) < RUN + 4]
    return out


def bent(section: np.ndarray, place: np.ndarray) -> np.ndarray:
    """What a cubic leaves, freed of what it takes."""
    x = (section - section.mean()) / len(section)
    return (place - np.polyval(np.polyfit(x, place, 3), x)) * np.sqrt(len(x) / (len(x) - 4))


def residual(section: np.ndarray, place: np.ndarray, fitted: slice, judged: slice) -> np.ndarray:
    """What a line through some points leaves in others, freed of what the line takes."""
    x = section - section.mean()
    line = np.polyfit(x[fitted], place[fitted], 1)
    left = (place - np.polyval(line, x))[judged]
    return left * (np.sqrt(len(x) / (len(x) - 2)) if fitted == judged else 1 / np.sqrt(1 + 4 / len(x)))


def truths() -> list[tuple[str, str, np.ndarray]]:
    """Set, file and, by section, the stripe's place by eye: NaN where nothing is said, infinite where there is none."""
    out: list[tuple[str, str, np.ndarray]] = []
    lines = [line for line in TRUTH.read_text().splitlines() if not line.startswith("#")]
    text = "\n".join(lines).replace(",", "\n").replace("/", "\n/\n")
    alone, last = False, -1
    for line in text.splitlines():
        words = line.split()
        if not words:
            continue
        if "." in words[-1]:
            out.append((SHORT.get(words[0], words[0]), words[1], np.full(2000, np.nan)))
            alone, last = False, -1
        elif words[0] == "/":
            last = -1
        elif words[0] == "none":
            out[-1][2][int(words[1]) : int(words[2]) + 1], last = np.inf, -1
        else:
            alone |= words[0] == "alone"
            section, place = (int(x) for x in words[-2:])
            place_of = out[-1][2]
            place_of[section] = place
            if last >= 0 and not alone:
                place_of[last : section + 1] = np.linspace(place_of[last], place, section - last + 1)
            last = section
    return out


def by_eye(peaks: StripePeaks, stripes: list[np.ndarray]) -> np.ndarray:
    """Sections of the truth, those right, points judged, and those false without a flag."""
    place, section = peaks.uv_px[:, 0 if abs(peaks.normal[:1, 0]).sum() > 0.5 else 1], peaks.section
    off = np.array([np.abs(place - truth[section]) for truth in stripes]).reshape(len(stripes), -1)
    said = ~np.isnan(off).all(axis=0) if len(peaks) else np.zeros(0, bool)
    near = (off <= TOLERANCE_PX).any(axis=0)
    true = np.flatnonzero(np.isfinite(stripes).any(axis=0))
    right = np.intersect1d(true, section[near])
    return np.array([len(true), len(right), said.sum(), (said & ~near & (peaks.flag == 0)).sum()])


def print_by_eye(real: Path) -> None:
    """What is right by eye in each set, and the points given without a laser."""
    sums: dict[str, np.ndarray] = {}
    every = truths()
    for name, file in dict.fromkeys((name, file) for name, file, _ in every):
        folder, _, channel = SETS[name]
        image = read(real / folder / file, channel)
        off = read(real / folder / OFF[name], channel) if name in OFF else None
        found = by_eye(detect_stripe(image, laser_off=off), [t for n, f, t in every if (n, f) == (name, file)])
        sums[name] = sums.get(name, 0) + found
        print(f"  {name} {file}: {found[1]} of {found[0]} sections, {found[3]} of {found[2]} points false")
    for name, (sections, right, points, false) in sums.items():
        print(f"{name:18s} by eye: right {100 * right / sections:.1f} %, false {100 * false / max(points, 1):.2f} %")
    dark = [real / SETS[name][0] / off for name, off in OFF.items()]
    dark += sorted((real / "ciclop/4.2. Camera calibration/captures").glob("*"))
    given = [detect_stripe(read(file, channel)) for file in dark for channel in (0, 1, 2)]
    some = sum(len(p) > 0 for p in given)
    print(
        f"without a laser: {len(given)} channels, points in {some}, {sum((p.flag == 0).sum() for p in given)} unflagged"
    )


def main() -> None:
    """Print a line per set and method."""
    real = Path(sys.argv[1] if len(sys.argv) > 1 else "real")
    if not real.is_dir():
        sys.exit(f"{real} is not there: name the folder of real images")
    print_by_eye(real)
    others: dict[str, Method] = {
        "centre of mass": centre_of_mass,
        "log-parabola": log_parabola,
        "brightest pixel (OpenCV)": brightest,
    }
    if os.environ.get("RIDGE_PYTHON"):
        others["ridge-detector (Steger)"] = ridge_detector
    for name, (folder, pattern, channel) in SETS.items():
        table: dict[str, list[float]] = {}
        scaled, curved, even, points, flagged = [], [], [], 0, 0
        files = sorted((real / folder).glob(pattern))
        for number, file in enumerate(files):
            image = read(file, channel)
            off = read(file.with_name(OFF[name]), channel) if name in OFF else None
            peaks = detect_stripe(image, laser_off=off)
            points, flagged = points + len(peaks), flagged + int((peaks.flag > 0).sum())
            if len(peaks) == 0:
                continue
            lying = abs(peaks.normal[0, 0]) > 0.5
            place, section = peaks.uv_px[:, 0 if lying else 1], peaks.section
            sheet = image if lying else np.ascontiguousarray(image.T)
            whole = slice(None)
            for run in runs(peaks):
                r = residual(section[run], place[run], whole, whole)
                table.setdefault("perceptron-emu", []).append(float(np.sqrt(np.mean(r**2))))
                scaled.append(float(np.sqrt(np.mean((r / peaks.sigma_px[run]) ** 2))))
                curved.append(float(np.sqrt(np.mean((bent(section[run], place[run]) / peaks.sigma_px[run]) ** 2))))
                e = residual(section[run], place[run], slice(1, None, 2), slice(0, None, 2))
                even.append(float(np.sqrt(np.mean((e / peaks.sigma_px[run][::2]) ** 2))))
            for label, method in others.items():
                if method is ridge_detector and number > 1:
                    continue  # it takes half a minute a frame
                theirs = method(sheet, section, place)
                for run in runs(peaks):
                    if np.isfinite(theirs[run]).all():
                        r = residual(section[run], theirs[run], whole, whole)
                        table.setdefault(label, []).append(float(np.sqrt(np.mean(r**2))))
        print(f"\n{name}: {len(files)} images, {points} points, {flagged} flagged")
        print(f"  residual over σ {np.median(scaled):.2f}, of even sections about odd ones' line {np.median(even):.2f}")
        print(f"  about a cubic {np.median(curved):.2f}")
        for label, values in table.items():
            print(f"  {label:26s} residual {np.median(values):.3f} px over {len(values)} runs")


if __name__ == "__main__":
    main()
