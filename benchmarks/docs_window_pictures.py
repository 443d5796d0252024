"""The pictures of docs/window.md: every view of the process window at 1280 × 720 and 1920 × 1080, light and dark.

Run: python benchmarks/docs_window_pictures.py FOLDER [--only VIEW …] [--keep FOLDER] [--out FOLDER]; the first folder
holds cell_a, cell_s, cell_s_profiles and board_a; --keep takes the screenshots in their full size.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PIL import Image
from selenium import webdriver
from window_start import Served
from window_ticks import browser, wait

from assets import path as asset
from geometry import Pose
from perceptron_emu import EmulatorConfig, Scene, render
from perceptron_emu.solids import PanelPair
from workbench.files import read_sensor, write_png

SIZES = ((1280, 720), (1920, 1080))
THEMES = ("light", "dark")
TILE, EDGE, GREY = (760, 428), 4, (200, 200, 200)
COLOURS = 255
PANELS = ((4.2, 0.4), (4.2, -0.7), (5.1, 0.3), (4.2, 1.6))  # gap and flush [mm]; tolerances as in RECIPE
RECIPE = """what = "stripe"
[measure]
gap_and_flush = true
[tolerances.gap_mm]
min = 3.5
max = 4.5
[tolerances.flush_mm]
min = -1.0
max = 1.0
"""
STRIP = "document.querySelectorAll('#strip button').length"
ALL_SURVEYED = f"Number(document.documentElement.dataset.surveyed) === {STRIP}"
Steps = Callable[[webdriver.Chrome], None]


@dataclass(frozen=True)
class View:
    """One picture: what the command is given, the page of the window, and what is clicked before."""

    name: str
    arguments: tuple[str, ...]
    images: int
    tab: str
    steps: Steps


def views(data: Path, panels: Path) -> list[View]:
    """All of them."""
    cell, ball, profiles, board = (str(data / n) for n in ("cell_a", "cell_s", "cell_s_profiles/csv", "board_a"))
    bare = (str(panels), "--sensor", str(asset("sensors", "nominal")), "--recipe", str(panels / "panels.toml"))
    return [
        View("strings", (cell,), 28, "image", lambda d: (calibrated(d), image(d, 3))),
        View("calibration", (cell,), 28, "calibration", calibrated),
        View("history", (cell,), 28, "history", several_sets),
        View("ball", (ball,), 28, "image", lambda d: image(d, 2)),
        View("all_images", (ball,), 28, "sheet", lambda d: None),
        View(
            "table",
            (cell,),
            28,
            "sheet",
            lambda d: (image(d, 0), click(d, "[data-tab=sheet]"), click(d, "[data-form=table]")),
        ),
        View("panels", bare, len(PANELS), "image", lambda d: image(d, 3)),
        View("profiles", (profiles,), 28, "image", lambda d: image(d, 4)),
        View("board", (board,), 0, "image", lambda d: image(d, 1)),
    ]


def calibrated(driver: webdriver.Chrome) -> None:
    """Calibrate, and wait until the images are labelled anew."""
    click(driver, "#calibrate")
    wait(driver, "document.documentElement.dataset.calibrated", 240)
    time.sleep(8)


def several_sets(driver: webdriver.Chrome) -> None:
    """Three sets of parameters that were looked at and kept."""
    for where in (300, 620, 800):
        script = """const s = document.querySelector('[data-key="detect.threshold"] input[type=range]');
        s.value = arguments[0]; s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change'));"""
        driver.execute_script(script, where)
        time.sleep(1)
        wait(driver, "document.documentElement.dataset.surveyed === '28'", 240)
        time.sleep(4)
        click(driver, "[data-tab=history]")
        click(driver, "#keep-set")
        time.sleep(1)


def image(driver: webdriver.Chrome, index: int) -> None:
    """Show an image."""
    driver.execute_script("document.querySelectorAll('#strip button')[arguments[0]].click()", index)
    wait(driver, f"document.documentElement.dataset.shown.startsWith('{index}:')")


def click(driver: webdriver.Chrome, selector: str) -> None:
    """Click what a selector finds."""
    driver.execute_script("document.querySelector(arguments[0]).click()", selector)


def panels_folder() -> Path:
    """Rendered images of panels, and their recipe."""
    folder = Path(tempfile.mkdtemp()) / "panels"
    folder.mkdir()
    sensor, place = read_sensor(asset("sensors", "nominal")), Pose(np.eye(3), np.array([0, 0, 300.0]))
    config = EmulatorConfig.model_validate({"exposure": {"time_ms": 0.3}})
    for i, (gap, flush) in enumerate(PANELS):
        solids = PanelPair(gap_mm=gap, flush_mm=flush, radii_mm=(1.5, 2.5)).solids(place)
        write_png(
            folder / f"{i:03d}.png", render(Scene(sensor, None, solids=solids), config, np.random.default_rng(i)).image
        )
    (folder / "panels.toml").write_text(RECIPE, encoding="utf-8")
    return folder


def shots(driver: webdriver.Chrome, view: View, keep: Path) -> np.ndarray:
    """The view in every size and both themes, side by side."""
    rows = []
    for size in SIZES:
        row = []
        for theme in THEMES:
            resize(driver, *size)
            if driver.execute_script("return document.documentElement.dataset.theme") != theme:
                click(driver, "#theme")
            click(driver, f"[data-tab={view.tab}]")
            time.sleep(2)
            path = keep / f"{view.name}_{size[0]}_{theme}.png"
            driver.save_screenshot(str(path))
            tile = cv2.resize(cv2.imread(str(path)), TILE, interpolation=cv2.INTER_AREA)
            row.append(cv2.copyMakeBorder(tile, EDGE, EDGE, EDGE, EDGE, cv2.BORDER_CONSTANT, value=GREY))
        rows.append(np.hstack(row))
    return np.vstack(rows)


def resize(driver: webdriver.Chrome, width: int, height: int) -> None:
    """The page itself gets this size."""
    for _ in range(4):
        inner = driver.execute_script("return [innerWidth, innerHeight]")
        if inner == [width, height]:
            return
        outer = driver.execute_script("return [outerWidth, outerHeight]")
        driver.set_window_size(outer[0] + width - inner[0], outer[1] + height - inner[1])
        time.sleep(0.4)


def main() -> None:
    """Write the pictures."""
    parser = argparse.ArgumentParser()
    parser.add_argument("data", type=Path)
    parser.add_argument("--only", nargs="*")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "docs/pictures")
    options = parser.parse_args()
    if not options.data.is_dir():
        sys.exit(f"{options.data} is not there: name the folder of cell_a, cell_s, cell_s_profiles and board_a")
    keep = options.keep or Path(tempfile.mkdtemp())
    keep.mkdir(exist_ok=True)
    driver = browser("--enable-unsafe-swiftshader", "--use-angle=swiftshader", "--ignore-gpu-blocklist")
    try:
        for view in views(options.data, panels_folder()):
            if options.only and view.name not in options.only:
                continue
            server = Served(*view.arguments, "--no-browser")
            try:
                driver.get(server.address)
                wait(driver, "document.documentElement.dataset.shown", 240)
                wait(driver, ALL_SURVEYED, 240)
                time.sleep(4)
                view.steps(driver)
                montage = shots(driver, view, keep)
            finally:
                server.end()
            few = Image.fromarray(montage[..., ::-1]).quantize(
                COLOURS, method=Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE
            )
            few.save(options.out / f"window_{view.name}.png", optimize=True)
            print(f"  {view.name}", flush=True)
    finally:
        driver.quit()


if __name__ == "__main__":
    main()
