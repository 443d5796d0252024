"""The kit of all HTML pages: one template environment, and pictures as addresses that hold their data."""

from __future__ import annotations

import base64
import io
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import cv2
from numpy.typing import NDArray

from workbench.report.as_text import number

if TYPE_CHECKING:
    from matplotlib.figure import Figure

UNDATED = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}
JPEG_WIDTH_PX, JPEG_QUALITY = 1100, 82  # sharp across a page, some 100 kB a picture


def render_page(package: str, template: str, content: dict[str, Any]) -> str:
    """The page of a template that stands in ``package``; ``number`` is its filter for numbers that may be missing."""
    import jinja2

    environment = jinja2.Environment(autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True)
    environment.filters["number"] = lambda value, digits=3: number(value, digits)
    text = (files(package) / template).read_text(encoding="utf-8")
    return environment.from_string(text).render(**content)


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
