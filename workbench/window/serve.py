"""Start the server on this machine alone, with a fresh token, and open the browser."""

from __future__ import annotations

import secrets
import socket
import tempfile
import webbrowser
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING

import uvicorn
from starlette.types import ASGIApp

from workbench.window.connections import LIMIT, patient_protocol
from workbench.window.front import Front
from workbench.window.security import HOST, Gate

if TYPE_CHECKING:
    from workbench.window.session import Opened

TELL_SECONDS = 10.0  # for the page to come and be told why the folder can not be opened


def bind(port: int) -> socket.socket:
    """A socket on 127.0.0.1; port 0 takes a free one. InputError where the port is busy or not allowed."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((HOST, port))
        bound.listen(64)
    except OSError as error:
        bound.close()
        from geometry import InputError

        raise InputError(
            f"port {port} on {HOST} can not be used ({error.strerror}): choose another --port, or 0 for a free one"
        ) from None
    return bound


def serve(
    open_: Callable[[], Opened], port: int = 0, open_browser: bool = True, say: Callable[[str], None] = print
) -> None:
    """Serve until interrupted; ``say`` is given the address, token included.

    The folder is opened meanwhile: the page and the browser need not wait for it. What ``open_`` raises is told to the
    page, where one is open, and raised.
    """
    bound, front = bind(port), Front()
    server, address = make_server(front, bound)
    say(address)
    Thread(target=_open, args=(open_, front, server, open_browser), name="opening", daemon=True).start()
    if not open_browser:
        server.run(sockets=[bound])
    else:
        with way_in(address) as page:
            Thread(
                target=webbrowser.open, args=(page.as_uri(),), name="browser", daemon=True
            ).start()  # some wait for it
            server.run(sockets=[bound])
    problem = front.inner.exception() if front.inner.done() else None
    if problem is not None:
        raise problem


def _open(open_: Callable[[], Opened], front: Front, server: uvicorn.Server, wait_for_page: bool) -> None:
    """Open the folder behind the page that is shown already; the first image is gone through to load the kernels."""
    try:
        opened = open_()
        from workbench.window.app import make_app
        from workbench.window.session import Session

        session = Session(opened)
        front.inner.set_result(make_app(session))
    except BaseException as problem:  # noqa: BLE001 - whatever it is, the command ends with it
        front.inner.set_exception(problem)
        if wait_for_page:
            front.told.wait(TELL_SECONDS)
        server.should_exit = True
        return
    session.warm()


@contextmanager
def way_in(address: str) -> Iterator[Path]:
    """A page that only this user can read and that leads to the address: a command line, which others see, names it.

    address: the server's own, of letters that mean nothing in HTML.
    """
    with tempfile.TemporaryDirectory(prefix="process-window-", ignore_cleanup_errors=True) as folder:  # 0700
        page = Path(folder) / "open.html"
        text = f'<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={address}">'
        page.write_text(f'{text}<a href="{address}">Process window</a>\n', encoding="utf-8")
        yield page


def make_server(app: ASGIApp, bound: socket.socket) -> tuple[uvicorn.Server, str]:
    """The server for a bound socket, and the page's address."""
    token = secrets.token_urlsafe(24)
    port = int(bound.getsockname()[1])
    gate = Gate(app, token, port)
    config = uvicorn.Config(
        gate,
        log_level="warning",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        ws="none",
        lifespan="off",
        http=patient_protocol(),
        limit_concurrency=LIMIT,
        timeout_keep_alive=30,
        timeout_graceful_shutdown=1,
    )
    return uvicorn.Server(config), f"http://{HOST}:{port}/{token}/"
