"""The page is there before the folder is open; a watched folder gives whole images at once."""

from __future__ import annotations

import shutil
import threading
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from geometry import InputError
from tests.window.test_security import TOKEN, Client
from workbench.cli.main import run
from workbench.opened import ImageRequest
from workbench.opened.watched import WatchedFolder
from workbench.window import open_session
from workbench.window.app import make_app
from workbench.window.front import Front, page_files
from workbench.window.parameters import parse
from workbench.window.security import Gate
from workbench.window.serve import serve
from workbench.window.session import Session


def _client(front: Front) -> Client:
    return Client(Gate(front, TOKEN, 8123))


def test_the_page_is_served_while_the_folder_is_being_opened() -> None:
    status, headers, body = _client(Front()).ask(f"/{TOKEN}/")
    assert (status, headers["content-type"]) == (200, "text/html; charset=utf-8")
    assert b'rel="modulepreload" href="static/main.js"' in body
    assert _client(Front()).ask(f"/{TOKEN}/static/main.js")[0] == 200


def test_a_question_waits_until_the_folder_is_open() -> None:
    front = Front()

    async def answered(_scope: Any, _receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})
        await send({"type": "http.response.body", "body": b"opened"})

    threading.Timer(0.1, front.inner.set_result, [answered]).start()
    assert _client(front).ask(f"/{TOKEN}/api/session")[2] == b"opened"


@pytest.mark.parametrize(("problem", "said"), [(InputError("no images"), b"no images"), (OSError("/a/b"), b"OSError")])
def test_the_page_is_told_why_the_folder_can_not_be_opened(problem: Exception, said: bytes) -> None:
    front = Front()
    front.inner.set_exception(problem)
    status, _, body = _client(front).ask(f"/{TOKEN}/api/session")
    assert status == 503
    assert said in body
    assert b"/a/b" not in body
    assert front.told.is_set()


def test_what_can_not_be_opened_ends_the_command(tmp_path: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """The address is printed first; the sentence and the exit code are those of every other command."""
    assert run(["tune", str(tmp_path), "--no-browser"]) == 2
    assert capfd.readouterr().err == f"error: {tmp_path}: the folder holds no PNG, TIFF or BMP images\n"
    assert run(["tune", str(tmp_path / "nowhere"), "--no-browser"]) == 2
    assert "no such file or folder" in capfd.readouterr().err


def test_a_fault_while_opening_is_raised() -> None:
    def fault() -> Any:
        raise RuntimeError("torn")

    with pytest.raises(RuntimeError, match="torn"):
        serve(fault, open_browser=False, say=lambda _: None)


def test_the_page_s_files_are_those_that_its_head_names() -> None:
    found = page_files()
    for name in found:
        assert not name.endswith(".js") or f'href="static/{name}"'.encode() in found["index.html"]


def test_pictures_of_any_kind_are_opened(cell_folder: Path, tmp_path: Path) -> None:
    """PNG, JPEG, BMP and TIFF, grey, coloured or of 16 bits, with a sensor by its file; what is no image is named."""
    image = cv2.imread(str(cell_folder / "images" / "000.png"), cv2.IMREAD_UNCHANGED)
    colour = cv2.merge([image, image, image])
    for name, content in (("a.png", image), ("b.bmp", image), ("c.tif", image), ("d.jpg", image), ("e.png", colour)):
        cv2.imwrite(str(tmp_path / name), content)
    cv2.imwrite(str(tmp_path / "f.png"), image.astype(np.uint16) * 257)
    cv2.imwrite(str(tmp_path / "g.png"), image[:100, :200])
    (tmp_path / "notes.txt").write_text("none")
    opened = open_session(ImageRequest((tmp_path,), sensor=cell_folder / "sensor.toml", what="strings"))
    session, client = Session(opened), _client(Front.of(make_app(Session(opened))))
    assert opened.skipped == ("notes.txt: is no image by its name, left out",)
    start = parse(opened.engine.model, opened.start.model_dump_json())
    rows = [session.row(session.outcome(i, start)) for i in range(7)]
    exact = [(s["u"], s["v"]) for s in rows[0]["spots"]]
    assert len(exact) > 2
    assert [[(s["u"], s["v"]) for s in row["spots"]] for row in rows[1:3]] == [exact, exact]
    assert rows[3]["found"] > 0
    for row in rows[4:]:  # shown with a sentence, where the sensor's file says another kind or size
        assert row["error"] or row["found"] > 0
    assert "640" in rows[6]["error"]
    for i in range(7):
        status, headers, _ = client.ask(f"/{TOKEN}/api/image/{i}")
        assert (status, int(headers["x-width"])) == (200, 200 if i == 6 else 640)


def test_a_preset_s_name_stands_for_its_file(cell_folder: Path, tmp_path: Path) -> None:
    shutil.copy(cell_folder / "images" / "000.png", tmp_path / "a.png")
    opened = open_session(ImageRequest((tmp_path,), sensor=Path("nominal")))
    assert opened.engine.sensor.require_camera().width_px == 1280


def test_a_whole_image_is_taken_in_at_the_first_look(cell_folder: Path, tmp_path: Path) -> None:
    folder = WatchedFolder(tmp_path, (".png", ".tif"), {"old.png"})
    (tmp_path / "old.png").write_bytes(b"1")
    whole = (cell_folder / "images" / "000.png").read_bytes()
    (tmp_path / "new.png").write_bytes(whole[:-40])
    assert folder.look() == []
    (tmp_path / "new.png").write_bytes(whole)
    assert folder.look() == [tmp_path / "new.png"]
    assert folder.look() == []


def test_an_image_without_an_end_waits_until_it_has_not_grown(tmp_path: Path) -> None:
    folder = WatchedFolder(tmp_path, (".png", ".tif"), set())
    (tmp_path / "a.tif").write_bytes(b"II*")
    assert folder.look() == []
    (tmp_path / "a.tif").write_bytes(b"II*.")
    assert folder.look() == []
    assert folder.look() == [tmp_path / "a.tif"]
    shutil.rmtree(tmp_path)
    assert folder.look() == []
