"""The page's server: a handful of routes on one opened folder, behind the gate."""

from __future__ import annotations

import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from pydantic import BaseModel
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp, Receive, Scope, Send

from extraction import Profile, image_to_sheet
from geometry import InputError, PerceptronEmuError
from workbench.files import Image, Recipe, read_image, sensor_of_picture, write_text
from workbench.opened import ImageRequest, Stamp
from workbench.report import scene_script
from workbench.window import settings
from workbench.window.calibrator import Calibrator
from workbench.window.engine import finite
from workbench.window.exports import points_csv
from workbench.window.jobs import Job
from workbench.window.overview import overview
from workbench.window.parameters import ParameterError, parse
from workbench.window.security import TooLargeError
from workbench.window.session import Session
from workbench.window.survey import Survey
from workbench.window.thumbnails import profile_thumbnail, thumbnail

Body = dict[str, Any]
GRID_PX = 8  # between its nodes the page goes straight: less off than the hundredths of a millimetre that it shows
Answer = Callable[[Body], Response]
MAX_TRIALS = 5000
MAX_PATH = 4096
OTHER_FOLDER = "Another folder was opened from another page of this window: load this page anew to see it."


def make_app(session: Session) -> Starlette:
    """What answers the page's questions; put a `Front` with the page's files, and a `Gate`, before it."""
    api = _Api(session)
    routes = [
        Route("/static/scene.js", lambda _: Response(scene_script(), media_type="text/javascript")),
        Route("/api/session", lambda _: JSONResponse(overview(api.session))),
        Route("/api/plane", api.plane),
        Route("/api/image/{index:int}", api.image),
        Route("/api/thumbnail/{index:int}", api.thumbnail),
        Route("/api/calibration", lambda _: JSONResponse(api.job.state())),
        Route("/api/search", lambda _: JSONResponse(api.searching.state())),
        Route("/api/report", api.report),
        Route("/api/result", api.result),
    ]
    actions: dict[str, Answer] = {
        "process": api.process,
        "stage": api.stage,
        "survey": api.survey_state,
        "watch": api.watch,
        "calibrate": api.calibrate,
        "compare": api.compare,
        "verify": api.verify,
        "search": api.search,
        "points": api.points,
        "open": api.open,
        "check": api.check,
        "toml": api.toml,
        "parse": api.parse_toml,
        "save": api.save,
        "load": api.load,
    }
    routes += [Route(f"/api/{n}", _action(a), methods=["POST"]) for n, a in actions.items()]
    handlers: Any = {HTTPException: _http_problem, Exception: _fault}
    return Starlette(routes=routes, exception_handlers=handlers, middleware=[Middleware(_OfThisFolder, api=api)])


class _OfThisFolder:
    """Refuses a page that was made for another folder: its names would stand beside this one's pictures.

    A page says so by a header or, where it asks for a picture, in the address; who says nothing is answered.
    """

    def __init__(self, app: ASGIApp, api: _Api) -> None:
        self._app = app
        self._api = api

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        request = Request(scope)
        meant = request.headers.get("x-opened") or request.query_params.get("opened")
        if meant and meant != self._api.session.id and not request.url.path.endswith("/api/session"):
            await JSONResponse({"error": OTHER_FOLDER}, 421)(scope, receive, send)
            return
        await self._app(scope, receive, send)


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
        self._take(session)

    def _take(self, session: Session) -> None:
        self.session = session
        self.opened = session.opened
        self.survey = Survey(session)
        self.job, self.searching = Job(), Job()
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
        """The raw grey levels of one image, also of one that can not be measured for its size or depth."""
        index = self._known(request.path_params["index"])
        try:
            stamp, image = self.opened.pictures.stamped(index)
        except PerceptronEmuError as error:
            odd = self._odd(index)
            if odd is None:
                return JSONResponse({"error": str(error)}, 410)
            answer = _pixels(odd[1], "", str(odd[0]))
            answer.headers["x-odd"] = "1"
            return answer
        if isinstance(image, Profile):
            return JSONResponse({"error": "a profile has no image"}, 410)
        return _pixels(image, "", str(stamp))

    def _odd(self, index: int) -> tuple[Stamp, Image] | None:
        """The picture as it is, where it can be read as one at all."""
        path = self.opened.pictures.paths[index]
        try:
            stamp = self.opened.pictures.stamp(index)
            return stamp, read_image(path, sensor_of_picture(path), lossy=True)
        except PerceptronEmuError:
            return None

    def thumbnail(self, request: Request) -> Response:
        """A small PNG of one image, spots made visible."""
        index = self._known(request.path_params["index"])
        try:
            _, content = self.opened.pictures.stamped(index)
        except PerceptronEmuError as error:
            odd = self._odd(index)
            if odd is None:
                return JSONResponse({"error": str(error)}, 410)
            return Response(thumbnail(odd[1], float(np.iinfo(odd[1].dtype).max)), media_type="image/png")
        if isinstance(content, Profile):
            return Response(profile_thumbnail(content), media_type="image/png")
        full_scale = self.opened.engine.sensor.require_camera().full_scale_dn
        return Response(thumbnail(content, full_scale), media_type="image/png")

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
                raise InputError(outcome.error or "a stripe has no such stage")
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
        return JSONResponse({"images": self.session.images(max(0, _whole(body, "since")))})

    def calibrate(self, body: Body) -> Response:
        """Start the calibration with these parameters and roles of locations."""
        calibrator = self._calibrator()
        configuration = parse(self.model, _text(body, "config"))
        recipe, roles = _recipe(configuration.model), body.get("roles") or {}
        if not isinstance(roles, dict) or not all(isinstance(r, str) for r in roles.values()):
            raise InputError("roles: a role for each location is expected")
        if not self.job.start(configuration.hash, lambda _: calibrator.run(recipe, roles)):
            raise InputError("a calibration is running already")
        return JSONResponse(self.job.state())

    def _calibrator(self) -> Calibrator:
        if self.opened.calibrator is None:
            raise InputError(self.opened.no_calibration)
        return self.opened.calibrator

    def report(self, _request: Request) -> Response:
        """The newest calibration's report, to be saved."""
        try:
            return PlainTextResponse(self._calibrator().report())
        except PerceptronEmuError as error:
            return JSONResponse({"error": str(error)}, 422)

    def result(self, _request: Request) -> Response:
        """The newest calibration's result as `calibrate --json` has it, to be saved."""
        try:
            return PlainTextResponse(self._calibrator().result_text())
        except PerceptronEmuError as error:
            return JSONResponse({"error": str(error)}, 422)

    def compare(self, body: Body) -> Response:
        """The difference of an earlier result and the newest answer."""
        return JSONResponse(self._calibrator().compare(_text(body, "result"), _text(body, "name")))

    def verify(self, body: Body) -> Response:
        """An earlier result's SCP, or the design's, judged on this dataset."""
        recipe = _recipe(parse(self.model, _text(body, "config")).model)
        text = _text(body, "result") if body.get("result") is not None else None
        return JSONResponse(self._calibrator().verify(text, str(body.get("name") or ""), recipe))

    def search(self, body: Body) -> Response:
        """Start the search for better parameters."""
        search = self.opened.search
        if search is None:
            raise InputError("parameters are searched where strings are known: a dataset with a jig, or with truth")
        configuration, trials = parse(self.model, _text(body, "config")), _whole(body, "trials")
        if not 1 <= trials <= MAX_TRIALS:
            raise InputError(f"trials: a whole number from 1 to {MAX_TRIALS} is expected")
        recipe = _recipe(configuration.model)

        def work(tell: Callable[..., None]) -> dict[str, Any]:
            return search(recipe, trials, lambda done, of, best: tell(done=done, of=of, best_mm=finite(best)))

        if not self.searching.start(configuration.hash, work):
            raise InputError("a search is running already")
        return JSONResponse(self.searching.state())

    def points(self, body: Body) -> Response:
        """The points of one image as CSV, as `extract` or `profile` writes them."""
        with self.session.interactive():
            configuration = parse(self.model, _text(body, "config"))
            outcome = self.session.outcome(self._index(body), configuration)
        if outcome.error:
            raise InputError(outcome.error)
        frame = self.session.images(outcome.index)[0]["frame"]
        return JSONResponse({"csv": points_csv(outcome, frame)})

    def open(self, body: Body) -> Response:
        """Open another folder in place of this one."""
        if self.opened.reopen is None:
            raise InputError("no other folder can be opened from here")
        if "running" in (self.job.state()["state"], self.searching.state()["state"]):
            raise InputError("a calibration or a search is running: wait for its end")
        folder = _path(body, "folder")
        if folder is None or not folder.exists():
            raise InputError(f"{folder}: no such file or folder")
        what = body.get("what") or None
        if what not in ("strings", "stripe", None):
            raise InputError("what: strings or stripe is expected")
        opened = self.opened.reopen(
            ImageRequest((folder,), _path(body, "sensor"), _path(body, "jig"), what=what, board=_path(body, "board"))
        )
        self.survey.close()
        self._take(Session(opened))
        return JSONResponse({"title": opened.title})

    def check(self, body: Body) -> Response:
        """Whether the parameters are right, and their hash."""
        return JSONResponse({"hash": parse(self.model, _text(body, "config")).hash})

    def toml(self, body: Body) -> Response:
        """The settings file's text and the equivalent command."""
        model = parse(self.model, _text(body, "config")).model
        text = self.opened.to_toml(model)
        name = str(body.get("name") or "extraction.toml")
        settings.inside(self.opened.settings_folder, name)
        return JSONResponse({"toml": text, "command": self.opened.command(name, str(getattr(model, "what", "")))})

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
        return JSONResponse({"name": name, "names": settings.names(self.opened.settings_folder)})

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


def _recipe(config: BaseModel) -> Recipe:
    return config if isinstance(config, Recipe) else Recipe.model_validate(config.model_dump())


def _path(body: Body, key: str) -> Path | None:
    """A path that was typed, ~ for the home folder; None where the field is empty."""
    text = body.get(key) or ""
    if not isinstance(text, str) or "\0" in text or len(text) > MAX_PATH:
        raise InputError(f"{key}: a path is expected")
    return Path(text.strip()).expanduser() if text.strip() else None


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
