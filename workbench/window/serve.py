"""Start the server on this machine alone, with a fresh token, and open the browser."""

from __future__ import annotations

import secrets
import socket
import webbrowser
from collections.abc import Callable

import uvicorn

from geometry import InputError
from workbench.window.app import make_app
from workbench.window.security import HOST, Gate
from workbench.window.session import Opened, Session


def bind(port: int) -> socket.socket:
    """A socket on 127.0.0.1; port 0 takes a free one. InputError where the port is busy or not allowed."""
    bound = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        bound.bind((HOST, port))
        bound.listen(64)
    except OSError as error:
        bound.close()
        raise InputError(
            f"port {port} on {HOST} can not be used ({error.strerror}): choose another --port, or 0 for a free one"
        ) from None
    return bound


def serve(opened: Opened, port: int = 0, open_browser: bool = True, say: Callable[[str], None] = print) -> None:
    """Serve until interrupted; ``say`` is given the address, token included."""
    bound = bind(port)
    server, address = make_server(opened, bound)
    say(address)
    if open_browser:
        webbrowser.open(address)
    server.run(sockets=[bound])


def make_server(opened: Opened, bound: socket.socket) -> tuple[uvicorn.Server, str]:
    """The server for a bound socket, and the page's address."""
    token = secrets.token_urlsafe(24)
    port = int(bound.getsockname()[1])
    gate = Gate(make_app(Session(opened)), token, port)
    config = uvicorn.Config(
        gate,
        log_level="warning",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        ws="none",
        lifespan="off",
        limit_concurrency=64,
        timeout_keep_alive=30,
        timeout_graceful_shutdown=1,
    )
    return uvicorn.Server(config), f"http://{HOST}:{port}/{token}/"
