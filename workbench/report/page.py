"""The kit of all HTML pages: one template environment, and pictures as addresses that hold their data."""

from __future__ import annotations

import base64
import hashlib
import io
import os
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
from numpy.typing import NDArray

from workbench.files import sha256_of
from workbench.report.as_text import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNDATED = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
JPEG_WIDTH_PX, JPEG_QUALITY = 1100, 82  # sharp across a page, some 100 kB a picture


@dataclass(frozen=True)
class Origin:
    """What a record is of.

    dataset: its name. inputs: name and SHA-256 of each file. settings_sha256: of the settings' text. passed: the
    judgement, None where nothing is judged.
    """

    dataset: str = ""
    inputs: tuple[tuple[str, str], ...] = ()
    settings_sha256: str = ""
    passed: bool | None = None


def origin_of(paths: Iterable[Path], folder: Path, settings: str = "", passed: bool | None = None) -> Origin:
    """The origin of what files of a folder gave; files that are gone are left out."""
    there = sorted({p for p in paths if p.is_file()})
    names = [(p.relative_to(folder) if p.is_relative_to(folder) else Path(p.name)).as_posix() for p in there]
    inputs = tuple(zip(names, map(sha256_of, there), strict=True))
    digest = hashlib.sha256(settings.encode()).hexdigest() if settings else ""
    return Origin(folder.resolve().name, inputs, digest, passed)


def render_page(package: str, template: str, content: dict[str, Any], origin: Origin | None = None) -> str:
    """The page of a template that stands in ``package`` and fills the blocks of record.html.j2.

    ``number`` is its filter for numbers that may be missing. The date is today's, or that of SOURCE_DATE_EPOCH.
    """
    import jinja2

    def load(name: str) -> str:
        place = "workbench.report" if name == "record.html.j2" else package
        return (files(place) / name).read_text(encoding="utf-8")

    loader = jinja2.FunctionLoader(load)
    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, loader=loader)
    environment.filters["number"] = lambda value, digits=3: number(value, digits)
    head = {"origin": origin or Origin(), "date": _today(), "version": version("perceptron-emu")}
    return environment.get_template(template).render(**head, **content)


def _today() -> str:
    given = os.environ.get("SOURCE_DATE_EPOCH", "")
    now = datetime.fromtimestamp(int(given), UTC) if given.isdigit() else datetime.now(UTC)
    return now.date().isoformat()


def new_figure(width_in: float, height_in: float, columns: int = 1) -> tuple[Figure, Any]:
    """A figure of that size and its axes, without a window or global state; of several ``columns`` a row of axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure  # a third of a second, and most commands draw nothing

    figure = Figure(figsize=(width_in, height_in), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(1, columns, sharey=True)


def picture_bytes(figure: Figure, kind: str = "png", dpi: int = 130) -> bytes:
    """The figure as PNG, SVG or PDF, the same bytes every time."""
    import matplotlib as mpl

    buffer = io.BytesIO()
    with mpl.rc_context({"svg.hashsalt": "perceptron-emu"}):  # else the names inside an SVG are drawn at random
        figure.savefig(buffer, format=kind, dpi=dpi, metadata=UNDATED[kind])
    return buffer.getvalue()


def svg(figure: Figure) -> str:
    """A figure as a data address; as an image it can hold no script."""
    return "data:image/svg+xml;base64," + base64.b64encode(picture_bytes(figure, "svg")).decode()


def jpeg(picture: NDArray[Any]) -> str:
    """A picture in BGR order as a data address, no wider than the page."""
    scale = min(1.0, JPEG_WIDTH_PX / picture.shape[1])
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    data = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, JPEG_QUALITY])[1]
    return "data:image/jpeg;base64," + base64.b64encode(data.tobytes()).decode()


def png(picture: NDArray[Any]) -> str:
    """A picture as a data address, without loss."""
    return "data:image/png;base64," + base64.b64encode(cv2.imencode(".png", picture)[1].tobytes()).decode("ascii")
