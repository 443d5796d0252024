"""A record on paper: no column is cut on A4 or Letter, and its one script is the page's own."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from tests.window.chromium import Page, needs_browser
from workbench.cli.main import run

pytestmark = [needs_browser, pytest.mark.processes]
PX_PER_MM = 96 / 25.4
MARGIN_MM = 14.0  # of @page, at each side


@pytest.fixture(scope="module")
def page(browser: Any, cell_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Page:
    path = tmp_path_factory.mktemp("report") / "report.html"
    assert run(["calibrate", str(cell_folder), "--report", str(path)]) == 0
    browser.get_log("browser")
    browser.get(path.as_uri())
    return Page(browser)


def test_the_page_s_own_script_runs_and_nothing_else_is_asked_for(page: Page) -> None:
    assert page.js("return typeof startScene") == "function"
    assert not [e for e in page.driver.get_log("browser") if "Content Security" in e["message"]]


@pytest.mark.parametrize(("paper", "width_mm"), [("A4", 210.0), ("Letter", 215.9)])
def test_no_column_is_cut(page: Page, paper: str, width_mm: float) -> None:
    """Every cell, heading and picture lies within the sheet's margins; where pages break is not proved."""
    width = round((width_mm - 2 * MARGIN_MM) * PX_PER_MM)
    page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": "print"})
    page.driver.execute_cdp_cmd(
        "Emulation.setDeviceMetricsOverride", {"width": width, "height": 1000, "deviceScaleFactor": 1, "mobile": False}
    )
    try:
        cut = page.js(
            """return [...document.querySelectorAll('td, th, img, pre, p, h2')]
            .filter((n) => n.getBoundingClientRect().width && n.getBoundingClientRect().right > innerWidth + 1)
            .map((n) => n.tagName + ' ' + n.textContent.slice(0, 60))"""
        )
    finally:
        page.driver.execute_cdp_cmd("Emulation.setEmulatedMedia", {"media": ""})
        page.driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    assert not cut, (paper, cut)
