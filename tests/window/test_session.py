"""What the window computes: the same as the other commands, kept, surveyed, compared with truth, sound on bad input."""

from __future__ import annotations

import shutil
import time
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from extraction import extract
from geometry import InputError
from workbench.compare import summarise
from workbench.files import Recipe, read_cell, read_image
from workbench.opened import ImageRequest, ImageSet
from workbench.window import open_session
from workbench.window.engine import badge
from workbench.window.parameters import parse
from workbench.window.session import Session
from workbench.window.survey import Survey

ATOL_PX = 1e-9
DEFAULTS = Recipe(what="strings").model_dump_json()
BLIND = '{"what": "strings", "detect": {"min_height_dn": 100000.0}}'


@pytest.fixture
def session(cell_folder: Path, tmp_path: Path) -> Session:
    return Session(open_session(ImageRequest((cell_folder,), out=tmp_path)))


def surveyed(session: Session, text: str, epoch: int, seconds: float = 120.0) -> dict[str, object]:
    survey, wanted = Survey(session), parse(Recipe, text)
    session.first_answer.set()
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        survey.ask([wanted])
        state = survey.state(wanted.hash, 0)
        if state["done"] == state["total"] and survey.epoch == epoch:
            return state
        time.sleep(0.05)
    raise AssertionError("the survey did not end")


def test_the_points_are_those_of_extract(session: Session, cell_folder: Path) -> None:
    cell = read_cell(cell_folder)
    for i in (0, 9, 20):
        outcome = session.outcome(i, parse(Recipe, DEFAULTS))
        image = read_image(cell_folder / cell.frames[i].image, cell.sensor)
        assert outcome.view is not None
        np.testing.assert_allclose(outcome.view.points.uv_px, extract(image, cell.sensor).uv_px, atol=ATOL_PX)


def test_an_equal_question_is_answered_from_memory(session: Session) -> None:
    first = session.outcome(3, parse(Recipe, DEFAULTS))
    assert session.outcome(3, parse(Recipe, DEFAULTS)) is first
    assert session.outcome(3, parse(Recipe, BLIND)) is not first


def test_refused_candidates_say_why(session: Session) -> None:
    """Every candidate is a spot, or refused with a sentence that holds its own number and names the parameter."""
    refused = 0
    for i in (7, 8, 9):  # a wall behind: stripes that are no strings
        outcome = session.outcome(i, parse(Recipe, DEFAULTS))
        assert outcome.view is not None
        for c in outcome.view.candidates:
            assert bool(c.reason) == bool(c.text)
            refused += bool(c.reason)
        kept = sum(not c.reason for c in outcome.view.candidates)
        assert kept == len(outcome.view.points)
    assert refused > 10


def test_truth_tells_a_loss(session: Session) -> None:
    """Default parameters are near the truth; blind ones miss every visible string and measure nothing."""
    good = session.comparison(session.outcome(0, parse(Recipe, DEFAULTS)))
    blind = session.comparison(session.outcome(0, parse(Recipe, BLIND)))
    assert good is not None
    assert blind is not None
    seen, lost = summarise([good]), summarise([blind])
    assert seen.found == seen.visible > 0
    assert seen.rms_mm < 0.2
    assert lost.found == 0
    assert lost.missed == seen.visible
    assert np.isnan(lost.rms_mm)


def test_the_survey_covers_every_image_and_follows_the_robot(session: Session) -> None:
    state = surveyed(session, DEFAULTS, epoch=1)
    rows = state["rows"]
    assert isinstance(rows, list)
    assert [r["index"] for r in rows] == list(range(28))
    assert sum(r["badge"] == "all" for r in rows) >= 18


def test_a_blind_set_loses_in_the_survey(session: Session) -> None:
    alone = Session(replace(session.opened, prepare=None))
    state = surveyed(alone, BLIND, epoch=0)
    rows = state["rows"]
    assert isinstance(rows, list)
    assert all(r["badge"] == "none" for r in rows)
    assert state["statistics"]["found"] == 0  # type: ignore[index]


def test_calibration_answers_for_the_page(session: Session) -> None:
    calibrator = session.opened.calibrator
    assert calibrator is not None
    answer = calibrator.run(Recipe(), {})
    assert answer["verdict"]["code"] in ("ok", "model_misfit", "weak")
    assert set(answer["locations"]) == {"A", "B", "C", "D"}
    assert len(answer["locations"]["A"]["distances"]["solved_mm"]) >= 3
    assert len(answer["table"]) == 6
    assert all(row["low"] < row["solved"] < row["high"] for row in answer["table"])
    assert {f["frame"] for f in answer["scene"]["frames"]} == set(range(28))
    assert "Sensor centre position" in calibrator.report()
    same = calibrator.compare(calibrator.result_text(), "before.json")
    assert same["translation_mm"] == pytest.approx([0.0] * 3, abs=1e-6)


def test_locations_change_their_roles_without_measuring_anew(session: Session, monkeypatch: pytest.MonkeyPatch) -> None:
    """What is measured once serves every choice of model and roles; a location that is left out is gone."""
    calibrator = session.opened.calibrator
    assert calibrator is not None
    first = calibrator.run(Recipe(), {})
    measured = []
    monkeypatch.setattr(ImageSet, "observe", lambda *a: measured.append(a))
    scp = Recipe.model_validate({"calib": {"model": "scp"}, "tolerances": {"left_out_rms_mm": {"max": 1e-6}}})
    other = calibrator.run(scp, {"A": "left out", "D": "calibrate", "B": "verify"})
    assert not measured
    assert other["model"] == "scp"
    assert {n: p["role"] for n, p in other["locations"].items()} == {"B": "verify", "C": "calibrate", "D": "calibrate"}
    assert first["translation_mm"] != other["translation_mm"]
    assert other["values"][0]["lamp"] == "bad"
    with pytest.raises(InputError, match="there is no location Z"):
        calibrator.run(scp, {"Z": "verify"})
    with pytest.raises(InputError, match="none of calibrate, verify"):
        calibrator.run(scp, {"A": "maybe"})


def bad_folder(cell_folder: Path, tmp_path: Path) -> Path:
    """Four images: a good one, one of another size, one cut short, one that is no image."""
    folder = tmp_path / "mixed"
    folder.mkdir()
    shutil.copy(cell_folder / "images" / "000.png", folder / "a.png")
    cv2.imwrite(str(folder / "b.png"), np.zeros((100, 200), np.uint8))
    (folder / "c.png").write_bytes((folder / "a.png").read_bytes()[:2000])
    (folder / "d.png").write_bytes(b"")
    return folder


def test_bad_images_are_said_and_the_rest_goes_on(cell_folder: Path, tmp_path: Path) -> None:
    folder = bad_folder(cell_folder, tmp_path)
    session = Session(
        open_session(ImageRequest((folder,), sensor=cell_folder / "sensor.toml", jig=cell_folder / "jig.toml"))
    )
    outcomes = [session.outcome(i, parse(Recipe, DEFAULTS)) for i in range(4)]
    strings = session.opened.engine.strings
    assert [badge(o, strings) for o in outcomes] == ["all", "error", "error", "error"]
    assert "200 × 100" in outcomes[1].error
    assert "cut short" in outcomes[2].error
    assert "empty" in outcomes[3].error
    assert "joint readings" in session.opened.no_calibration


def test_an_image_that_vanishes_is_said_and_can_come_back(cell_folder: Path, tmp_path: Path) -> None:
    folder = bad_folder(cell_folder, tmp_path)
    session = Session(open_session(ImageRequest((folder,), sensor=cell_folder / "sensor.toml")))
    question = parse(Recipe, DEFAULTS)
    assert not session.outcome(0, question).error
    content = (folder / "a.png").read_bytes()
    (folder / "a.png").unlink()
    assert "gone" in session.outcome(0, question).error
    (folder / "a.png").write_bytes(content)
    assert not session.outcome(0, question).error


def test_a_changed_image_is_read_anew(cell_folder: Path, tmp_path: Path) -> None:
    folder = bad_folder(cell_folder, tmp_path)
    session = Session(open_session(ImageRequest((folder,), sensor=cell_folder / "sensor.toml")))
    question = parse(Recipe, DEFAULTS)
    before = session.outcome(0, question)
    shutil.copy(cell_folder / "images" / "009.png", folder / "a.png")
    after = session.outcome(0, question)
    assert before.view is not None
    assert after.view is not None
    assert not np.array_equal(before.view.points.uv_px, after.view.points.uv_px)


@pytest.mark.parametrize(("make", "match"), [(True, "no PNG, TIFF or BMP"), (False, "no such file or folder")])
def test_a_folder_without_images(cell_folder: Path, tmp_path: Path, make: bool, match: str) -> None:
    folder = tmp_path / "empty"
    if make:
        folder.mkdir()
    with pytest.raises(InputError, match=match):
        open_session(ImageRequest((folder,), sensor=cell_folder / "sensor.toml"))


def test_strings_of_bare_images_need_a_sensor(cell_folder: Path) -> None:
    with pytest.raises(InputError, match="--sensor"):
        open_session(ImageRequest((cell_folder / "images",), what="strings"))


def test_the_command_quotes_what_a_shell_would_read(cell_folder: Path, tmp_path: Path) -> None:
    odd = tmp_path / "two words; $(reboot)"
    odd.mkdir()
    opened = open_session(ImageRequest((cell_folder,), out=odd))
    assert f"'{odd}/my set.toml'" in opened.command("my set.toml", "strings")


def test_a_candidate_s_box_is_around_its_peak(session: Session) -> None:
    """Also where the region ran into a brighter one and was not measured."""
    for i in (7, 8, 9):
        view = session.outcome(i, parse(Recipe, DEFAULTS)).view
        assert view is not None
        for c in view.candidates:
            u0, v0, u1, v1 = c.box_px
            assert u0 - 0.1 <= c.u_px <= u1 + 0.1
            assert v0 - 0.1 <= c.v_px <= v1 + 0.1
            if c.reason == "part_of_brighter":
                assert u1 - u0 < 200
                assert v1 - v0 < 200
