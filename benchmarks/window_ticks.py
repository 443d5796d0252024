"""From a slider's tick to the picture in the process window, in headless Chromium, on full-size images, two panes.

    python benchmarks/window_ticks.py DATASET [--what stripe] [--ticks 60]

Prints the time from the command to the first picture, then quantiles for each layer, over several images; on a busy
machine the 10 % quantile tells the work itself.
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

FLAGS = "--headless=new --no-sandbox --disable-quic --no-first-run --window-size=1440,900"
NO_GPU = "--disable-gpu"
LAYERS = {"strings": ("labels", "rejected", "mask", "background"), "stripe": ("points", "width")}
KEYS = {"strings": "detect.threshold", "stripe": "stripe.min_snr"}
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
    parser.add_argument("--what", choices=LAYERS, default="strings")
    options = parser.parse_args()
    began = time.monotonic()
    what = ["--what", options.what]
    command = [sys.executable, "-m", "workbench", "tune", str(options.dataset), *what, "--no-browser"]
    command += ["--out", tempfile.mkdtemp()]
    server = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)  # noqa: S603 - our own program
    driver = browser()
    try:
        assert server.stdout is not None
        driver.get(server.stdout.readline().split()[2])
        wait(driver, "document.documentElement.dataset.shown")
        print(f"from the command to the first picture {time.monotonic() - began:.2f} s, the browser's own start in it")
        measure(driver, options.ticks, options.what)
    finally:
        driver.quit()
        server.terminate()


def measure(driver: webdriver.Chrome, ticks: int, what: str) -> None:
    """Tick the slider with each layer, over the images in turn."""
    images = int(driver.execute_script("return document.querySelectorAll('#strip button').length"))
    wait(driver, f"document.documentElement.dataset.surveyed === '{images}'")
    size = driver.execute_script("return document.getElementById('title').title")
    key = KEYS[what]
    print(f"{size}: {images} images, load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores, slider {key}")
    for layer in LAYERS[what]:
        button = f'document.querySelector(`[data-layer="{layer}"]`)'
        driver.execute_script(f"if ({button}.getAttribute('aria-pressed') !== 'true') {button}.click()")
        taken: list[float] = []
        for index in np.linspace(0, images - 1, 6).astype(int):
            driver.execute_script("document.querySelectorAll('#strip button')[arguments[0]].click()", int(index))
            time.sleep(1.0)
            values = np.linspace(150, 700, ticks // 6).astype(int).tolist()
            taken += driver.execute_async_script(TICK, key, values)
        fast, median, p95 = np.quantile(taken, (0.1, 0.5, 0.95))
        figures = f"10 % {fast:4.0f} ms   median {median:4.0f} ms   95 % {p95:4.0f} ms   of {len(taken)}"
        print(f"  {layer:11} {figures}", flush=True)
        if layer in ("rejected", "mask", "background", "width"):
            driver.execute_script(f"{button}.click()")


def browser(*more: str) -> webdriver.Chrome:
    """Headless Chromium with an empty profile; without a GPU unless more is asked for."""
    options = webdriver.ChromeOptions()
    options.binary_location = shutil.which("chromium") or shutil.which("google-chrome") or ""
    for flag in [*FLAGS.split(), *(more or (NO_GPU,)), f"--user-data-dir={tempfile.mkdtemp()}"]:
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
