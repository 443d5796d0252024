"""From a slider's tick to the picture in the process window, in headless Chromium, on a dataset's full-size images.

    python benchmarks/window_ticks.py DATASET [--ticks 60]

Prints quantiles for each stage's tab, over several images; on a busy machine the 10 % quantile tells the work itself.
The clock starts with the input event and stops in the animation frame after the canvas was painted with the answer.
"""

from __future__ import annotations

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from selenium import webdriver
from selenium.webdriver.chrome.service import Service

FLAGS = "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --window-size=1440,900"
TABS = ("labels", "spots", "candidates", "mask", "background", "plot")
TICK = """
const [key, values, done] = arguments, root = document.documentElement.dataset;
const slider = document.querySelector(`[data-key="${key}"] input[type=range]`);
(async () => {
  const out = [];
  for (const value of values) {
    const before = root.shown;
    slider.value = value;
    slider.dispatchEvent(new Event('input'));
    while (root.shown === before) await new Promise((r) => setTimeout(r, 1));
    out.push(Number(root.ms));
    await new Promise((r) => setTimeout(r, 60));
  }
  done(out);
})();
"""


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--ticks", type=int, default=60)
    parser.add_argument("--key", default="detect.threshold")
    options = parser.parse_args()
    command = [
        sys.executable,
        "-m",
        "workbench",
        "tune",
        str(options.dataset),
        "--no-browser",
        "--out",
        tempfile.mkdtemp(),
    ]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)  # noqa: S603 - our own program
    try:
        assert server.stdout is not None
        measure(server.stdout.readline().split()[2], options.ticks, options.key)
    finally:
        server.terminate()


def measure(address: str, ticks: int, key: str) -> None:
    """Tick the slider on every tab, over the images in turn."""
    driver = browser()
    try:
        driver.get(address)
        wait(driver, "document.documentElement.dataset.shown")
        images = int(driver.execute_script("return document.querySelectorAll('#strip button').length"))
        wait(driver, f"document.documentElement.dataset.surveyed === '{images}'")
        size = driver.execute_script("return document.getElementById('title').title")
        print(f"{size}: {images} images, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores, slider {key}")
        for tab in TABS:
            driver.execute_script('document.querySelector(`[data-tab="${arguments[0]}"]`).click()', tab)
            taken: list[float] = []
            for index in np.linspace(0, images - 1, 6).astype(int):
                driver.execute_script("document.querySelectorAll('#strip button')[arguments[0]].click()", int(index))
                time.sleep(1.0)
                values = np.linspace(150, 700, ticks // 6).astype(int).tolist()
                taken += driver.execute_async_script(TICK, key, values)
            fast, median, p95 = np.quantile(taken, (0.1, 0.5, 0.95))
            print(
                f"  {tab:11} 10 % {fast:4.0f} ms   median {median:4.0f} ms   95 % {p95:4.0f} ms   of {len(taken)}",
                flush=True,
            )
    finally:
        driver.quit()


def browser() -> webdriver.Chrome:
    """Headless Chromium with an empty profile."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or shutil.which("google-chrome") or ""
    for flag in [*FLAGS.split(), f"--user-data-dir={tempfile.mkdtemp()}"]:
        options.add_argument(flag)
    driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
    driver.set_script_timeout(120)
    return driver


def wait(driver: webdriver.Chrome, condition: str, seconds: float = 120.0) -> None:
    """Wait for the page."""
    end = time.monotonic() + seconds
    while not driver.execute_script(f"return {condition}"):
        if time.monotonic() > end:
            sys.exit(f"{condition} did not come")
        time.sleep(0.05)


if __name__ == "__main__":
    main()
