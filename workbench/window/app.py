"""The page's server: a handful of routes on one opened folder, behind the gate."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from importlib.resources import files
from typing import Any

import cv2
import numpy as np
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route

from extraction import image_to_sheet
from geometry import InputError, PerceptronEmuError
from workbench.files import write_text
from workbench.window import settings
from workbench.window.jobs import Job
from workbench.window.overview import overview
from workbench.window.parameters import ParameterError, parse
from workbench.window.security import TooLargeError
from workbench.window.session import Session
from workbench.window.survey import Survey
from workbench.window.thumbnails import thumbnail

MEDIA = {"html": "text/html; charset=utf-8", "css": "text/css", "js": "text/javascript", "svg": "image/svg+xml"}
Body = dict[str, Any]
GRID_PX = 8  # between its nodes the page goes straight: less off than the hundredths of a millimetre that it shows
Answer = Callable[[Body], Response]


def make_app(session: Session) -> Starlette:
    """The inner application; put a `Gate` before it."""
    api = _Api(session)
    inside = files("workbench.window.static").iterdir()
    static = {f.name: f.read_bytes() for f in inside if f.name.rsplit(".", 1)[-1] in MEDIA}

    def page_file(request: Request) -> Response:
        name = request.path_params.get("name", "index.html")
        if name not in static:
            raise HTTPException(404)
        return Response(static[name], media_type=MEDIA[name.rsplit(".", 1)[-1]])

    routes = [
        Route("/", page_file),
        Route("/static/{name}", page_file),
        Route("/api/session", lambda _: JSONResponse(overview(session))),
        Route("/api/plane", api.plane),
        Route("/api/image/{index:int}", api.image),
        Route("/api/thumbnail/{index:int}", api.thumbnail),
        Route("/api/calibration", lambda _: JSONResponse(api.job.state())),
    ]
    actions: dict[str, Answer] = {
        "process": api.process,
        "stage": api.stage,
        "survey": api.survey_state,
        "watch": api.watch,
        "calibrate": api.calibrate,
        "check": api.check,
        "toml": api.toml,
        "parse": api.parse_toml,
        "save": api.save,
        "load": api.load,
    }
    routes += [Route(f"/api/{n}", _action(a), methods=["POST"]) for n, a in actions.items()]
    handlers: Any = {HTTPException: _http_problem, Exception: _fault}
    return Starlette(routes=routes, exception_handlers=handlers)


def _http_problem(_request: Request, error: HTTPException) -> Response:
    return PlainTextResponse(error.detail, error.status_code)


def _fault(_request: Request, error: Exception) -> Response:
    return JSONResponse({"error": f"internal error: {type(error).__name__}"}, 500)


def _action(answer: Answer) -> Callable[[Request], Awaitable[Response]]:
    """A POST route: a JSON object in, an answer out, project errors as one sentence with status 422."""

    async def endpoint(request: Request) -> Response:
        if request.headers.get("content-type", "").split(";")[0] != "application/json":
            return JSONResponse({"error": "JSON is expected"}, 415)
        try:
            body = json.loads(await request.body())
        except TooLargeError:
            return JSONResponse({"error": "the request is too large"}, 413)
        except (ValueError, RecursionError):
            return JSONResponse({"error": "not valid JSON"}, 400)
        if not isinstance(body, dict):
            return JSONResponse({"error": "a JSON object is expected"}, 400)
        try:
            return await run_in_threadpool(answer, body)
        except ParameterError as error:
            return JSONResponse({"error": str(error), "problems": error.problems}, 422)
        except PerceptronEmuError as error:
            return JSONResponse({"error": str(error)}, 422)

    return endpoint


def _text(body: Body, key: str) -> str:
    value = body.get(key)
    if not isinstance(value, str):
        raise InputError(f"{key}: text is expected")
    return value


class _Api:
    """The answers; every parameter set comes as the JSON text whose hash the answer carries."""

    def __init__(self, session: Session) -> None:
        self.session = session
        self.opened = session.opened
        self.survey = Survey(session)
        self.job = Job()
        self.model = session.opened.engine.model

    def plane(self, _request: Request) -> Response:
        """Where the pixels of a grid lie in the laser plane: (y, z, 1) over the depth in the camera, NaN where nowhere.

        These three are straight in u and v but for the lens, where y and z themselves are not.
        """
        sensor = self.opened.engine.sensor
        camera = sensor.require_camera()
        us, vs = (np.arange(0, size + GRID_PX, GRID_PX, dtype=float) for size in (camera.width_px, camera.height_px))
        u, v = np.meshgrid(us, vs)
        yz, _ = image_to_sheet(sensor, np.column_stack([u.ravel(), v.ravel()]))
        depth = (camera.T_sensor_camera.inverse() @ np.insert(yz, 0, 0.0, axis=1))[:, 2:]
        table = np.column_stack([yz, np.ones(len(yz))]) / depth
        answer = _pixels(table.reshape(len(vs), -1).astype(np.float32), "", "")
        answer.headers["x-step"] = str(GRID_PX)
        return answer

    def image(self, request: Request) -> Response:
        """The raw grey levels of one image."""
        try:
            stamp, image = self.opened.pictures.stamped(self._known(request.path_params["index"]))
        except PerceptronEmuError as error:
            return JSONResponse({"error": str(error)}, 410)
        return _pixels(image, "", str(stamp))

    def thumbnail(self, request: Request) -> Response:
        """A small PNG of one image, spots made visible."""
        try:
            image = self.opened.pictures.read(self._known(request.path_params["index"]))
        except PerceptronEmuError as error:
            return JSONResponse({"error": str(error)}, 410)
        full_scale = self.opened.engine.sensor.require_camera().full_scale_dn
        return Response(thumbnail(image, full_scale), media_type="image/png")

    def process(self, body: Body) -> Response:
        """Detection on one image."""
        with self.session.interactive():
            configuration = parse(self.model, _text(body, "config"))
            outcome = self.session.outcome(self._index(body), configuration)
            return JSONResponse(self.session.row(outcome))

    def stage(self, body: Body) -> Response:
        """The background or the mask of one image as pixels."""
        with self.session.interactive():
            configuration = parse(self.model, _text(body, "config"))
            outcome = self.session.outcome(self._index(body), configuration)
            if outcome.view is None:
                raise InputError(outcome.error)
            if _text(body, "stage") == "mask":
                return _pixels((outcome.view.mask != 0).astype(np.uint8), outcome.hash, outcome.stamp)
            if self.opened.engine.sensor.require_camera().full_scale_dn > 255:
                levels = np.clip(np.rint(outcome.view.background), 0, 65535).astype(np.uint16)
            else:
                levels = cv2.convertScaleAbs(outcome.view.background)  # rounded, at most 255
            return _pixels(levels, outcome.hash, outcome.stamp)

    def survey_state(self, body: Body) -> Response:
        """Ask for the survey of the current and the saved parameters, and look at one of them."""
        current, saved = parse(self.model, _text(body, "config")), parse(self.model, _text(body, "saved"))
        self.survey.ask([current, saved])
        since, since_saved = _whole(body, "since"), _whole(body, "since_saved")
        now = self.survey.state(current.hash, since)
        before = self.survey.state(saved.hash, since_saved)
        return JSONResponse({"now": now, "saved": before, "epoch": self.survey.epoch})

    def watch(self, body: Body) -> Response:
        """The images that came since the page knew ``since`` of them."""
        self.session.take_in()
        return JSONResponse({"images": self.session.images[max(0, _whole(body, "since")) :]})

    def calibrate(self, body: Body) -> Response:
        """Start the calibration with these parameters."""
        run = self.opened.calibrate
        if run is None:
            raise InputError(self.opened.no_calibration)
        configuration = parse(self.model, _text(body, "config"))
        if not self.job.start(configuration.hash, lambda: run(configuration.model)):
            raise InputError("a calibration is running already")
        return JSONResponse(self.job.state())

    def check(self, body: Body) -> Response:
        """Whether the parameters are right, and their hash."""
        return JSONResponse({"hash": parse(self.model, _text(body, "config")).hash})

    def toml(self, body: Body) -> Response:
        """The settings file's text and the equivalent command."""
        text = self.opened.to_toml(parse(self.model, _text(body, "config")).model)
        name = str(body.get("name") or "extraction.toml")
        settings.inside(self.opened.settings_folder, name)
        return JSONResponse({"toml": text, "command": self.opened.command(name)})

    def parse_toml(self, body: Body) -> Response:
        """Parameters from TOML text that the user picked on their own disk."""
        text = _text(body, "toml")
        if len(text) > settings.MAX_TOML_BYTES:
            raise InputError("the text is too long for a settings file")
        return self._parameters(text, "the chosen file")

    def load(self, body: Body) -> Response:
        """Parameters from a settings file in the opened folder."""
        name = _text(body, "name")
        return self._parameters(settings.read(self.opened.settings_folder, name), name)

    def save(self, body: Body) -> Response:
        """Write the settings file; another file of the dataset is never overwritten."""
        configuration = parse(self.model, _text(body, "config"))
        name = _text(body, "name")
        path = settings.inside(self.opened.settings_folder, name)
        if path.exists():
            self._is_a_recipe(name)
            if body.get("overwrite") is not True:
                return JSONResponse({"exists": True, "name": name}, 409)
        write_text(path, self.opened.to_toml(configuration.model))
        found = settings.names(self.opened.settings_folder)
        return JSONResponse({"name": name, "names": found, "command": self.opened.command(name)})

    def _is_a_recipe(self, name: str) -> None:
        """InputError where a file that would be written over is something else."""
        text = settings.read(self.opened.settings_folder, name)
        try:
            self.opened.from_toml(text, name)
        except PerceptronEmuError:
            raise InputError(f"{name}: is not a settings file and is not overwritten, choose another name") from None

    def _parameters(self, text: str, name: str) -> Response:
        return JSONResponse({"parameters": self.opened.from_toml(text, name).model_dump(mode="json"), "name": name})

    def _index(self, body: Body) -> int:
        return self._known(_whole(body, "index"))

    def _known(self, index: int) -> int:
        if not 0 <= index < len(self.opened.pictures):
            raise HTTPException(404, "no such image")
        return index


def _whole(body: Body, key: str) -> int:
    value = body.get(key, 0)
    if not isinstance(value, int) or isinstance(value, bool):
        raise InputError(f"{key}: a whole number is expected")
    return value


def _pixels(image: Any, hash_: str, stamp: str) -> Response:
    """Grey levels row by row, little-endian; in the headers their size, and of which file and parameters they are."""
    height, width = image.shape
    little = np.ascontiguousarray(image, dtype=image.dtype.newbyteorder("<"))
    headers = {"x-width": str(width), "x-height": str(height), "x-bytes": str(image.dtype.itemsize)}
    headers |= {"x-hash": hash_, "x-stamp": stamp}
    return Response(little.tobytes(), media_type="application/octet-stream", headers=headers)
