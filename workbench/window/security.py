"""Who may talk to the page's server: this machine's own browser, with the token, from the page itself."""

from __future__ import annotations

import hmac
import logging
from collections.abc import Iterable
from dataclasses import dataclass
from urllib.parse import urlsplit

from starlette.responses import PlainTextResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HOST = "127.0.0.1"
MAX_BODY_BYTES = 256 * 1024  # parameters and TOML text are a few kB
MAX_URL_BYTES = 2048
METHODS = frozenset({"GET", "HEAD", "POST"})

CONTENT_SECURITY_POLICY = "; ".join(
    [
        "default-src 'none'",
        "script-src 'self'",
        "style-src 'self'",
        "img-src 'self' blob:",
        "connect-src 'self'",
        "base-uri 'none'",
        "form-action 'none'",
        "frame-ancestors 'none'",
        "require-trusted-types-for 'script'",
        "trusted-types 'none'",
    ]
)
HEADERS = (
    ("content-security-policy", CONTENT_SECURITY_POLICY),
    ("x-content-type-options", "nosniff"),
    ("x-frame-options", "DENY"),
    ("referrer-policy", "no-referrer"),
    ("cross-origin-opener-policy", "same-origin"),
    ("cross-origin-resource-policy", "same-origin"),
    ("permissions-policy", "camera=(), microphone=(), geolocation=(), usb=()"),
    ("cache-control", "no-store"),
)


@dataclass(frozen=True)
class Refusal:
    """Why a request is not answered: HTTP status and one sentence."""

    status: int
    text: str


@dataclass(frozen=True)
class Gate:
    """ASGI middleware: checks Host, Origin, token, method and size of every request, and adds the security headers.

    The token is the first part of the path: ``http://127.0.0.1:PORT/TOKEN/…``. The inner app sees the rest of it.
    """

    app: ASGIApp
    token: str
    port: int

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request, or refuse it."""
        if scope["type"] != "http":
            return  # no web sockets: the connection is closed
        guarded = _with_headers(send)
        refusal = self.refusal(scope)
        if refusal is not None:
            refused = PlainTextResponse(refusal.text, refusal.status, {"connection": "close"})
            await refused(scope, receive, guarded)
            return
        body = _Counted(receive)
        prefix = f"/{self.token}"
        inner = {**scope, "root_path": prefix}
        try:
            await self.app(inner, body, guarded)
        except Exception:  # the inner app has answered 500 by then; the terminal gets the rest
            logging.getLogger(__name__).exception("fault of the program")

    def refusal(self, scope: Scope) -> Refusal | None:
        """Why this request is refused, or None."""
        headers = [(k.decode("latin-1").lower(), v.decode("latin-1")) for k, v in scope["headers"]]
        if scope["method"] not in METHODS:
            return Refusal(405, "only GET and POST are answered")
        if _only(headers, "host") not in self._hosts():
            return Refusal(403, "wrong Host")
        if not self._right_origin(scope["method"], headers):
            return Refusal(403, "wrong Origin")
        if len(scope.get("raw_path") or b"") + len(scope["query_string"]) > MAX_URL_BYTES:
            return Refusal(414, "the address is too long")
        given = scope["path"].split("/", 2)[1] if scope["path"].startswith("/") else ""
        if not hmac.compare_digest(given.encode("utf-8", "replace"), self.token.encode()):
            return Refusal(403, "wrong or missing token: open the address that the program printed")
        length = _only(headers, "content-length")
        if length is not None and (not length.isdigit() or int(length) > MAX_BODY_BYTES):
            return Refusal(413, "the request is too large")
        return None

    def _hosts(self) -> tuple[str, str]:
        return f"{HOST}:{self.port}", f"localhost:{self.port}"

    def _right_origin(self, method: str, headers: list[tuple[str, str]]) -> bool:
        """Same origin, said by the browser: always on POST; on GET where the browser says anything at all."""
        if _only(headers, "sec-fetch-site") not in (None, "same-origin", "none") and not _opens_a_page(method, headers):
            return False
        origin = _only(headers, "origin")
        if origin is None:
            return method != "POST" and not any(k == "origin" for k, _ in headers)
        parts = urlsplit(origin)
        return parts.scheme == "http" and parts.netloc in self._hosts() and origin == f"http://{parts.netloc}"


def _opens_a_page(method: str, headers: list[tuple[str, str]]) -> bool:
    """Whether the browser goes to a page of its own by it: what led there can not read it, and it needs the token."""
    asked = _only(headers, "sec-fetch-mode"), _only(headers, "sec-fetch-dest")
    return method == "GET" and asked == ("navigate", "document")


class TooLargeError(Exception):
    """A body that grew beyond the cap while it was read."""


class _Counted:
    """Receive channel that stops a body without a declared length at the cap."""

    def __init__(self, receive: Receive) -> None:
        self._receive = receive
        self._seen = 0

    async def __call__(self) -> Message:
        message = await self._receive()
        self._seen += len(message.get("body", b""))
        if self._seen > MAX_BODY_BYTES:
            raise TooLargeError
        return message


def _only(headers: Iterable[tuple[str, str]], name: str) -> str | None:
    """The value of a header that stands exactly once; "" (never right) where it is repeated, None where absent."""
    found = [v for k, v in headers if k == name]
    return None if not found else found[0] if len(found) == 1 else ""


def _with_headers(send: Send) -> Send:
    async def guarded(message: Message) -> None:
        if message["type"] == "http.response.start":
            own = [(k.encode(), v.encode()) for k, v in HEADERS]
            ours = {k for k, _ in own}
            message = {**message, "headers": [h for h in message.get("headers", []) if h[0].lower() not in ours] + own}
        await send(message)

    return guarded
