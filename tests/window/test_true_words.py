"""What the page says is so: of the file as it is now, of the parameters as they are now, of what was measured."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from tests.window.chromium import Keys, Page, ended, needs_browser, served
from workbench.window.serve import way_in

pytestmark = [needs_browser, pytest.mark.processes]


@pytest.fixture(scope="module")
def folder(cell_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Bare images: five spots, a white image, and a name with underscores that is not an image."""
    folder = tmp_path_factory.mktemp("bare") / "images"
    folder.mkdir()
    shutil.copy(cell_folder / "images" / "000.png", folder / "a.png")
    cv2.imwrite(str(folder / "b_white.png"), np.full((512, 640), 255, np.uint8))
    small = cv2.imread(str(cell_folder / "images" / "000.png"), cv2.IMREAD_UNCHANGED)
    cv2.imwrite(str(folder / "d_half.png"), np.maximum(small[::2, ::2], 40))
    cv2.imwrite(str(folder / "e_lossy.jpg"), small)
    (folder / "c_cut_short.png").write_bytes((cell_folder / "images" / "001.png").read_bytes()[:5000])
    return folder


@pytest.fixture(scope="module")
def bare(browser: Any, folder: Path, cell_folder: Path) -> Iterator[Page]:
    process, address = served(str(folder), "--sensor", str(cell_folder / "sensor.toml"), "--what", "strings")
    browser.get(address)
    page = Page(browser)
    page.until("document.documentElement.dataset.surveyed === '5'", 60)
    yield page
    ended(process)


def test_without_a_jig_spots_are_counted_in_grey(bare: Page) -> None:
    badge = "document.querySelectorAll('#strip .badge')[0]"
    assert bare.js(f"return {badge}.className") == "badge count"
    assert int(bare.js(f"return {badge}.textContent")) == len(bare.answer()["spots"]) > 0
    assert "all found" not in bare.js("return document.body.innerText")


def test_a_white_image_has_a_white_small_picture(bare: Page) -> None:
    brightness = bare.driver.execute_async_script(
        """const done = arguments[0], image = new Image();
        image.onload = () => { const c = new OffscreenCanvas(1, 1).getContext('2d');
          c.drawImage(image, 0, 0, 1, 1); done(c.getImageData(0, 0, 1, 1).data[0]); };
        image.src = document.querySelectorAll('#strip img')[1].src;"""
    )
    assert brightness > 250


def test_a_picture_of_another_size_has_no_figures(bare: Page) -> None:
    """It is shown, small and large; no count of what was not looked for, no histogram of the image before."""
    bare.image(1)
    bare.image(3)
    bare.until("!document.getElementById('notice').hidden")
    assert "320 × 256" in bare.find("#notice").text
    assert bare.find("#inspector").text.split() == ["This", "image", "not", "measured"]
    empty = """(() => { const c = document.getElementById('histogram');
        return c.getContext('2d').getImageData(0, 0, c.width, c.height).data.every((v) => v === 0); })()"""
    assert bare.js(f"return {empty}")
    bare.until("document.querySelectorAll('#strip img')[3].naturalWidth > 0", 5)
    bare.image(0)
    assert not bare.js(f"return {empty}")


def test_a_lossy_picture_is_remarked(bare: Page) -> None:
    bare.image(4)
    bare.until("document.getElementById('inspector').textContent.includes('is a JPEG')")
    bare.image(0)
    assert "JPEG" not in bare.find("#inspector").text


def test_what_is_no_number_changes_nothing(bare: Page) -> None:
    """Half of 1.234,5 is not taken for it, nor a thousand with its comma for one."""
    bare.image(0)
    box = bare.find('[data-key="detect.threshold"] input.number')
    before = bare.value("detect.threshold")
    for typed in ("1.234,5", "1,000", "1_000", "0x10", "1e400", "abc"):
        box.send_keys(Keys.CONTROL + "a")
        box.send_keys(typed, Keys.TAB)
        bare.until("document.getElementById('message').textContent.includes('is no number')")
        bare.settled()
        assert bare.value("detect.threshold") == before
    for typed, value in (("7e0", 7.0), ("0,125", 0.125), (".5", 0.5), ("6,5", 6.5)):
        box.send_keys(Keys.CONTROL + "a")
        box.send_keys(typed, Keys.TAB)
        bare.settled()
        assert bare.value("detect.threshold") == value
    bare.find('[data-key="detect.threshold"] .reset').click()
    bare.settled()


def test_an_image_under_wrong_parameters_is_not_the_one_before(bare: Page) -> None:
    """The picture that stays is another's, and says so, until the parameters are right."""
    bare.image(0)
    box = bare.find('[data-key="detect.threshold"] input.number')
    box.send_keys(Keys.CONTROL + "a")
    box.send_keys("-5", Keys.TAB)
    bare.until("document.querySelector('.parameter.wrong')")
    assert bare.js("return document.getElementById('notice').hidden")
    bare.js("document.querySelectorAll('#strip button')[1].click()")
    bare.until("document.getElementById('notice').textContent.includes('detect.threshold')")
    assert bare.shown.startswith("0:")
    bare.find('[data-key="detect.threshold"] .reset').click()
    bare.settled()
    assert bare.js("return document.getElementById('notice').hidden")


def test_a_slow_picture_says_whose_is_shown(bare: Page) -> None:
    bare.image(0)
    bare.js(
        """window.realFetch = window.fetch;
        window.fetch = async (path, options) => {
          await new Promise((r) => setTimeout(r, 900));
          return window.realFetch(path, options);
        };"""
    )
    bare.js("document.querySelectorAll('#strip button')[1].click()")
    bare.until("!document.getElementById('notice').hidden", 3)
    assert "b_white.png" in bare.find("#notice").text
    assert "a.png" in bare.find("#notice").text
    bare.js("window.fetch = window.realFetch")
    bare.settled()
    assert bare.js("return document.getElementById('notice').hidden")


def test_the_largest_sigma_is_one_figure(bare: Page) -> None:
    bare.image(0)
    shown = bare.js("return document.querySelector('[data-tool=strings] [data-value=sigma_mm] output').textContent")
    bare.js(
        """const s = document.getElementById('trend-value');
        s.selectedIndex = [...s.options].findIndex((o) => o.textContent.includes('σ'));
        s.dispatchEvent(new Event('change'));"""
    )
    assert bare.find("#trend-text").text.split()[-1] == shown.split()[0]


def test_names_and_legend_do_not_cover_the_points(bare: Page) -> None:
    """Fitted, every point of the laser plane stands clear of the legend, the axes' names and their numbers."""
    bare.image(0)
    bare.find("#fit").click()
    spots = bare.driver.execute_async_script(
        """(async (done) => { const { stage } = await import('./static/stage.js');
        document.getElementById('plane').focus();
        const view = stage.view(); done(stage.answer.spots.map((s) => view.toScreen(...s.surface))); })(arguments[0])"""
    )
    width, height = bare.js("const c = document.getElementById('plane'); return [c.clientWidth, c.clientHeight]")
    legend = bare.js("const l = document.getElementById('plane-legend'); return l.offsetTop + l.offsetHeight")
    assert len(spots) > 3
    for x, y in spots:
        assert 30 < x < width - 20
        assert legend < y < height - 30


def test_names_keep_their_underscores(bare: Page) -> None:
    bare.tab("sheet")
    bare.js("document.querySelectorAll('#sheet .choice button')[1].click()")
    assert "c_cut_short.png" in bare.js("return document.querySelectorAll('#sheet tr.go')[2].innerText")
    bare.tab("image")


def test_what_was_not_measured_has_no_number(bare: Page) -> None:
    bare.js(
        """window.realFetch = window.fetch;
        window.fetch = async (path, options) => {
          const r = await window.realFetch(path, options);
          if (!String(path).endsWith('process')) return r;
          const body = await r.json(); body.spots.forEach((s) => { s.width[0] = null; });
          return new Response(JSON.stringify(body), { status: 200 });
        };"""
    )
    bare.image(1)
    bare.image(0)
    bare.js("window.fetch = window.realFetch")
    bare.find("#canvas").send_keys("n")
    bare.until("document.querySelector('#inspector').textContent.includes('lengthnot measured')")


def test_the_time_counts_from_the_asking(bare: Page) -> None:
    """A picture that comes by itself, here of a file written anew, did not take since the last click."""
    bare.image(0)
    bare.js("document.documentElement.dataset.ms = ''")
    bare.driver.execute_async_script("setTimeout(arguments[0], 700)")
    bare.js("import('./static/stage.js').then((s) => s.refresh())")
    bare.until("document.documentElement.dataset.ms !== ''")
    assert float(bare.js("return document.documentElement.dataset.ms")) < 650


def test_a_file_written_anew_is_shown_anew(bare: Page, folder: Path, cell_folder: Path) -> None:
    """The picture under the spots is the file that they were found in, without a click."""
    bare.image(0)
    before, spots = bare.drawing(), bare.js("return document.querySelectorAll('#strip .badge')[0].textContent")
    small = bare.js("return document.querySelectorAll('#strip img')[0].src")
    image = cv2.imread(str(cell_folder / "images" / "000.png"), cv2.IMREAD_UNCHANGED)
    part = folder.parent / "part.png"
    cv2.imwrite(str(part), np.zeros_like(image))
    part.replace(folder / "a.png")
    bare.until("document.querySelectorAll('#strip .badge')[0].textContent === '0'", 15)
    assert spots != "0"
    bare.until("document.querySelectorAll('#strip img')[0].src !== arguments[0]".replace("arguments[0]", f"'{small}'"))
    dark = """(() => { const c = document.getElementById('canvas'), x = c.width / 2 | 0, y = c.height / 2 | 0;
        const d = c.getContext('2d').getImageData(x - 100, y - 100, 200, 200).data;
        return d.every((v, i) => i % 4 === 3 || v < 8); })()"""
    bare.until(dark, 10)
    assert bare.drawing() != before
    shutil.copy(cell_folder / "images" / "000.png", folder / "a.png")


def test_clipped_pixels_are_counted_with_what_to_do(bare: Page) -> None:
    bare.image(1)
    bare.until("document.getElementById('inspector').textContent.includes('Halve the exposure')")
    assert f"{512 * 640} px clipped" in bare.js("return document.getElementById('inspector').textContent")


def test_a_calibration_is_marked_once_parameters_changed(browser: Any, cell_folder: Path, tmp_path: Path) -> None:
    process, address = served(str(cell_folder), "--out", str(tmp_path))
    try:
        browser.get(address)
        page = Page(browser)
        page.until("document.documentElement.dataset.shown", 60)
        page.find("#calibrate").click()
        page.until("document.documentElement.dataset.calibrated", 120)
        assert page.js("return document.querySelector('#calibration .worse')") is None
        page.slide("detect.threshold", 700)
        page.until("document.querySelector('#calibration .worse') !== null")
        page.find("#undo").click()
        page.until("document.querySelector('#calibration .worse') === null")
    finally:
        ended(process)


def test_another_folder_in_another_page_is_not_taken_for_this_one(
    browser: Any, folder: Path, cell_folder: Path
) -> None:
    """Where one page opens another folder, the other page's names never stand beside the new folder's pictures."""
    process, address = served(str(folder), "--sensor", str(cell_folder / "sensor.toml"), "--what", "strings")
    here = browser.current_window_handle
    try:
        browser.get(address)
        page = Page(browser)
        page.until("document.documentElement.dataset.surveyed === '5'", 60)
        browser.switch_to.new_window("tab")
        browser.get(address)
        page.until("document.documentElement.dataset.shown", 60)
        page.find("#open").click()
        box = page.find("#open-folder")
        box.clear()
        box.send_keys(str(cell_folder))
        page.find("#open-go").click()
        page.until("document.querySelectorAll('#strip button').length === 28", 30)
        browser.close()
        browser.switch_to.window(here)
        before = page.drawing()
        page.js("document.querySelectorAll('#strip button')[1].click()")
        page.until("document.getElementById('notice').textContent.includes('Another folder')")
        assert page.shown.startswith("0:")
        assert page.drawing() == before
        page.driver.refresh()
        page.until("document.querySelectorAll('#strip button').length === 28", 30)
    finally:
        for handle in browser.window_handles:
            if handle != here:
                browser.switch_to.window(handle)
                browser.close()
        browser.switch_to.window(here)
        ended(process)


def test_a_program_that_is_gone_is_said_over_the_picture(browser: Any, folder: Path, cell_folder: Path) -> None:
    process, address = served(str(folder), "--sensor", str(cell_folder / "sensor.toml"), "--what", "strings")
    browser.get(address)
    page = Page(browser)
    page.until("document.documentElement.dataset.surveyed === '5'", 60)
    ended(process)
    page.js("document.querySelectorAll('#strip button')[1].click()")
    page.until("document.getElementById('notice').textContent.includes('does not answer')")
    assert page.js("return !document.getElementById('notice').hidden")


def test_the_way_in_shows_the_token_to_this_user_alone(browser: Any, folder: Path, cell_folder: Path) -> None:
    """What is on the browser's command line is a file that others can not read, and it leads to the page."""
    process, address = served(str(folder), "--sensor", str(cell_folder / "sensor.toml"), "--what", "strings")
    try:
        with way_in(address) as page:
            assert page.parent.stat().st_mode & 0o077 == 0
            assert address.split("/")[3] not in page.as_uri()
            browser.get(page.as_uri())
            Page(browser).until("document.documentElement.dataset.shown", 60)
        assert not page.exists()
    finally:
        ended(process)


def test_a_watched_folder_shows_what_comes(browser: Any, cell_folder: Path, tmp_path: Path) -> None:
    """A new image is taken in, measured and shown without a click; one that is still being written waits."""
    folder = tmp_path / "live"
    folder.mkdir()
    shutil.copy(cell_folder / "images" / "000.png", folder / "000.png")
    process, address = served(str(folder), "--sensor", str(cell_folder / "sensor.toml"), "--watch", "--what", "strings")
    try:
        browser.get(address)
        page = Page(browser)
        page.until("document.documentElement.dataset.surveyed === '1'", 60)
        shutil.copy(cell_folder / "images" / "004.png", folder / "001.png")
        page.until("document.documentElement.dataset.shown.startsWith('1:')", 20)
        assert page.js("return document.querySelectorAll('#strip button').length") == 2
        page.until("document.documentElement.dataset.surveyed === '2'", 20)
        assert int(page.js("return document.querySelectorAll('#strip .badge')[1].textContent")) > 0
    finally:
        ended(process)
