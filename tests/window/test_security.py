"""Who may talk to the window's server, and how far into the file system they get. Each test tries one way in."""

from __future__ import annotations

import asyncio
import http.client
import json
import socket
import threading
import time
from contextlib import suppress
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import pytest

from geometry import InputError
from workbench.opened import ImageRequest
from workbench.window import open_session, settings
from workbench.window.app import make_app
from workbench.window.front import Front
from workbench.window.security import MAX_BODY_BYTES, Gate
from workbench.window.serve import bind, make_server
from workbench.window.session import Session

TOKEN, PORT = "secret-token", 8123
HOST = f"127.0.0.1:{PORT}"
ORIGIN = f"http://{HOST}"


class Client:
    """Speaks ASGI to the gate as a browser or an attacker would."""

    def __init__(self, gate: Gate) -> None:
        self.gate = gate

    def ask(
        self,
        path: str,
        method: str = "GET",
        headers: dict[str, str] | list[tuple[str, str]] | None = None,
        body: bytes = b"",
    ) -> tuple[int, dict[str, str], bytes]:
        """Status, headers and body of the answer; Host is right unless given."""
        given = list(headers.items()) if isinstance(headers, dict) else list(headers or [])
        if not any(k == "host" for k, _ in given):
            given.append(("host", HOST))
        path_only, _, query = path.partition("?")
        scope: dict[str, Any] = {
            "type": "http", "asgi": {"version": "3.0"}, "http_version": "1.1", "method": method, "path": path_only,
            "raw_path": path_only.encode(), "query_string": query.encode(), "root_path": "", "scheme": "http",
            "headers": [(k.encode(), v.encode()) for k, v in given],
            "client": ("127.0.0.1", 5), "server": ("127.0.0.1", PORT),
        }  # fmt: skip
        return asyncio.run(self._run(scope, body))

    async def _run(self, scope: dict[str, Any], body: bytes) -> tuple[int, dict[str, str], bytes]:
        sent: list[dict[str, Any]] = []
        chunks = [body[i : i + 65536] for i in range(0, max(len(body), 1), 65536)]

        async def receive() -> dict[str, Any]:
            if not chunks:
                return {"type": "http.disconnect"}
            part = chunks.pop(0)
            return {"type": "http.request", "body": part, "more_body": bool(chunks)}

        async def send(message: Any) -> None:
            sent.append(message)

        await self.gate(scope, receive, send)
        head = sent[0]
        names = {k.decode().lower(): v.decode() for k, v in head["headers"]}
        return head["status"], names, b"".join(m.get("body", b"") for m in sent[1:])

    def post(self, name: str, content: object, **headers: str) -> tuple[int, Any]:
        """A POST from the page itself."""
        own = {"origin": ORIGIN, "content-type": "application/json", **headers}
        status, _, body = self.ask(f"/{TOKEN}/api/{name}", "POST", own, json.dumps(content).encode())
        return status, json.loads(body) if body[:1] in (b"{", b"[") else body


@pytest.fixture(scope="module")
def client(cell_folder: Path, tmp_path_factory: pytest.TempPathFactory) -> Client:
    out = tmp_path_factory.mktemp("out")
    session = Session(open_session(ImageRequest((cell_folder,), out=out)))
    return Client(Gate(Front.of(make_app(session)), TOKEN, PORT))


def test_the_page_itself_is_served_with_its_policy(client: Client) -> None:
    status, headers, body = client.ask(f"/{TOKEN}/")
    assert status == 200
    assert b"<canvas" in body
    policy = headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "script-src 'self'" in policy
    assert "unsafe" not in policy
    assert "http" not in policy  # nothing from elsewhere, no CDN
    assert "frame-ancestors 'none'" in policy
    assert headers["x-content-type-options"] == "nosniff"
    assert headers["referrer-policy"] == "no-referrer"  # the token stands in the address


@pytest.mark.parametrize(
    "path", ["/", "/api/session", "/wrong/api/session", f"/{TOKEN}x/", f"/{TOKEN[:-1]}/", "//", f"/?token={TOKEN}"]
)
def test_nothing_without_the_token(client: Client, path: str) -> None:
    assert client.ask(path)[0] == 403


@pytest.mark.parametrize(
    "host",
    [
        "evil.example",
        f"evil.example:{PORT}",
        "127.0.0.1",
        "127.0.0.1:9",
        f"127.0.0.1.evil.example:{PORT}",
        f"[::1]:{PORT}",
        "",
    ],
)
def test_a_rebound_name_is_refused(client: Client, host: str) -> None:
    """DNS rebinding: the browser believes that it talks to the attacker's own host."""
    assert client.ask(f"/{TOKEN}/", headers={"host": host})[0] == 403


def test_two_hosts_are_refused(client: Client) -> None:
    assert client.ask(f"/{TOKEN}/", headers=[("host", HOST), ("host", "evil.example")])[0] == 403


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", f"https://{HOST}", f"http://{HOST}.evil.example", f"{ORIGIN}/", ""]
)
@pytest.mark.parametrize("method", ["GET", "POST"])
def test_another_origin_is_refused(client: Client, origin: str, method: str) -> None:
    assert client.ask(f"/{TOKEN}/api/session", method, {"origin": origin})[0] == 403


def test_a_post_needs_an_origin(client: Client) -> None:
    assert client.ask(f"/{TOKEN}/api/save", "POST", {"content-type": "application/json"}, b"{}")[0] == 403


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_requests_from_other_sites_are_refused(client: Client, site: str) -> None:
    assert client.ask(f"/{TOKEN}/api/session", headers={"sec-fetch-site": site})[0] == 403


def test_a_form_can_not_post(client: Client) -> None:
    headers = {"origin": ORIGIN, "content-type": "text/plain"}
    assert client.ask(f"/{TOKEN}/api/save", "POST", headers, b"{}")[0] == 415


@pytest.mark.parametrize("method", ["PUT", "DELETE", "OPTIONS", "TRACE", "CONNECT"])
def test_other_methods_are_refused(client: Client, method: str) -> None:
    assert client.ask(f"/{TOKEN}/", method)[0] == 405


def test_a_large_body_is_refused_by_its_length(client: Client) -> None:
    headers = {"origin": ORIGIN, "content-type": "application/json", "content-length": str(MAX_BODY_BYTES + 1)}
    assert client.ask(f"/{TOKEN}/api/process", "POST", headers, b"{}")[0] == 413


def test_a_large_body_is_refused_without_its_length(client: Client) -> None:
    headers = {"origin": ORIGIN, "content-type": "application/json", "transfer-encoding": "chunked"}
    assert client.ask(f"/{TOKEN}/api/process", "POST", headers, b" " * (MAX_BODY_BYTES + 1))[0] == 413


def test_a_long_address_is_refused(client: Client) -> None:
    assert client.ask(f"/{TOKEN}/static/" + "a" * 5000)[0] == 414


@pytest.mark.parametrize("body", [b"", b"[]", b"nonsense", b'{"index": 1e999}', b"[" * 100_000, b"\xff\xfe", b'"text"'])
def test_broken_json_is_refused(client: Client, body: bytes) -> None:
    headers = {"origin": ORIGIN, "content-type": "application/json"}
    assert client.ask(f"/{TOKEN}/api/process", "POST", headers, body)[0] in (400, 422)


@pytest.mark.parametrize(
    "name",
    [
        "../security.py",
        "..%2fsecurity.py",
        "%2e%2e/app.py",
        "/etc/passwd",
        "__init__.py",
        "nothing.js",
        "",
        ".",
        "app.css/../main.js",
    ],
)
def test_static_files_are_the_page_s_own(client: Client, name: str) -> None:
    assert client.ask(f"/{TOKEN}/static/{name}")[0] == 404


@pytest.mark.parametrize("index", ["28", "-1", "99999999999999999999", "a", "0/../../cell.toml", "1.5"])
def test_images_are_asked_for_by_number(client: Client, index: str) -> None:
    assert client.ask(f"/{TOKEN}/api/image/{index}")[0] == 404


@pytest.mark.parametrize("index", [28, -1, 10**30, "0", None, 1.5, True, [0], {"a": 1}])
def test_actions_take_known_numbers_only(client: Client, index: object) -> None:
    assert client.post("process", {"index": index, "config": "{}"})[0] in (404, 422)


BAD_NAMES = [
    "../evil.toml", "/etc/evil.toml", "a/b.toml", "..", ".toml", ".hidden.toml", "evil.py", "evil.toml.py",
    "a\\b.toml", "a\x00.toml",
    "a\n.toml", "con:.toml", "a" * 200 + ".toml", "~/evil.toml", "", "%2e%2e/evil.toml", "a..toml", "ä.toml",
]  # fmt: skip


@pytest.mark.parametrize("name", BAD_NAMES)
@pytest.mark.parametrize("action", ["save", "load", "toml"])
def test_no_name_leads_out_of_the_folder(client: Client, name: str, action: str) -> None:
    status, answer = client.post(action, {"name": name, "config": "{}"})
    if action == "toml" and name == "":
        assert status == 200  # no name given: the usual one
        return
    assert status == 422
    assert "error" in answer


def test_links_out_of_the_folder_are_refused(tmp_path: Path) -> None:
    outside = tmp_path / "outside.toml"
    outside.write_text("[detect]\nthreshold = 9.0\n")
    folder = tmp_path / "opened"
    folder.mkdir()
    (folder / "link.toml").symlink_to(outside)
    with pytest.raises(InputError, match="leads out"):
        settings.read(folder, "link.toml")
    with pytest.raises(InputError, match="leads out"):
        settings.inside(folder, "link.toml")


def test_an_image_that_links_out_of_the_folder_is_refused(cell_folder: Path, tmp_path: Path) -> None:
    folder = tmp_path / "opened"
    (folder / "images").mkdir(parents=True)
    (folder / "images" / "a.png").symlink_to(cell_folder / "images" / "000.png")
    session = Session(open_session(ImageRequest((folder / "images",), sensor=cell_folder / "sensor.toml")))
    client = Client(Gate(Front.of(make_app(session)), TOKEN, PORT))
    status, _, body = client.ask(f"/{TOKEN}/api/image/0")
    assert status == 410
    assert b"leads out" in body


def test_the_dataset_s_own_files_are_not_overwritten(cell_folder: Path, tmp_path: Path) -> None:
    (tmp_path / "cell.toml").write_bytes((cell_folder / "cell.toml").read_bytes())
    session = Session(open_session(ImageRequest((cell_folder,), out=tmp_path)))
    client = Client(Gate(Front.of(make_app(session)), TOKEN, PORT))
    status, answer = client.post("save", {"name": "cell.toml", "config": "{}", "overwrite": True})
    assert status == 422
    assert "not a settings file" in answer["error"]
    assert (tmp_path / "cell.toml").read_bytes() == (cell_folder / "cell.toml").read_bytes()


def test_the_socket_is_bound_to_this_machine_alone() -> None:
    bound = bind(0)
    try:
        assert bound.getsockname()[0] == "127.0.0.1"
    finally:
        bound.close()


def test_a_busy_port_is_said_in_one_sentence() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        with pytest.raises(InputError, match=f"port {port}.*another --port"):
            bind(port)


def test_web_sockets_are_not_spoken(client: Client) -> None:
    sent: list[Any] = []

    async def run() -> None:
        async def receive() -> Any:
            return {"type": "websocket.connect"}

        async def send(message: Any) -> None:
            sent.append(message)

        await client.gate({"type": "websocket", "path": f"/{TOKEN}/", "headers": []}, receive, send)

    asyncio.run(run())
    assert not any(m["type"] == "websocket.accept" for m in sent)


def test_no_internal_detail_in_errors(client: Client, monkeypatch: pytest.MonkeyPatch) -> None:
    """A fault of the program is said by its kind; no traceback and no path reach the browser."""

    def fault(*_: object) -> None:
        raise RuntimeError("/home/secret/path")

    monkeypatch.setattr("workbench.window.app.overview", fault)
    status, _, body = client.ask(f"/{TOKEN}/api/session")
    assert status == 500
    assert b"secret" not in body


def test_silent_connections_do_not_lock_the_user_out(cell_folder: Path, tmp_path: Path) -> None:
    """A hundred connections that ask nothing, or begin to ask and stop, are open; the page is served all the same."""
    opened, bound = open_session(ImageRequest((cell_folder,), out=tmp_path)), bind(0)
    server, address = make_server(Front.of(make_app(Session(opened))), bound)
    thread = threading.Thread(target=server.run, kwargs={"sockets": [bound]}, daemon=True)
    thread.start()
    port = bound.getsockname()[1]
    silent = [socket.create_connection(("127.0.0.1", port)) for _ in range(100)]
    try:
        for half in silent[::2]:
            with suppress(OSError):  # those beyond the cap are closed already
                half.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.")
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=10)
        connection.request("GET", urlsplit(address).path)
        assert connection.getresponse().status == 200
        connection.close()
    finally:
        for one in silent:
            one.close()
        server.should_exit = True
        thread.join(10)


@pytest.mark.parametrize("index", ["9" * 5000, "1e400", "-" + "1" * 5000])
def test_numbers_out_of_this_world_are_refused(client: Client, index: str) -> None:
    headers = {"origin": ORIGIN, "content-type": "application/json"}
    body = f'{{"index": {index}, "config": "{{}}"}}'.encode()
    assert client.ask(f"/{TOKEN}/api/process", "POST", headers, body)[0] in (400, 404, 422)
    config = json.dumps({"index": 0, "config": f'{{"detect": {{"threshold": {index}}}}}'}).encode()
    status, _, answer = client.ask(f"/{TOKEN}/api/process", "POST", headers, config)
    assert status == 422
    assert b"error" in answer


@pytest.mark.parametrize(
    "toml", ["x = " + "[" * 3000, "x = " + "9" * 5000, "a." * 3000 + "b = 1", "[" + "a." * 3000 + "b]"]
)
def test_hostile_toml_is_refused_in_a_sentence(client: Client, toml: str) -> None:
    status, answer = client.post("parse", {"toml": toml})
    assert status == 422
    assert len(answer["error"]) < 500


def test_a_hostile_line_of_toml_takes_no_time(client: Client) -> None:
    """The line of a wrong key is looked for in the text; a pattern that goes back over blanks would take minutes."""
    toml = '[detect]\nthreshold = "x"\nnote = """\n' + ("[" + " " * 1990 + "\n") * 20 + '"""\n'
    began = time.process_time()
    status, answer = client.post("parse", {"toml": toml})
    assert time.process_time() - began < 2.0
    assert status == 422
    assert "line 3" in answer["error"]


def test_a_page_elsewhere_may_lead_here_and_read_nothing(client: Client) -> None:
    """A link is followed, with the token; nothing but a page that the browser goes to itself is given for it."""
    asked = {"sec-fetch-site": "cross-site", "sec-fetch-mode": "navigate", "sec-fetch-dest": "document"}
    assert client.ask(f"/{TOKEN}/", headers=asked)[0] == 200
    assert client.ask("/wrong/", headers=asked)[0] == 403
    for changed in ({"sec-fetch-dest": "iframe"}, {"sec-fetch-mode": "no-cors"}, {"sec-fetch-dest": "image"}):
        assert client.ask(f"/{TOKEN}/", headers=asked | changed)[0] == 403


def test_a_page_of_another_folder_is_told_so(client: Client) -> None:
    """What was made for another opened folder is not answered with this one's pictures; who names none is."""
    opened = json.loads(client.ask(f"/{TOKEN}/api/session")[2])["opened"]
    config = json.dumps({"what": "strings"})
    body = {"index": 0, "config": config}
    assert client.post("check", body)[0] == 200
    assert client.post("check", body, **{"x-opened": opened})[0] == 200
    status, answer = client.post("check", body, **{"x-opened": "0" * 16})
    assert status == 421
    assert "Another folder" in answer["error"]
    assert client.ask(f"/{TOKEN}/api/thumbnail/0?opened={opened}&1")[0] == 200
    assert client.ask(f"/{TOKEN}/api/thumbnail/0?opened=other")[0] == 421
    assert client.ask(f"/{TOKEN}/api/session", headers={"x-opened": "other"})[0] == 200
