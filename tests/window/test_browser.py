"""The page end to end in headless Chromium: what a person does with it, from opening 28 images to saved points."""

from __future__ import annotations

import csv
import io
import json
import re
import shutil
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from extraction import image_to_sheet
from tests.window.chromium import ActionChains, By, Keys, Page, ended, needs_browser, press, served
from workbench.cli.main import run
from workbench.files import read_sensor

pytestmark = [needs_browser, pytest.mark.processes]
ATOL_PX = 5.6e-5  # the page is told four decimals, the file five
ATOL_POINTED_MM = 1.2  # half a screen pixel at each end, of 1.3 image pixels and 0.9 mm
ATOL_SHOWN_MM, ATOL_SHOWN_PX = 5e-3, 1e-3  # a display of hundredths of a millimetre; there and back by the same grid
NASTY = '<img src=x onerror="document.title=1">.png'


@pytest.fixture(scope="module")
def out(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("saved")


@pytest.fixture(scope="module")
def page(browser: Any, cell_folder: Path, out: Path) -> Iterator[Page]:
    process, address = served(str(cell_folder), "--out", str(out))
    browser.get(address)
    opened = Page(browser)
    opened.until("document.documentElement.dataset.shown", 60)
    opened.until("document.documentElement.dataset.epoch === '1'", 60)  # labels follow the robot from here on
    opened.until("document.documentElement.dataset.surveyed === '28'", 60)
    yield opened
    ended(process)


def test_28_images_are_open_and_judged(page: Page) -> None:
    assert len(page.driver.find_elements(By.CSS_SELECTOR, "#strip button")) == 28
    badges = page.js("return [...document.querySelectorAll('#strip .badge')].map((b) => b.dataset.badge)")
    assert set(badges) <= {"all", "some", "none"}
    assert badges.count("all") >= 18
    assert "rms" in page.find("#summary").text  # the dataset has truth


def test_a_slider_changes_the_overlay_and_is_undone(page: Page) -> None:
    page.image(9)
    page.layers("accepted", "rejected")
    before, picture, old = page.shown, page.drawing(), page.value("detect.threshold")
    page.slide("detect.threshold", 900)
    assert page.shown != before
    assert page.drawing() != picture
    assert "changed" in page.find('[data-key="detect.threshold"]').get_attribute("class")
    assert float(page.js("return document.documentElement.dataset.ms")) < 5000
    ActionChains(page.driver).key_down(Keys.CONTROL).send_keys("z").key_up(Keys.CONTROL).perform()
    page.settled()
    assert page.value("detect.threshold") == old
    assert page.shown == before
    assert page.drawing() == picture
    page.find("#redo").click()
    page.settled()
    assert page.value("detect.threshold") != old
    page.find("#undo").click()
    page.settled()


def test_a_click_on_a_rejected_candidate_says_why(page: Page) -> None:
    page.image(9)
    page.layers("accepted", "rejected")
    page.find("#fit").click()
    rejected = [c for c in page.answer()["candidates"] if c["reason"] == "too_long"]
    assert rejected
    page.point_at(rejected[0]["u"], rejected[0]["v"], click=True)
    page.until("document.querySelector('#inspector h2').textContent.startsWith('Rejected')")
    assert "at most" in page.js("return document.querySelector('#inspector .why').textContent")
    page.js("document.getElementById('reveal').click()")
    assert "max_length_mm" in page.find("#help").text


def test_pointing_at_a_spot_shows_its_figures(page: Page) -> None:
    page.image(0)
    page.layers("spots", "labels", "truth")
    page.find("#fit").click()
    spot = next(s for s in page.answer()["spots"] if s["label"])
    page.point_at(spot["u"], spot["v"])
    page.until("document.querySelector('#inspector h2').textContent.startsWith('String')")
    text = page.js("return document.getElementById('inspector').textContent")
    for word in ("peak", "width", "score", "σ y", "error y"):
        assert word in text
    page.until("/ DN +y .* mm$/.test(document.getElementById('where').textContent)")


def test_a_prime_is_told_from_its_string(page: Page) -> None:
    """C and C' are other strings: the mark is the one that files have, wide enough to be seen."""
    page.image(0)
    page.layers("spots", "labels")
    page.find("#fit").click()
    spot = next(s for s in page.answer()["spots"] if s["label"] == "C'")
    page.point_at(spot["u"], spot["v"])
    page.until("document.querySelector('#inspector h2').textContent === \"String C'\"")


def test_one_cursor_in_both_panes(page: Page, cell_folder: Path) -> None:
    """A pixel and its point in the laser plane, by extraction's own map and back, to a hundredth of a millimetre."""
    sensor = read_sensor(cell_folder / "sensor.toml")
    pixels = np.random.default_rng(0).uniform([0, 0], [639, 511], (50, 2))
    shown = page.driver.execute_async_script(
        """(async (pixels, done) => { const p = await import('./static/plane.js');
        done(pixels.map(([u, v]) => { const yz = p.toPlane(u, v); return [yz, p.toImage(...yz)]; }));
        })(...arguments)""",
        pixels.tolist(),
    )
    np.testing.assert_allclose([yz for yz, _ in shown], image_to_sheet(sensor, pixels)[0], atol=ATOL_SHOWN_MM)
    np.testing.assert_allclose([back for _, back in shown], pixels, atol=ATOL_SHOWN_PX)


def test_two_points_are_measured(page: Page, cell_folder: Path) -> None:
    page.image(0)
    page.layers("spots")
    page.find("#fit").click()
    page.find("#measure").click()
    page.point_at(200, 200, click=True)
    page.point_at(400, 300, click=True)
    text = page.until("document.getElementById('where').textContent.match(/distance ([0-9.]+) mm/)?.[1]")
    a, b = image_to_sheet(read_sensor(cell_folder / "sensor.toml"), [(200.0, 200.0), (400.0, 300.0)])[0]
    assert abs(float(text) - np.hypot(*(b - a))) < ATOL_POINTED_MM
    page.find("#measure").click()


def test_a_dot_below_opens_its_frame(page: Page) -> None:
    page.image(0)
    trend = page.find("#trend")
    width = page.js("return document.getElementById('trend').clientWidth")
    x = 44 + (width - 54) * (17 + 0.5) / 28
    ActionChains(page.driver).move_to_element_with_offset(trend, round(x - width / 2), 0).click().perform()
    page.settled()
    assert page.shown.startswith("17:")


def test_the_strip_is_one_stop_and_sliders_keep_their_keys(page: Page) -> None:
    page.image(3)
    assert page.js("return [...document.querySelectorAll('#strip button')].filter((b) => b.tabIndex === 0).length") == 1
    page.js("document.querySelector('#strip button[tabindex=\"0\"]').focus()")
    press(page, Keys.ARROW_DOWN)
    page.settled()
    assert page.shown.startswith("4:")
    page.js("""document.querySelector('[data-key="detect.threshold"] input[type=range]').focus()""")
    slider = "document.querySelector('[data-key=\"detect.threshold\"] input[type=range]').value"
    before = float(page.js(f"return {slider}"))
    press(page, Keys.PAGE_UP)
    page.settled()
    assert page.shown.startswith("4:")
    after = float(page.js(f"return {slider}"))
    assert 80 < after - before < 120
    press(page, Keys.ARROW_LEFT)
    assert 5 < after - float(page.js(f"return {slider}")) < 15
    page.find('[data-key="detect.threshold"] .reset').click()
    page.settled()


def test_stale_answers_are_dropped_and_the_old_picture_stays(page: Page) -> None:
    """An answer that carries another hash than the one asked for never reaches the picture."""
    page.image(0)
    page.layers("spots", "labels", "truth")
    before, picture = page.shown, page.drawing()
    page.js(
        """window.realFetch = window.fetch;
        window.fetch = async (path, options) => {
          const r = await window.realFetch(path, options);
          if (!String(path).endsWith('process')) return r;
          const body = await r.json(); body.hash = '0'.repeat(16); window.forged = (window.forged || 0) + 1;
          return new Response(JSON.stringify(body), { status: 200 });
        };
        const s = document.querySelector('[data-key="detect.threshold"] input[type=range]');
        s.value = 950; s.dispatchEvent(new Event('input'));"""
    )
    page.until("window.forged > 0")
    time.sleep(0.2)
    assert page.shown == before
    assert page.drawing() == picture
    page.js("window.fetch = window.realFetch")
    page.find("#undo").click()
    page.settled()


def test_a_wrong_value_is_said_beside_it(page: Page) -> None:
    before = page.shown
    box = page.find('[data-key="detect.threshold"] input.number')
    box.send_keys(Keys.CONTROL + "a")
    box.send_keys("-5", Keys.TAB)
    page.until("document.querySelector('[data-key=\"detect.threshold\"]').classList.contains('wrong')")
    assert "greater than" in page.find('[data-key="detect.threshold"] .problem').text
    assert page.shown == before
    page.find('[data-key="detect.threshold"] .reset').click()
    page.settled()
    page.until("!document.querySelector('.parameter.wrong')")


@pytest.mark.parametrize("layer", ["", "background", "mask", "rejected", "spots", "labels"])
def test_every_layer_draws_its_own_picture(page: Page, layer: str) -> None:
    page.image(9)
    page.layers(*([layer] if layer else []))
    time.sleep(0.15)
    colours = page.js(
        """const c = document.getElementById('canvas'), seen = new Set();
        const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data;
        for (let i = 0; i < d.length; i += 4) seen.add((d[i] << 16) | (d[i + 1] << 8) | d[i + 2]);
        return [...seen]"""
    )
    assert len(colours) > 3
    page_pictures.setdefault(layer, page.drawing())
    assert len(set(page_pictures.values())) == len(page_pictures)


page_pictures: dict[str, str] = {}


def test_saved_parameters_give_extract_the_page_s_points(page: Page, cell_folder: Path, out: Path) -> None:
    page.image(9)
    page.slide("detect.blur_sigma_px", 420)
    answer = page.answer()
    page.find("#save").click()
    name = page.find("#save-name")
    name.clear()
    name.send_keys("my set.toml", Keys.ENTER)
    page.until("!document.getElementById('dialog').open")
    assert (out / "my set.toml").exists()
    page.find("#command").click()
    page.until("document.getElementById('command-text')")
    command = page.find("#command-text").text
    assert command.startswith("perceptron-emu extract")
    assert f"--recipe '{out}/my set.toml'" in command
    press(page, Keys.ESCAPE)
    points = out / "points.csv"
    assert run(["extract", str(cell_folder), "--recipe", str(out / "my set.toml"), "--csv", str(points)]) == 0
    rows = [r for r in csv.DictReader(io.StringIO(points.read_text())) if r["frame"] == "9"]
    extracted = sorted((float(r["u_px"]), float(r["v_px"]), r["label"]) for r in rows)
    shown = sorted((s["u"], s["v"], s["label"]) for s in answer["spots"])
    assert len(shown) == len(extracted) > 0
    for (u, v, label), (eu, ev, elabel) in zip(shown, extracted, strict=True):
        assert abs(u - eu) <= ATOL_PX
        assert abs(v - ev) <= ATOL_PX
        assert label == elabel


def test_a_saved_file_is_loaded_again(page: Page) -> None:
    saved = page.value("detect.blur_sigma_px")
    page.slide("detect.blur_sigma_px", 100)
    page.find("#load").click()
    page.find('#dialog [data-name="my set.toml"]').click()
    page.until("!document.getElementById('dialog').open")
    page.settled()
    assert page.value("detect.blur_sigma_px") == saved


def test_a_loss_on_other_images_shows(page: Page) -> None:
    page.tab("sheet")
    page.slide("detect.min_height_dn", 1000)
    page.until("document.querySelector('#sheet .worse') !== null", 30)
    page.driver.find_elements(By.CSS_SELECTOR, "#sheet .choice button")[1].click()
    page.until("document.querySelectorAll('#sheet tr.go').length === 28", 30)
    assert "−" in page.find("#sheet tr.total").text
    page.find("#undo").click()
    page.settled()


def test_one_click_calibrates(page: Page) -> None:
    page.find("#reset-all").click()
    page.settled()
    page.find("#calibrate").click()
    page.until("document.documentElement.dataset.calibrated", 60)
    assert page.find("#verdict b").text in ("ok", "model misfit", "weak")
    assert page.js("return document.getElementById('fig7').clientWidth > 200")
    assert "D" in page.find("#calibration").text


def test_the_pose_for_the_nominal_table_stands_beside_the_solved_one(page: Page) -> None:
    """With robot errors estimated, what a controller with its own table takes is another pose, and which is said."""
    page.tab("calibration")
    result = json.loads(_saved(page, "result"))
    assert result["model"] == "full"
    heads = page.js("return [...document.querySelectorAll('#calibration th')].map((h) => h.textContent)")
    assert "with the nominal table" in heads
    rows = page.js("return [...document.querySelectorAll('#calibration td:last-child')].map((c) => c.textContent)")
    for i in range(3):
        place, sigma = result["T_hand_sensor_nominal"][i][3], result["sigma_translation_mm_nominal"][i]
        assert f"{place:.3f} ± {sigma:.3f}".replace("-", "−") in rows
    assert "nominal table" in page.find("#which-table").text
    assert "(asked: auto)" in page.find("#verdict").text
    written = page.js("return document.querySelector('#calibration .conventions').textContent").replace("−", "-")
    for maker in ("kuka", "abb", "ros", "ur"):  # metres and quaternions with as many digits as they need
        for label, value in result["conventions_nominal"][maker].items():
            digits = 4 if label.endswith(("mm", "°", "deg")) else 7
            assert f"{label.split(' / ')[0]} {value:.{digits}f}" in written


def _saved(page: Page, what: str) -> str:
    """What a button of the calibration saves."""
    return str(
        page.driver.execute_async_script(
            "const [what, done] = arguments; import('./static/api.js').then((a) => a.content(what)).then(done);", what
        )
    )


def _choose(page: Page, button: str, file: Path) -> None:
    """Give a file to what a button asks for."""
    page.find(button).click()
    page.until("document.querySelector('dialog[open] input[type=file]')")
    page.find("dialog[open] input[type=file]").send_keys(str(file))


def _rms_mm(page: Page) -> float:
    found = re.search(r"largest point rms of a location ([\d.]+) mm", page.find("#verified").text)
    assert found is not None
    return float(found[1])


def test_an_answer_is_saved_compared_and_verified(
    page: Page, cell_folder: Path, out: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """With itself: the same to no σ; verified: better than the design, and what the command says of that file."""
    page.tab("calibration")
    page.until("document.querySelector('#verify-design')")
    page.find("#verify-design").click()
    page.until("document.querySelector('#verified')")
    assert "the design" in page.find("#verified").text
    of_design = _rms_mm(page)
    file = out / "earlier.json"
    file.write_text(_saved(page, "result"), encoding="utf-8")
    _choose(page, "#compare", file)
    page.until("document.querySelector('#compared')")
    compared = page.find("#compared")
    assert "earlier.json" in compared.text
    assert "good" in compared.get_attribute("class")
    assert re.search(r"0\.000 ± 0\.\d+", compared.text)
    _choose(page, "#verify", file)
    page.until("document.querySelector('#verified')?.textContent.includes('earlier.json')")
    assert _rms_mm(page) < of_design / 3
    capsys.readouterr()
    assert run(["verify", str(cell_folder), "--scp", str(file), "--json"]) in (0, 1)
    largest = max(p["point_rms_mm"]["solved"] for p in json.loads(capsys.readouterr().out)["locations"].values())
    assert _rms_mm(page) == pytest.approx(largest, abs=5e-4)


def test_what_is_no_result_is_said_in_the_dialog(page: Page, out: Path) -> None:
    file = out / "other.json"
    file.write_text('{"T_hand_sensor": [[1, 2], [3]]}', encoding="utf-8")
    _choose(page, "#compare", file)
    page.until("document.querySelector('dialog[open] .error').textContent")
    assert "other.json" in page.find("dialog[open] .error").text
    page.js("document.querySelector('dialog[open]').close()")
    assert page.find("#compared").text.startswith("Against earlier.json")


def test_the_saved_report_is_the_command_s_record(page: Page, cell_folder: Path) -> None:
    report = _saved(page, "report")
    assert report.lower().startswith("<!doctype html>")
    for said in (cell_folder.name, "perceptron-emu", "T_hand_sensor", "sha256"):
        assert said in report


def test_a_location_left_out_marks_the_answer_as_stale(page: Page) -> None:
    role = "document.querySelectorAll('#calibration select[data-role]')[0]"
    page.js(f"{role}.selectedIndex = 2; {role}.dispatchEvent(new Event('change'));")
    page.until("document.documentElement.dataset.calibrationStale === 'true'")
    page.js(f"{role}.selectedIndex = 0; {role}.dispatchEvent(new Event('change'));")
    page.until("document.documentElement.dataset.calibrationStale === 'false'")


@pytest.mark.parametrize("theme", ["dark", "light"])
def test_axe_finds_nothing_in_an_answer(page: Page, theme: str) -> None:
    """With all that was asked of it: comparison, verification, residuals, the cell."""
    if page.js("return document.documentElement.dataset.theme") != theme:
        page.find("#theme").click()
    page.tab("calibration")
    page.until("document.querySelector('#verified')")
    page.driver.execute_async_script("setTimeout(arguments[0], 400)")
    assert page.violations() == []


def test_a_dot_of_fig_7_opens_its_frame(page: Page) -> None:
    page.tab("calibration")
    page.until("document.getElementById('fig7')")
    width = page.js("return document.getElementById('fig7').clientWidth")
    x = 46 + (width - 58) * (2 + 0.5) / (28 + 4)  # the third dot of the first of four locations
    fig7 = page.find("#fig7")
    ActionChains(page.driver).move_to_element_with_offset(fig7, round(x - fig7.size["width"] / 2), 0).click().perform()
    page.settled()
    assert page.shown.startswith("2:")
    assert page.find('[data-tab="image"]').get_attribute("aria-selected") == "true"


def test_parameters_are_searched_from_the_page(page: Page) -> None:
    """Two trials: progress, the judgement on images that the search did not see, and what was found is taken over."""
    page.tab("image")
    page.js("document.getElementById('auto-tune').click()")
    page.find("#trials").send_keys(Keys.CONTROL + "a")
    page.find("#trials").send_keys("2")
    page.find("#search-go").click()
    page.until("document.getElementById('search-progress')")
    page.until("document.getElementById('search-done')", 120)
    text = page.find("#search-done").text
    assert "held-out images" in text
    assert re.search(r"of 1[0-9] held-out images", text)
    page.find("#search-use").click()
    page.until("!document.getElementById('dialog').open")
    page.settled()
    page.find("#reset-all").click()
    page.settled()


def test_sets_are_kept_with_what_they_reached(page: Page) -> None:
    page.slide("detect.threshold", 650)
    page.tab("history")
    page.find("#keep-set").click()
    page.until("document.querySelectorAll('#sets tbody tr').length >= 2")
    wanted = "document.querySelector('#sets tr[aria-current=true] td:nth-child(3)').textContent === '28'"
    page.until(wanted, 60)  # its score comes with the survey of all images
    page.js("document.querySelector('#sets tbody tr button').click()")
    page.settled()
    assert page.find('[data-tab="history"]').get_attribute("aria-selected") == "true"
    page.tab("image")
    page.find("#reset-all").click()
    page.settled()


def test_the_table_of_all_images_keeps_its_columns(page: Page) -> None:
    """Each row is one line, its cells beside each other."""
    page.tab("sheet")
    page.js("document.querySelector('[data-form=table]').click()")
    page.until("document.querySelectorAll('#sheet tr.go').length === 28", 30)
    cells = "#sheet thead th, #sheet tr.go:first-of-type td"
    tops = page.js("return [...document.querySelectorAll(arguments[0])].map((c) => c.offsetTop)", cells)
    heads = page.js("return document.querySelectorAll('#sheet thead th').length")
    assert len(set(tops[:heads])) == 1
    assert page.js("return document.querySelector('#sheet tr.go').clientHeight") < 40
    page.tab("image")


def _badge(page: Page) -> str:
    """How much was found in the image that is shown."""
    page.settled()
    index = int(page.shown.partition(":")[0])
    return str(page.js("return document.querySelectorAll('#strip .badge')[arguments[0]].dataset.badge", index))


def test_the_keyboard_is_enough(page: Page) -> None:
    page.layers("spots", "labels", "truth")
    page.image(0)
    press(page, "j")
    page.settled()
    assert page.shown.startswith("1:")
    press(page, "k")
    page.settled()
    press(page, "n")
    page.until("/^(String|Spot)/.test(document.querySelector('#inspector h2').textContent)")
    press(page, "]")
    assert page.find('[data-tab="sheet"]').get_attribute("aria-selected") == "true"
    press(page, "[", "m")
    assert page.find('[data-layer="mask"]').get_attribute("aria-pressed") == "true"
    press(page, "m")
    page.until(  # the survey of all frames comes after the picture; until then no frame is known to have failed
        "['some', 'none', 'error'].some(b => document.querySelector(`#strip .badge[data-badge=${b}]`))"
    )
    for _ in range(28):  # the dots follow the badges
        press(page, ".")
        if _badge(page) in ("some", "none", "error"):
            break
        time.sleep(0.2)
    assert _badge(page) in ("some", "none", "error")
    press(page, "?")
    page.until("document.getElementById('dialog').open")
    press(page, Keys.ESCAPE)
    press(page, "/")
    assert page.js("return document.activeElement.id") == "filter"
    press(page, "region")
    visible = page.js(
        "return [...document.querySelectorAll('.parameter')].filter((p) => !p.hidden).map((p) => p.dataset.key)"
    )
    assert visible == ["detect.region_level"]
    page.find("#filter").clear()
    press(page, " ", Keys.BACKSPACE, Keys.TAB)


def test_everything_fits_a_laptop_screen(page: Page) -> None:
    for tab in ("image", "sheet", "calibration"):
        page.tab(tab)
        assert page.js(
            "return document.documentElement.scrollWidth <= innerWidth && document.body.scrollHeight <= innerHeight"
        )
    page.tab("image")
    assert page.js("return document.getElementById('canvas').clientHeight") > 300
    assert page.js("return document.getElementById('plane').clientWidth") > 300
    assert not page.js(
        "return [...document.querySelectorAll('button:not([hidden])')].some((b) => !b.textContent && !b.ariaLabel)"
    )


def test_the_policy_was_never_broken(page: Page) -> None:
    """Nothing was refused by the content security policy, and no script failed, in all of the above."""
    severe = [e["message"] for e in page.driver.get_log("browser") if e["level"] == "SEVERE"]
    assert [m for m in severe if "422" not in m and "409" not in m] == []


def test_names_are_text_and_bad_files_are_said(browser: Any, cell_folder: Path, tmp_path: Path) -> None:
    """Bare images, one with markup for a name, one cut short; the page shows both and runs nothing."""
    folder = tmp_path / "images <b>bold"
    folder.mkdir()
    shutil.copy(cell_folder / "images" / "000.png", folder / NASTY)
    (folder / "z.png").write_bytes((cell_folder / "images" / "001.png").read_bytes()[:5000])
    process, address = served(str(folder), "--sensor", str(cell_folder / "sensor.toml"), "--what", "strings")
    try:
        browser.get(address)
        page = Page(browser)
        page.until("document.documentElement.dataset.shown", 60)
        assert page.js("return document.querySelector('#strip b').textContent") == NASTY
        assert page.js("return document.querySelectorAll('img[onerror], #title b').length") == 0
        assert page.js("return document.title").startswith("images <b>bold")
        page.image(1)
        page.until("!document.getElementById('notice').hidden")
        assert "cut short" in page.find("#notice").text
        assert page.js("return document.getElementById('calibrate').disabled")
    finally:
        ended(process)
