"""What the window computes for one image: detection stages, labels and, where truth is known, errors."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass, replace
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel

from calib.label import LabelledFrame
from extraction import Profile
from geometry import InputError, Sensor, SurfacePoints
from workbench.cell import Value
from workbench.files import Image
from workbench.opened import Content
from workbench.window.profile_view import ProfileView, view_json

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Candidate:
    """A region that was looked at: its box and, where it was rejected, why, in words and numbers (all finite)."""

    u_px: float
    v_px: float
    box_px: tuple[float, float, float, float]  # u0, v0, u1, v1
    reason: str  # "" where it was accepted
    text: str
    measured: tuple[float | None, ...] = ()  # in the order of StageView.measures
    parameter: str = ""  # key of the parameter that rejected it


@dataclass(frozen=True, eq=False)
class StageView:
    """The stages of one image. ``background`` (H, W) [DN]; ``mask`` (H, W) non-zero where something is lit.

    measures: names, with units, of the candidates' measured numbers.
    """

    background: NDArray[np.floating[Any]]
    mask: NDArray[np.uint8]
    candidates: tuple[Candidate, ...]
    points: SurfacePoints
    reason: str = ""  # why there is no spot, where there is none
    measures: tuple[str, ...] = ()


class Engine(Protocol):
    """Detection and labelling as the window needs them; the tests put a fake in its place."""

    @property
    def model(self) -> type[BaseModel]:
        """The parameters' model."""
        ...

    @property
    def sensor(self) -> Sensor:
        """The sensor that took the images."""
        ...

    @property
    def strings(self) -> tuple[str, ...]:
        """Names of the jig's strings; empty where no jig is known: nothing is labelled then."""
        ...

    @property
    def epoch(self) -> int:
        """Counts what the engine learned meanwhile that changes labels."""
        ...

    def stages(self, image: Image, config: BaseModel) -> StageView:
        """All stages of one image; InputError where the image does not fit the sensor."""
        ...

    def label(self, index: int, points: SurfacePoints) -> LabelledFrame:
        """Names of the spots of image ``index`` by the jig's geometry."""
        ...

    def profile(self, index: int, content: Content, config: BaseModel) -> ProfileView:
        """The stripe of image ``index`` with what is measured in it, or the same of a profile."""
        ...

    def looks_for(self, content: Content, config: BaseModel) -> str:
        """What is looked for in an image or profile: strings, stripe or board."""
        ...

    def values(self, content: Content, answer: ImageAnswer, config: BaseModel) -> list[Value]:
        """What was measured, judged by the tolerances."""
        ...


@dataclass(frozen=True, eq=False)
class ImageAnswer:
    """Everything about one image under one set of parameters; ``error`` is set where it could not be processed.

    stamp: the state of the file that was processed, "" where there is none. view, labels: of strings; profile: of a
    stripe, a profile or a board.
    """

    index: int
    hash: str
    view: StageView | None
    labels: LabelledFrame | None
    error: str
    seconds: float
    stamp: str = ""
    profile: ProfileView | None = None
    values: tuple[Value, ...] = ()


def process(engine: Engine, content: Content, config: BaseModel, index: int, hash_: str) -> ImageAnswer:
    """Run the recipe's tools on one image or profile."""
    start = time.perf_counter()
    if engine.looks_for(content, config) != "strings":
        answer = ImageAnswer(index, hash_, None, None, "", 0.0, profile=engine.profile(index, content, config))
    elif isinstance(content, Profile):
        raise InputError("a profile holds no image in which strings could be found")
    else:
        view = engine.stages(content, config)
        labels = engine.label(index, view.points) if engine.strings else None
        answer = ImageAnswer(index, hash_, view, labels, "", 0.0)
    values = tuple(engine.values(content, answer, config))
    return replace(answer, values=values, seconds=time.perf_counter() - start)


def badge(outcome: ImageAnswer, strings: tuple[str, ...]) -> str:
    """How many of the jig's strings were found: all, some, none; else error, out or count.

    count: nothing says how many points there should be. out: a value is out of its tolerance.
    """
    if outcome.error or (outcome.view is None and outcome.profile is None):
        return "error"
    if outcome.profile is not None:
        return "out" if any(v.lamp == "bad" for v in outcome.values) else "count"
    if not strings:
        return "count"
    found = len(outcome.labels.axis) if outcome.labels else 0
    return "all" if found >= len(strings) else "some" if found else "none"


def as_json(outcome: ImageAnswer, strings: tuple[str, ...]) -> dict[str, Any]:
    """The outcome for the page; images are asked for separately, as bytes."""
    answer: dict[str, Any] = {
        "index": outcome.index,
        "hash": outcome.hash,
        "stamp": outcome.stamp,
        "badge": badge(outcome, strings),
        "error": outcome.error,
        "ms": round(outcome.seconds * 1000, 1),
        "candidates": [],
        "measures": [],
        "spots": [],
        "labelled": 0,
        "reason": "",
        "values": [asdict(v) for v in outcome.values],
        "found": 0,
    }
    if outcome.profile is not None:
        return answer | {"reason": outcome.profile.reason, "found": outcome.profile.found} | view_json(outcome.profile)
    if outcome.view is None:
        return answer
    answer["found"] = len(outcome.view.points)
    answer["candidates"] = [_candidate(c) for c in outcome.view.candidates]
    answer["measures"] = outcome.view.measures
    answer["spots"] = _spots(outcome.view.points, outcome.labels)
    answer["labelled"] = len(outcome.labels.axis) if outcome.labels else 0
    answer["reason"] = outcome.view.reason or (outcome.labels.reason if outcome.labels else None) or ""
    return answer


def _candidate(c: Candidate) -> dict[str, Any]:
    return {
        "u": c.u_px,
        "v": c.v_px,
        "box": c.box_px,
        "reason": c.reason,
        "text": c.text,
        "measured": c.measured,
        "parameter": c.parameter,
    }


def _spots(points: SurfacePoints, labels: LabelledFrame | None) -> list[dict[str, Any]]:
    axis_of = {int(s): i for i, s in enumerate(labels.axis.spot)} if labels else {}
    sigma_uv = np.sqrt(np.maximum(points.cov_uv_px2[:, [0, 1], [0, 1]], 0))
    spots = []
    for i in range(len(points)):
        spot = {
            "u": _round(points.uv_px[i, 0]),
            "v": _round(points.uv_px[i, 1]),
            "su": _round(sigma_uv[i, 0]),
            "sv": _round(sigma_uv[i, 1]),
            "surface": [_round(x) for x in points.yz_mm[i]],
            "cov": [_round(x, 8) for x in points.cov_yz_mm2[i].ravel()],
            "score": _round(points.score[i]),
            "flag": points.flag[i],
            "angle": _round(points.axis_rad[i]),
            "width": [_round(x) if x > 0 else None for x in points.sigma_px[i]],
            "peak": _round(points.amplitude_dn[i], 1),
            "label": "",
            "axis": None,
        }
        if labels and i in axis_of:
            k = axis_of[i]
            flag = labels.axis.flag[k] if k < len(labels.axis.flag) else ""
            axis = [_round(x) for x in labels.axis.yz_mm[k]]
            spot |= {"label": labels.axis.label[k], "axis": axis, "flag": flag or points.flag[i]}
        spots.append(spot)
    return spots


def finite(x: float) -> float | None:
    """The number, or None where JSON has no word for it."""
    return float(x) if np.isfinite(x) else None


def _round(x: float, digits: int = 4) -> float | None:
    return round(float(x), digits) if np.isfinite(x) else None
