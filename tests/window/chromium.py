"""The page in headless Chromium, as a person meets it."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

webdriver = pytest.importorskip("selenium.webdriver", reason="selenium is not installed")
from selenium.webdriver.chrome.service import Service  # noqa: E402 - after the skip
from selenium.webdriver.common.action_chains import ActionChains  # noqa: E402
from selenium.webdriver.common.by import By  # noqa: E402
from selenium.webdriver.common.keys import Keys  # noqa: E402

__all__ = ["ActionChains", "By", "Keys", "Page", "chromium", "ended", "needs_browser", "press", "served"]

BROWSER = next((b for n in ("chromium", "chromium-browser", "google-chrome") if (b := shutil.which(n))), None)
DRIVER = shutil.which("chromedriver")
needs_browser = pytest.mark.skipif(not (BROWSER and DRIVER), reason="no Chromium with chromedriver is installed")

AXE = Path(__file__).parents[1] / "assets" / "axe" / "axe.min.js"
FLAGS = (
    "--headless=new --no-sandbox --disable-gpu --disable-quic --no-first-run --disable-background-networking "
    "--disable-component-update --disable-sync --window-size=1366,768"
)


def chromium(profile: Path) -> Iterator[Any]:
    """A browser without a window, with a profile of its own."""
    options = webdriver.ChromeOptions()
    options.binary_location = BROWSER
    for flag in [*FLAGS.split(), f"--user-data-dir={profile}"]:
        options.add_argument(flag)
    options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
    driver = webdriver.Chrome(options=options, service=Service(DRIVER))
    driver.set_script_timeout(60)
    yield driver
    driver.quit()


def served(*arguments: str) -> tuple[subprocess.Popen[str], str]:
    """The command as a user starts it, and the address that it prints."""
    command = [sys.executable, "-m", "workbench", "tune", *arguments, "--no-browser"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env={**os.environ, "OMP_NUM_THREADS": "1"})
    assert process.stdout is not None
    line = process.stdout.readline()
    assert "http://127.0.0.1:" in line, line
    return process, line.split()[2]


def ended(process: subprocess.Popen[str]) -> None:
    process.terminate()
    process.wait(10)
    if process.stdout is not None:
        process.stdout.close()


class Page:
    """The page as a person sees it."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def js(self, code: str, *arguments: object) -> Any:
        """Run a script in the page."""
        return self.driver.execute_script(code, *arguments)

    def until(self, condition: str, seconds: float = 20.0) -> Any:
        """Wait for an expression to be true."""
        end = time.monotonic() + seconds
        while not (found := self.js(f"return {condition}")):
            assert time.monotonic() < end, (
                f"{condition} did not come: {self.js('return document.body.innerText')[:600]}"
            )
            time.sleep(0.02)
        return found

    def find(self, selector: str) -> Any:
        """The first element that fits."""
        return self.driver.find_element(By.CSS_SELECTOR, selector)

    @property
    def shown(self) -> str:
        """Image and hash of the picture."""
        return str(self.js("return document.documentElement.dataset.shown"))

    def violations(self) -> list[str]:
        """What axe-core finds wrong in the page as it stands, contrast included."""
        self.driver.execute_script(AXE.read_text(encoding="utf-8"))
        found = self.driver.execute_async_script(
            "axe.run(document, { resultTypes: ['violations'] }).then((r) => arguments[0](r.violations))"
        )
        return [f"{v['id']}: {n['html'][:160]}" for v in found for n in v["nodes"]]

    def settled(self) -> None:
        """Wait until the picture shows the newest parameters."""
        self.driver.execute_async_script(
            """const done = arguments[0];
            const state = (await import('./static/state.js')), api = await import('./static/api.js');
            for (;;) {
              const want = `${state.state.index}:${await api.hashOf(state.text())}`;
              if (document.documentElement.dataset.shown === want) return done();
              await new Promise((r) => setTimeout(r, 10));
            }""".replace("const done", "(async () => { const done", 1)
            + "})()"
        )

    def tab(self, name: str) -> None:
        """Choose a stage."""
        self.find(f'[data-tab="{name}"]').click()

    def layers(self, *wanted: str) -> None:
        """Show the page of one image with exactly these layers."""
        self.tab("image")
        for button in self.driver.find_elements(By.CSS_SELECTOR, "#layers button"):
            on = button.get_attribute("aria-pressed") == "true"
            if on != (button.get_attribute("data-layer") in wanted):
                button.click()
        self.settled()

    def image(self, index: int) -> None:
        """Choose an image and wait for it."""
        self.js("document.querySelectorAll('#strip button')[arguments[0]].click()", index)
        self.settled()

    def slide(self, key: str, where: int) -> None:
        """Move a slider to ``where`` of 1000, as one movement of the hand."""
        self.js(
            """const s = document.querySelector(`[data-key="${arguments[0]}"] input[type=range]`);
            s.value = arguments[1]; s.dispatchEvent(new Event('input')); s.dispatchEvent(new Event('change'));""",
            key,
            where,
        )
        self.settled()

    def value(self, key: str) -> float:
        """A parameter's number."""
        return float(self.js('return document.querySelector(`[data-key="${arguments[0]}"] input.number`).value', key))

    def answer(self) -> dict[str, Any]:
        """What the server answers to the page's parameters, asked through the page."""
        return dict(
            self.driver.execute_async_script(
                """(async (done) => { const s = await import('./static/state.js'), a = await import('./static/api.js');
                done(await a.post('process', { index: s.state.index, config: s.text() })); })(arguments[0])"""
            )
        )

    def drawing(self) -> str:
        """The canvas as it is painted, once what was asked for has been drawn."""
        return str(
            self.driver.execute_async_script(
                """const done = arguments[0];
                requestAnimationFrame(() => requestAnimationFrame(() =>
                  done(document.getElementById('canvas').toDataURL())));"""
            )
        )

    def point_at(self, u: float, v: float, click: bool = False) -> None:
        """Move the pointer to a pixel of the image, which is shown whole; tests the page's own transform too."""
        canvas = self.find("#canvas")
        w, h, sensor = self.js(
            "const c = document.getElementById('canvas'); return [c.clientWidth, c.clientHeight, [640, 512]]"
        )
        scale = min(w / sensor[0], h / sensor[1]) * 0.99
        x, y = (u - (sensor[0] - 1) / 2) * scale, (v - (sensor[1] - 1) / 2) * scale
        action = ActionChains(self.driver).move_to_element_with_offset(canvas, round(x), round(y))
        (action.click() if click else action).perform()


def press(page: Page, *keys: str) -> None:
    """Type."""
    ActionChains(page.driver).send_keys(*keys).perform()
