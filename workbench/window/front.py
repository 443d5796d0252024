"""The page's own files at once, its questions once the folder is open: the browser starts while the rest is loaded."""

from __future__ import annotations

import asyncio
from concurrent.futures import Future
from dataclasses import dataclass, field
from importlib.resources import files
from threading import Event

from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

MEDIA = {"html": "text/html; charset=utf-8", "css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
START = "index.html"
PLACE = "static/"


def page_files() -> dict[str, bytes]:
    """The page's files by name; what they import is named in the head, so that the browser asks for all at once."""
    found = {f.name: f.read_bytes() for f in files("workbench.window.static").iterdir() if _kind(f.name) in MEDIA}
    links = "".join(f'<link rel="modulepreload" href="{PLACE}{n}">\n' for n in sorted(found) if _kind(n) == "js")
    found[START] = found[START].replace(b"</head>", links.encode() + b"</head>", 1)
    return found


def _kind(name: str) -> str:
    return name.rsplit(".", 1)[-1]


@dataclass(frozen=True, eq=False)
class Front:
    """ASGI application behind the gate: the page's files, and before all else those who ask wait for ``inner``.

    inner: answers the questions, or holds why the folder could not be opened. told: whether somebody was told so.
    """

    inner: Future[ASGIApp] = field(default_factory=Future)
    told: Event = field(default_factory=Event)
    files: dict[str, bytes] = field(default_factory=page_files)

    @classmethod
    def of(cls, app: ASGIApp) -> Front:
        """The front of what is open already."""
        front = cls()
        front.inner.set_result(app)
        return front

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer one request."""
        name = scope["path"].removeprefix(scope.get("root_path", "")).removeprefix("/")
        page = self.files.get(name.removeprefix(PLACE) if name else START)
        if page is not None and (not name or name.startswith(PLACE)) and scope["method"] in ("GET", "HEAD"):
            kind = _kind(name or START)
            await Response(page, media_type=MEDIA[kind])(scope, receive, send)
            return
        while not self.inner.done():  # a request that goes away must not take the opening with it
            await asyncio.sleep(0.01)
        problem = self.inner.exception()
        if problem is not None:
            await JSONResponse({"error": _sentence(problem)}, 503)(scope, receive, send)
            self.told.set()
            return
        await self.inner.result()(scope, receive, send)


def _sentence(problem: BaseException) -> str:
    from geometry import PerceptronEmuError

    return str(problem) if isinstance(problem, PerceptronEmuError) else f"internal error: {type(problem).__name__}"
