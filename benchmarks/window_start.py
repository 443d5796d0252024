"""The process window from the command to the first picture, with ten thousand images, and beside a running cell.

    python benchmarks/window_start.py start DATASET [--times 3]
    python benchmarks/window_start.py many DATASET [--images 10000]
    python benchmarks/window_start.py watched DATASET [--images 12]

start    what the server takes, over HTTP without a browser; then the command with headless Chromium as its browser
many     the dataset's images, linked again and again: opening, memory, a slider's tick, a change of image
watched  a folder that images are written into: from a file's end to its values on the screen

Times are of the wall; the server's own processor time stands beside them: a busy machine stretches the wall alone.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import subprocess
import sys
import tempfile
import time
import urllib.request
from pathlib import Path

import numpy as np
from selenium import webdriver
from selenium.webdriver.chrome.service import Service
from window_ticks import FLAGS, NO_GPU, TICK, browser, wait

SHOWN = "return performance.timeOrigin + performance.getEntriesByName(arguments[0])[0]?.startTime"


def main() -> None:
    """Print what was asked for."""
    parser = argparse.ArgumentParser()
    parser.add_argument("what", choices=("start", "many", "watched"))
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--images", type=int)
    options = parser.parse_args()
    print(f"load {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")
    if options.what == "start":
        for _ in range(options.times):
            over_http(options.dataset)
            with_browser(options.dataset)
    elif options.what == "many":
        many(options.dataset, options.images or 10_000)
    else:
        watched(options.dataset, options.images or 12)


class Served:
    """The command running, its address, and what it has cost."""

    def __init__(self, *arguments: str, env: dict[str, str] | None = None) -> None:
        command = [sys.executable, "-m", "workbench", "tune", *arguments, "--out", tempfile.mkdtemp()]
        self.began, self.epoch = time.monotonic(), time.time()
        more = {"stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL, "env": {**os.environ, **(env or {})}}
        self.process: subprocess.Popen[str] = subprocess.Popen(command, text=True, **more)  # type: ignore[call-overload]  # noqa: S603 - our own program
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().split()[2]
        self.say("address printed")

    def say(self, what: str) -> None:
        """One line: what, since the command."""
        print(f"  {what:34} {time.monotonic() - self.began:6.2f} s wall {self.cpu():6.2f} s processor", flush=True)

    def cpu(self) -> float:
        """Processor time of the server [s]."""
        fields = Path(f"/proc/{self.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def memory_mb(self) -> tuple[float, float]:
        """Memory of the server now, and at most."""
        lines = Path(f"/proc/{self.process.pid}/status").read_text().splitlines()
        table = dict(line.split(":", 1) for line in lines)
        return tuple(int(table[k].split()[0]) / 1024 for k in ("VmRSS", "VmHWM"))  # type: ignore[return-value]

    def ask(self, path: str, body: object = None) -> bytes:
        """What the page would ask."""
        headers = {"content-type": "application/json", "origin": self.address.rsplit("/", 2)[0]}
        data = None if body is None else json.dumps(body).encode()
        request = urllib.request.Request(self.address + path, data, {} if body is None else headers)  # noqa: S310
        with urllib.request.urlopen(request) as answer:  # noqa: S310 - our own server
            return bytes(answer.read())

    def end(self) -> None:
        """Stop the server."""
        self.process.terminate()
        self.process.wait()


def over_http(dataset: Path) -> None:
    """The server's part alone."""
    print("over HTTP, without a browser")
    server = Served(str(dataset), "--no-browser")
    try:
        server.ask("")
        server.say("page")
        session = json.loads(server.ask("api/session"))
        server.say("folder open")
        server.ask("api/image/0")
        server.ask("api/process", {"index": 0, "config": json.dumps(session["start"])})
        server.say("first picture and its points")
    finally:
        server.end()


def with_browser(dataset: Path) -> None:
    """The command as a user gives it: it opens the browser itself."""
    print("with Chromium, started by the command")
    folder = tempfile.mkdtemp()
    binary = shutil.which("chromium") or shutil.which("google-chrome") or ""
    line = f"{binary} {FLAGS} {NO_GPU} --remote-debugging-port=0 --user-data-dir={folder} %s &"
    server = Served(str(dataset), env={"BROWSER": line})
    try:
        port = Path(folder) / "DevToolsActivePort"
        while not port.exists():
            time.sleep(0.1)
        time.sleep(8)  # nothing is asked of the browser meanwhile
        options = webdriver.ChromeOptions()
        options.debugger_address = f"127.0.0.1:{port.read_text().split()[0]}"
        driver = webdriver.Chrome(options=options, service=Service(shutil.which("chromedriver")))
        driver.switch_to.window(driver.window_handles[0])
        wait(driver, "document.documentElement.dataset.shown")
        shown = driver.execute_script(SHOWN, "shown 0") / 1000 - server.epoch
        navigated = driver.execute_script("return performance.timeOrigin") / 1000 - server.epoch
        picture = driver.execute_script(SHOWN, "picture") / 1000 - server.epoch
        for what, at in (
            ("browser asks for the page", navigated),
            ("first picture painted", picture),
            ("its points, too", shown),
        ):
            print(f"  {what:34} {at:6.2f} s wall")
        driver.execute_cdp_cmd("Browser.close", {})
        driver.quit()
    finally:
        server.end()


def many(dataset: Path, images: int) -> None:
    """So many images: hard links of the dataset's."""
    found = sorted((dataset / "images").glob("*.png"))
    folder = Path(tempfile.mkdtemp())
    try:
        first = [Path(shutil.copy(p, folder / f"first_{i}.png")) for i, p in enumerate(found)]
        for i in range(images):
            os.link(first[i % len(first)], folder / f"{i:06d}.png")
        for p in first:
            p.unlink()
        _many(dataset, folder, images)
    finally:
        shutil.rmtree(folder)


def _many(dataset: Path, folder: Path, images: int) -> None:
    driver = browser()
    server = Served(str(folder), "--sensor", str(dataset / "sensor.toml"), "--what", "strings", "--no-browser")
    try:
        driver.get(server.address)
        wait(driver, "document.documentElement.dataset.shown")
        shown = driver.execute_script(SHOWN, "shown 0") / 1000
        asked = driver.execute_script("return performance.timeOrigin") / 1000
        since = (shown - server.epoch, shown - asked)
        said = "first picture {:.2f} s after the command, {:.2f} s after the page was asked for".format(*since)
        print(f"  {images} images: {said}")
        for layer in ("surveyed", "table"):
            if layer == "table":
                driver.execute_script("document.querySelector('[data-tab=sheet]').click()")
                driver.execute_script("document.querySelectorAll('#sheet .choice button')[1].click()")
            time.sleep(12)
            ticks = (
                driver.execute_async_script(TICK, "detect.threshold", np.linspace(200, 600, 20).astype(int).tolist())
                if layer == "surveyed"
                else []
            )
            if ticks:
                print("  a tick {:.0f} ms, 95 % {:.0f} ms".format(*np.quantile(ticks, (0.5, 0.95))))
        heap = driver.execute_script("return performance.memory.usedJSHeapSize") / 2**20
        done = driver.execute_script("return document.documentElement.dataset.surveyed")
        drawn = driver.execute_script("return document.querySelectorAll('#sheet tr.go').length")
        now, most = server.memory_mb()
        print(
            f"  {done} measured; server {now:.0f} MB, at most {most:.0f}; page's heap {heap:.0f} MB; rows drawn {drawn}"
        )
        driver.execute_script("document.querySelector('[data-tab=image]').click()")
        for index in np.linspace(10, images - 10, 8).astype(int):
            before = time.monotonic()
            driver.execute_script("document.querySelectorAll('#strip button')[arguments[0]].click()", int(index))
            wait(driver, f"document.documentElement.dataset.shown.startsWith('{index}:')")
            print(f"  image {index} shown in {(time.monotonic() - before) * 1000:.0f} ms")
    finally:
        driver.quit()
        server.end()


def watched(dataset: Path, images: int) -> None:
    """Images written one after another."""
    found = sorted((dataset / "images").glob("*.png"))
    folder = Path(tempfile.mkdtemp())
    shutil.copy(found[0], folder / "000.png")
    driver = browser()
    sensor = ["--sensor", str(dataset / "sensor.toml"), "--jig", str(dataset / "jig.toml")]
    server = Served(str(folder), *sensor, "--watch", "--no-browser")
    taken = []
    try:
        driver.get(server.address)
        wait(driver, "document.documentElement.dataset.surveyed === '1'")
        for i in range(1, images + 1):
            time.sleep(0.7)
            shutil.copyfile(found[i % len(found)], folder / f"{i:03d}.png")
            closed = time.time()
            wait(driver, f"document.documentElement.dataset.shown.startsWith('{i}:')")
            taken.append(driver.execute_script(SHOWN, f"shown {i}") - closed * 1000)
        quantiles = np.quantile(taken, (0.1, 0.5, 0.95))
        print(
            "  file closed to values on the screen: 10 % {:.0f} ms, median {:.0f}, 95 % {:.0f}".format(*quantiles),
            f"of {images}",
        )
    finally:
        driver.quit()
        server.end()
        shutil.rmtree(folder)


if __name__ == "__main__":
    main()
