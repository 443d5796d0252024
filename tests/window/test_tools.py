"""Stripes, profiles and boards in the page; the recipe's tools; regions; A/B; exports; languages; accessibility."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from extraction import ExtractionConfig, Reason, Seen, explain
from extraction.stripe.pictures import draw
from tests.window.chromium import ActionChains, Keys, Page, ended, needs_browser, press, served
from workbench.cli.main import run
from workbench.files import read_settings

pytestmark = [needs_browser, pytest.mark.processes]
STATIC = Path(__file__).parents[2] / "workbench" / "window" / "static"
ATOL_PX = 1.5e-3  # the page is told three decimals


@pytest.fixture(scope="module")
def stripes(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Three pictures of stripes without a sensor, one of another size, and a file that is none."""
    folder = tmp_path_factory.mktemp("stripes")
    for name, kind in (("a.png", "beside_a_border"), ("b.png", "white_core"), ("c.png", "texture")):
        cv2.imwrite(str(folder / name), draw(kind, np.random.default_rng(1)).image)
    cv2.imwrite(str(folder / "d.png"), np.full((100, 160), 90, np.uint8))
    (folder / "notes.txt").write_text("none")
    return folder


@pytest.fixture(scope="module")
def page(browser: Any, stripes: Path, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Page]:
    process, address = served(str(stripes), "--out", str(tmp_path_factory.mktemp("saved")))
    browser.get(address)
    opened = Page(browser)
    opened.until("document.documentElement.dataset.shown", 60)
    opened.until("document.documentElement.dataset.surveyed === '4'", 60)
    yield opened
    ended(process)


def test_without_a_sensor_the_stripe_is_measured_in_pixels(page: Page, stripes: Path, tmp_path: Path) -> None:
    """The page's points are those of `profile`; flags and refusals are counted by reason; no plane is shown."""
    answer = page.answer()
    assert run(["profile", str(stripes / "a.png"), "--csv", str(tmp_path / "a.csv")]) == 0
    rows = np.genfromtxt(tmp_path / "a.csv", delimiter=",", names=True, usecols=(0, 1, 2, 3))
    np.testing.assert_allclose(answer["stripe"]["u"], rows["u_px"], atol=ATOL_PX)
    np.testing.assert_allclose(answer["stripe"]["v"], rows["v_px"], atol=ATOL_PX)
    assert page.js("return getComputedStyle(document.getElementById('plane-pane')).display") == "none"
    page.image(1)
    page.until("document.getElementById('stripe-counts').textContent.includes('640')")
    assert "saturated" in page.find("#stripe-counts").text
    page.image(2)
    assert page.answer()["reason"].startswith("no stripe")


def test_a_picture_of_another_size_is_shown_whole(page: Page) -> None:
    """Without a sensor every size is right; the view follows it."""
    page.image(3)
    page.until("document.getElementById('message').textContent.startsWith('no stripe')")
    colours = page.js(
        """const c = document.getElementById('canvas');
        const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        const seen = new Set(); for (let i = 0; i < d.length; i += 400) seen.add(d[i]); return seen.size"""
    )
    assert colours > 1
    page.image(0)


def test_a_skipped_file_is_named(page: Page) -> None:
    page.until("document.getElementById('summary').textContent.includes('left out')")
    assert "notes.txt" in page.js("return document.querySelector('#summary .chip[title]').title")


def test_a_region_is_drawn_with_the_mouse_and_saved(page: Page, tmp_path: Path) -> None:
    """Clicks at corners, Enter closes; the points outside are gone; the saved recipe makes `profile` give the same."""
    page.image(0)
    whole = page.answer()["stripe"]["n"]
    page.find('[data-tool="region"] summary').click()
    page.find('[data-region="keep"]').click()
    corners = page.js(
        """const c = document.getElementById('canvas').getBoundingClientRect();
        const places = [[0.35, 0.1], [0.6, 0.1], [0.6, 0.9], [0.35, 0.9]];
        return places.map(([a, b]) => [Math.round(a * c.width), Math.round(b * c.height)])"""
    )
    canvas = page.find("#canvas")
    size = canvas.size
    for x, y in corners:
        ActionChains(page.driver).move_to_element_with_offset(
            canvas, x - size["width"] // 2, y - size["height"] // 2
        ).click().perform()
    press(page, Keys.ENTER)
    page.settled()
    kept = page.answer()["stripe"]
    assert 20 < kept["n"] < whole
    assert len(page.driver.find_elements("css selector", "#regions li")) == 1
    toml = page.driver.execute_async_script(
        """(async (done) => { const s = await import('./static/state.js'), a = await import('./static/api.js');
        done((await a.post('toml', { config: s.text() })).toml); })(arguments[0])"""
    )
    (tmp_path / "recipe.toml").write_text(toml, encoding="utf-8")
    assert len(read_settings([tmp_path / "recipe.toml"]).extraction.region.keep[0]) == 4
    page.find("#regions button").click()
    page.settled()
    assert page.answer()["stripe"]["n"] == whole


def test_a_tolerance_has_a_lamp(page: Page) -> None:
    page.image(0)
    page.find('[data-tool="stripe"] [data-value="points"] .tolerance').click()
    fields = page.driver.find_elements("css selector", '[data-tool="stripe"] [data-value="points"] .limits input')
    fields[0].send_keys("100000", Keys.TAB)
    page.settled()
    page.until("document.querySelector('[data-tool=\"stripe\"] .lamp').classList.contains('bad')")
    assert page.answer()["badge"] == "out"
    page.find("#undo").click()
    page.settled()
    page.until("!document.querySelector('[data-tool=\"stripe\"] .lamp').classList.contains('bad')")


def test_a_and_b_are_wiped_on_one_picture(page: Page) -> None:
    page.image(0)
    alone = page.drawing()
    page.slide("stripe.min_run", 1000)
    page.find('[data-layer="before"]').click()
    page.until("document.querySelector('[data-layer=\"before\"]').getAttribute('aria-pressed') === 'true'")
    page.driver.execute_async_script("setTimeout(arguments[0], 600)")
    both = page.drawing()
    assert both != alone
    page.find('[data-layer="before"]').click()
    page.find("#undo").click()
    page.settled()
    page.tab("history")
    page.until("document.querySelectorAll('#sets tbody tr').length >= 1")
    page.tab("image")


def test_the_filter_leaves_failed_frames(page: Page) -> None:
    choose = """const s = document.getElementById('filter-show');
    s.value = arguments[0]; s.dispatchEvent(new Event('change'))"""
    page.js(choose, "failed")
    shown = page.js("return [...document.querySelectorAll('#strip button')].map((b) => !b.hidden)")
    assert shown == [True, False, False, False]  # the shown one stays
    page.js(choose, "all")


def test_points_and_overlay_leave_the_page(page: Page, stripes: Path, tmp_path: Path) -> None:
    """The page's CSV is the command's, byte for byte; the SVG holds the picture and a mark for every point."""
    csv, svg = page.driver.execute_async_script(
        """(async (done) => {
        const s = await import('./static/state.js'), a = await import('./static/api.js');
        const g = await import('./static/stage.js');
        const kept = URL.createObjectURL; let blob; URL.createObjectURL = (b) => { blob = b; return kept(b); };
        await g.savePicture('svg'); URL.createObjectURL = kept;
        done([(await a.post('points', { index: 0, config: s.text() })).csv, await blob.text()]);
        })(arguments[0])"""
    )
    assert run(["profile", str(stripes / "a.png"), "--csv", str(tmp_path / "a.csv")]) == 0
    assert csv == (tmp_path / "a.csv").read_text(encoding="utf-8")
    assert svg.startswith("<svg")
    assert svg.count("<path") >= 640
    assert "data:image/png" in svg


def test_another_folder_is_opened_from_the_page(page: Page, stripes: Path, tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.mkdir()
    shutil.copy(stripes / "b.png", other / "only.png")
    page.find("#open").click()
    box = page.find("#open-folder")
    for path in (tmp_path / "nowhere", other):
        box.send_keys(Keys.CONTROL + "a")
        box.send_keys(str(path), Keys.ENTER)
        if path != other:
            page.until("document.getElementById('open-error').textContent.includes('no such')")
    page.until(
        "document.getElementById('title')?.textContent === 'other' && document.documentElement.dataset.shown", 30
    )
    assert len(page.driver.find_elements("css selector", "#strip button")) == 1
    page.driver.execute_async_script(
        """(async (folder, done) => { const a = await import('./static/api.js');
        await a.post('open', { folder }); done(); })(...arguments)""",
        str(stripes),
    )
    page.driver.refresh()
    page.until("document.documentElement.dataset.surveyed === '4'", 60)


def test_german_with_its_decimal_sign(page: Page) -> None:
    page.find("#language").click()
    page.until("document.documentElement.lang === 'de' && document.documentElement.dataset.shown", 30)
    assert page.find("#calibrate").text == "Kalibrieren"
    assert page.find('[data-layer="points"]').text == "Punkte"
    sigma = page.find('[data-tool="stripe"] [data-value="sigma_px"] output').text
    assert re.fullmatch(r"\d+,\d+ px", sigma)
    box = page.find('[data-key="stripe.min_snr"] input.number')
    box.send_keys(Keys.CONTROL + "a")
    box.send_keys("2,5", Keys.TAB)
    page.settled()
    assert page.js("return (1, document.querySelector('[data-key=\"stripe.min_snr\"] input.number').value)") == "2,5"
    found = page.violations()
    assert not found, found
    page.find("#language").click()
    page.until("document.documentElement.lang === 'en' && document.documentElement.dataset.shown", 30)
    assert page.find('[data-key="stripe.min_snr"] input.number').get_attribute("value") == "2.5"


def test_why_something_was_refused_is_german_too(page: Page) -> None:
    """Every reason of extraction, as it says it, and several flags of one spot."""
    seen = Seen(12.5, 3.25, 40.0, 9.0, 0.05, 0.01)
    said = [explain(reason, seen, ExtractionConfig())[0] for reason in Reason]
    german = page.driver.execute_async_script(
        """(async (said, done) => { const w = await import('./static/words.js');
        w.chooseLanguage('de'); const out = said.map(w.words); w.chooseLanguage('en');
        done([out, said.map(w.words)]); })(...arguments)""",
        [
            *said,
            "partly_hidden+crowded",
            "no stripe: ridges were seen and refused (3 faint, 2 one_of_many)",
            "a.png: gone",
        ],
    )
    assert german[1][: len(said)] == said
    assert not set(german[0]) & set(said)
    assert german[0][list(Reason).index(Reason.TOO_FAINT)].startswith("steht 12,5 DN über seiner Umgebung")
    assert german[0][-3:] == [
        "teils verdeckt, gedrängt",
        "kein Streifen: Grate wurden gesehen und verworfen (3 schwach, 2 einer von vielen)",
        "a.png: gone",
    ]


@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("tab", ["image", "sheet", "calibration", "history"])
def test_axe_finds_nothing(page: Page, theme: str, tab: str) -> None:
    if page.js("return document.documentElement.dataset.theme") != theme:
        page.find("#theme").click()
    page.tab(tab)
    page.driver.execute_async_script("setTimeout(arguments[0], 400)")
    found = page.violations()
    assert not found, found
    page.tab("image")


def test_nothing_is_cut_at_150_percent(page: Page) -> None:
    """A screen of 1280 × 720 at 150 % has 853 × 480 points: all is within its width, in German too, which is longer."""
    size = page.driver.get_window_size()
    inner = page.js("return [outerWidth - innerWidth, outerHeight - innerHeight]")
    page.driver.set_window_size(853 + inner[0], 480 + inner[1])
    try:
        for _ in range(2):
            page.find("#language").click()
            page.until("document.documentElement.dataset.shown", 30)
            page.until("document.querySelectorAll('.tool').length > 2", 30)
            assert page.js("return document.documentElement.scrollWidth <= innerWidth")
            cut = page.js(
                """return [...document.querySelectorAll('.bar button, .side-head *, .tabs button, .tools *')]
                .filter((n) => n.getBoundingClientRect().width && n.getBoundingClientRect().right > innerWidth + 0.5)
                .map((n) => n.id || n.textContent)"""
            )
            assert not cut, cut
            assert page.js("return document.getElementById('canvas').clientHeight") > 120
    finally:
        page.driver.set_window_size(size["width"], size["height"])


@pytest.mark.parametrize("key", ["save", "load", "export", "keys", "open"])
def test_axe_finds_nothing_in_the_dialogs(page: Page, key: str) -> None:
    page.find(f"#{key}").click()
    found = page.violations()
    press(page, Keys.ESCAPE)
    assert not found, found


def test_every_word_of_the_page_is_german_too() -> None:
    """Each text that the modules give to `t` stands in the table, with as many places for values."""
    table = (STATIC / "german.js").read_text(encoding="utf-8")
    pairs = dict(re.findall(r'"((?:[^"\\]|\\.)*)": "((?:[^"\\]|\\.)*)"', table))
    for path in STATIC.glob("*.js"):
        if path.name in ("german.js", "words.js"):
            continue
        for key in keys_of(path.read_text(encoding="utf-8")):
            assert key in pairs, (path.name, key)
            assert key.count("{}") == pairs[key].count("{}"), key
    for key in re.findall(r'data-t="([^"]*)"', (STATIC / "index.html").read_text(encoding="utf-8")):
        assert key in pairs, key


def keys_of(text: str) -> set[str]:
    """The texts in t("…") and t`…`, values as {}."""
    found = set(re.findall(r'\bt\("([^"]*)"\)', text))
    for start in re.finditer(r"\bt`", text):
        key, depth, i = "", 0, start.end()
        while text[i] != "`" or depth:
            if text[i : i + 2] == "${":
                depth, i = depth + 1, i + 2
                key += "{}" if depth == 1 else ""
                continue
            if depth and text[i] in "{}":
                depth += 1 if text[i] == "{" else -1
            elif not depth:
                key += text[i]
            i += 1
        found.add(key)
    return found
