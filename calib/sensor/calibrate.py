"""A sensor's calibration from views of a board with the laser's stripe on it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.sensor.bundle import TILT_NAMES, SensorBundle, camera_start, sensor_part
from calib.sensor.choice import LENGTH, Choice, choose_terms
from calib.sensor.contradiction import common_error_px, contradicting_stripes
from calib.sensor.left_out import left_out
from calib.sensor.mirrored import mirrored
from calib.sensor.noise import with_noise
from calib.sensor.on_line import MIN_POINTS, on_one_line, second_line
from calib.sensor.result import SensorCalibration, SensorSolution, SensorVerdict, ViewResult
from calib.sensor.shape import BoardShape, found_shape
from calib.sensor.sheet_frame import SheetFrame, sheet_frame, to_sheet
from calib.sensor.start import stand_alike, view_homographies
from calib.sensor.stated import Answer, tangent_uncertainty, uncertainty_of_tilts, with_scale
from calib.sensor.terms import BOARD, CAMERA, PLANE
from calib.sensor.tilts import possible_tilts
from calib.sensor.valley import settled
from calib.sensor.verdict import boards_parallel, judge, no_camera, too_few
from calib.sensor.views import BoardView, BoardViews
from geometry import Pose, State
from geometry.sensor import CAMERA_PARAMETERS, SensorUncertainty, calibration_covariance

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FEWEST_VIEWS = 3
COARSE_PX, FINE_PX = 3.0, 1.0  # from a board's line, before and after the lens is known
CORNER_SIGMAS, STRIPE_SIGMAS = 5.0, 4.5  # beyond which a point is none; of robust σ: one in a million by chance
VIEW_RATIO = 3.0  # reprojection of a left-out view over the usual: beyond what tilt and focus make
MAX_LEFT_OUT = 1 / 3  # share of views without which there is no answer
SECOND_SHARE = 0.15  # of a view's stripe points, on another line than the rest: worth a word
ALIKE_RAD = 2e-3  # between any two boards: less than a parallel rig repeats, from which no camera can be begun
_ROUNDS = 2  # of dropping points and solving again


@dataclass(frozen=True, eq=False)
class SensorSettings:
    """How a sensor is calibrated.

    Parameters
    ----------
    max_terms : int
        Longest vector of OpenCV's distortion terms that may be used, 0 to 14.
    origin_yz_mm : (float, float)
        Where {P}'s origin stands, from the foot of the camera's centre.
    flat_mm, print_mm : float or None
        σ of the board's sag at half its diagonal, and of its corners' places; 0 where it is flat, or its corners stand
        where they are stated; what is usual where None.
    """

    max_terms: int = 14
    origin_yz_mm: tuple[float, float] = (0.0, 0.0)
    flat_mm: float | None = None
    print_mm: float | None = None


def calibrate_sensor(
    views: Sequence[BoardView], size_px: tuple[int, int], settings: SensorSettings | None = None
) -> SensorCalibration:
    """Camera, board poses and laser plane in one bundle.

    Parameters
    ----------
    views
        Corners and stripe points of every view, pixels from the top-left pixel's centre.
    size_px
        Width and height of the image.
    settings
        The defaults where None.

    Returns
    -------
    calibration
        With a verdict; the solution is None where none could be computed.

    References
    ----------
    docs/sensor.md tells the stages and what they reach.
    """
    settings = settings or SensorSettings()
    centre = (np.array(size_px) - 1) / 2
    given = tuple(_centred(v, centre) for v in views)
    if len(given) < FEWEST_VIEWS:
        return SensorCalibration(too_few(len(given)), tuple(ViewResult(v.name, True, None) for v in views))
    with np.errstate(over="ignore", invalid="ignore"):  # where few views show the stripe, left-out ones lie anywhere
        return _calibrated(given, size_px, settings, centre)


def _calibrated(
    given: tuple[BoardView, ...], size_px: tuple[int, int], settings: SensorSettings, centre: Array
) -> SensorCalibration:
    """`calibrate_sensor` of views whose pixels count from the image's centre."""
    every = tuple(ViewResult(v.name, True, None) for v in given)
    try:
        if stand_alike(view_homographies(given), size_px[0], ALIKE_RAD):
            return SensorCalibration(boards_parallel(), every)
        attempt = _Attempt.start(given, size_px, settings)
        while True:
            worst = attempt.worst()
            out = len(attempt.dropped) + 1
            if worst is None or out > MAX_LEFT_OUT * len(given) or len(given) - out < FEWEST_VIEWS:
                break
            attempt = attempt.without(*worst)
    except np.linalg.LinAlgError:  # the state went beyond all numbers
        return SensorCalibration(no_camera(), every)
    return attempt.with_mirrors().answer(centre, contradicted=worst is not None)


@dataclass(frozen=True, eq=False)
class _Attempt:
    """The solution from the views that are still trusted."""

    given: tuple[BoardView, ...]
    size_px: tuple[int, int]
    settings: SensorSettings
    dropped: dict[str, str]
    choice: Choice | None
    state: State

    @staticmethod
    def start(given: tuple[BoardView, ...], size_px: tuple[int, int], settings: SensorSettings) -> _Attempt:
        return _Attempt._of(given, size_px, settings, {})

    def without(self, name: str, reason: str) -> _Attempt:
        """The same with one view left out."""
        return _Attempt._of(self.given, self.size_px, self.settings, {**self.dropped, name: reason})

    @staticmethod
    def _of(
        given: tuple[BoardView, ...], size_px: tuple[int, int], settings: SensorSettings, dropped: dict[str, str]
    ) -> _Attempt:
        views = BoardViews(tuple(v for v in given if v.name not in dropped))
        width = float(size_px[0])
        state = camera_start(views, width)
        views = _on_lines(views, state, COARSE_PX)
        if not len(views.stripe):
            return _Attempt(given, size_px, settings, dropped, None, state)
        shape = BoardShape.of(views, settings.flat_mm, settings.print_mm)
        choice = choose_terms(SensorBundle(views, (), width, shape=shape), state, settings.max_terms)
        for _ in range(_ROUNDS):
            cleaned = _without_outliers(_on_lines(views, choice.result.state, FINE_PX, shape), choice)
            if not len(cleaned.stripe):  # what was found is no straight line of any board
                return _Attempt(given, size_px, settings, dropped, None, state)
            bundle = replace(choice.bundle, views=cleaned)
            result = settled(bundle, choice.result.state)
            bundle = with_noise(bundle, result)
            result = settled(bundle, result.state)
            choice = replace(choice, bundle=bundle, result=result, left_out=left_out(bundle, result))
        return _Attempt(given, size_px, settings, dropped, choice, choice.result.state)

    def worst(self) -> tuple[str, str] | None:
        """The view that the others contradict most, and why; None where none stands out."""
        if self.choice is None:
            return None
        out, names = self.choice.left_out, self.choice.bundle.views.names
        ratio = np.sqrt(out.corner_deviance / np.maximum(out.corner_dof, 1))
        ratio = ratio / np.median(ratio) / VIEW_RATIO
        if ratio.max() > 1:
            i = int(np.argmax(ratio))
            return names[i], f"its corners are {out.corner_px[i]:.2f} px off where the other views expect them"
        most = int(MAX_LEFT_OUT * len(self.given)) + 1 - len(self.dropped)  # one more than may be: then it is said
        found = contradicting_stripes(self.choice.bundle, self.choice.result, most)
        if found is None:
            return None
        return names[found.views[0]], (
            f"its stripe lies {found.off_px[0]:.2f} px off where the other views expect it "
            f"(the board moved between the two pictures?)"
        )

    def with_mirrors(self) -> _Attempt:
        """The same, of views that were left out said where their pictures are mirrored."""
        if self.choice is None:
            return self
        dropped = dict(self.dropped)
        for view in self.given:
            way = mirrored(view, self.choice) if view.name in dropped else None
            if way is not None:
                dropped[view.name] = (
                    f"the picture is {way}: seen the other way its stripe lies where the other views expect it (a flip "
                    "in the camera's driver?)"
                )
        return replace(self, dropped=dropped)

    def _second_stripes(self, choice: Choice) -> list[str]:
        """Views in which many points of the stripe lie on another straight line than those that were used."""
        given = {v.name: v for v in self.given}
        said = []
        for i, kept in enumerate(choice.bundle.views.views):
            if not len(kept.stripe):
                continue
            every = given[kept.name]
            count = second_line(every, kept, choice.result.state, i, COARSE_PX, choice.bundle.shape)
            if count > SECOND_SHARE * len(every.stripe):
                said.append(
                    f"{kept.name}: {count} of {len(every.stripe)} points of the stripe lie on another line than the "
                    "rest (a reflection of the laser, or a surface that is not the board): they are left out"
                )
        return said

    def answer(self, centre: Array, contradicted: bool) -> SensorCalibration:
        """Everything that is told."""
        results = {n: ViewResult(n, False, reason) for n, reason in self.dropped.items()}
        choice = self.choice
        if choice is None:
            every = tuple(results.get(v.name, ViewResult(v.name, True, None)) for v in self.given)
            return SensorCalibration(
                SensorVerdict("plane_not_determined", "no view shows a stripe on its board: the laser plane is open"),
                every,
            )
        bundle, result = choice.bundle, choice.result
        answer = Answer(
            result.state.vector(CAMERA),
            result.state.vector(PLANE),
            sheet_frame(result.state.vector(CAMERA), result.state.vector(PLANE), self.settings.origin_yz_mm),
            self.size_px,
        )
        results |= _view_results(choice, answer.frame, centre)
        distances = bundle.stripe_term.distances(result.state).residual
        errors = bundle.corner_term.errors(result.state).residual
        of_all = bundle.covariance_of_all(result)
        covariance = sensor_part(of_all, result.unknowns)
        solution = _solution(choice, answer, tangent_uncertainty(answer, bundle.terms, covariance), centre)
        between = common_error_px(bundle, result)
        verdict = judge(choice, solution, len(self.given), contradicted=contradicted, stripes_apart_px=between)
        left_out_mm = choice.left_out.plane_rms_mm
        if verdict.code == "plane_not_determined":  # nor is where the others expect a stripe
            left_out_mm, results = float("nan"), {n: replace(r, left_out_mm=float("nan")) for n, r in results.items()}
        tilt_fits = verdict.is_answer and self.settings.max_terms >= LENGTH[TILT_NAMES[0]]
        tilts = possible_tilts(bundle, result, covariance) if tilt_fits else None
        yz = to_sheet(answer.camera, answer.frame, bundle.views.stripe.uv_px)
        if tilts is not None:
            terms = (*(t for t in bundle.terms if t not in TILT_NAMES), *TILT_NAMES)
            solution = replace(solution, uncertainty=uncertainty_of_tilts(answer, terms, tilts, yz))
        shape = None if bundle.shape is None else found_shape(bundle.shape, result, of_all)
        if shape is not None:
            distance = 1 / float(np.linalg.norm(answer.plane))
            solution = replace(solution, uncertainty=with_scale(solution.uncertainty, distance, shape.sigma_scale))
        depth, sigma = _depth_sigma(answer, solution.uncertainty, yz)
        whitened = bundle.corner_term.independent_rows(result.state).residual * bundle.corner_scale
        return (
            SensorCalibration(
                verdict=verdict,
                views=tuple(results[v.name] for v in self.given),
                solution=solution,
                reprojection_rms_px=float(np.sqrt(np.mean(np.sum(errors**2, axis=1)))),
                plane_rms_mm=float(np.sqrt(np.mean(distances**2))),
                left_out_px=choice.left_out.reprojection_rms_px,
                left_out_mm=left_out_mm,
                corner_scale=bundle.corner_scale,
                stripe_scale=float(np.median(bundle.stripe_noise.scale)),
                offset_px=bundle.stripe_noise.offset_px,
                chi2_per_dof=_chi2(choice),
                sigma_z_mm=sigma,
                depth_mm=depth,
                tried=choice.tried,
                tilts=tilts,
                shape=shape,
                notes=tuple(self._second_stripes(choice)),
            )
            if len(whitened)
            else SensorCalibration(verdict, tuple(results.values()))
        )


def _chi2(choice: Choice) -> float:
    """Of all residuals with the noise found, per degree of freedom."""
    r = choice.result
    rows = sum(term.independent_rows(r.state).residual.size for term in choice.bundle.evidence)
    dof = rows - 6 * len(choice.bundle.views) - int(r.unknowns.free.sum())
    return r.cost / max(dof, 1)


def _centred(view: BoardView, centre: Array) -> BoardView:
    return replace(
        view,
        corners=replace(view.corners, uv_px=view.corners.uv_px - centre),
        stripe=replace(view.stripe, uv_px=view.stripe.uv_px - centre),
    )


def _on_lines(views: BoardViews, state: State, tolerance_px: float, shape: BoardShape | None = None) -> BoardViews:
    return BoardViews(tuple(on_one_line(v, state, i, tolerance_px, shape) for i, v in enumerate(views.views)))


def _without_outliers(views: BoardViews, choice: Choice) -> BoardViews:
    """The views without corners and stripe points that lie far off all others of their kind."""
    bundle = replace(choice.bundle, views=views)
    state = choice.result.state
    white = bundle.corner_term.independent_rows(state).residual.reshape(-1, 2)
    size = np.linalg.norm(white, axis=1)
    fine = size < CORNER_SIGMAS * max(float(np.median(size)) / 1.177, 1e-12)  # the median of two normal numbers' length
    along = bundle.stripe_term.errors(state).residual
    out = []
    for i, v in enumerate(views.views):
        mine = views.view_of_stripe == i
        z = along[mine] / views.stripe.sigma_px[mine]
        z = z - (np.median(z) if len(z) else 0.0)
        good = np.abs(z) < STRIPE_SIGMAS * max(1.4826 * float(np.median(np.abs(z))) if len(z) else 1.0, 1e-12)
        stripe = v.stripe[good] if good.sum() >= MIN_POINTS else v.stripe[:0]
        kept = fine[views.view_of_corner == i]
        corners = v.corners[kept] if kept.sum() >= 4 else v.corners
        out.append(replace(v, corners=corners, stripe=stripe))
    return BoardViews(tuple(out))


def _view_results(choice: Choice, frame: SheetFrame, centre: Array) -> dict[str, ViewResult]:
    bundle, state, out = choice.bundle, choice.result.state, choice.left_out
    views = bundle.views
    errors = bundle.corner_term.errors(state).residual
    distances = bundle.stripe_term.distances(state).residual
    yz = to_sheet(state.vector(CAMERA), frame, views.stripe.uv_px)
    board = state.pose(BOARD)
    results = {}
    for i, v in enumerate(views.views):
        mine, on = views.view_of_corner == i, views.view_of_stripe == i
        results[v.name] = ViewResult(
            v.name,
            True,
            None if on.any() else "no stripe was found on its board: its corners are used",
            float(np.sqrt(np.mean(np.sum(errors[mine] ** 2, axis=1)))),
            float(np.sqrt(np.mean(distances[on] ** 2))) if on.any() else float("nan"),
            float(out.corner_px[i]),
            float(out.stripe_mm[i]),
            v.corners.uv_px + centre,
            errors[mine],
            v.stripe.uv_px + centre,
            yz[on],
            distances[on],
            float(np.rad2deg(np.arccos(min(1.0, abs(board.R[i, 2, 2]))))),
            Pose(board.R[i], board.t[i]),
        )
    return results


def _solution(choice: Choice, answer: Answer, known: SensorUncertainty, centre: Array) -> SensorSolution:
    camera = answer.camera.copy()
    camera[2:4] += centre
    distance = float(1 / np.linalg.norm(answer.plane))
    boards = choice.result.state.pose(BOARD)
    lens = tuple(t for t in choice.bundle.terms if t in CAMERA_PARAMETERS)
    return SensorSolution(camera, lens, answer.plane * distance, distance, answer.frame, known, boards)


def _depth_sigma(
    answer: Answer, known: SensorUncertainty, yz_mm: Array
) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
    """Z [mm] near, middle and far where the stripes were seen, and σ of z there by the sensor's own uncertainty."""
    order = np.argsort(yz_mm[:, 1], kind="stable")
    chosen = yz_mm[order[[0, len(order) // 2, -1]]]
    own = calibration_covariance(replace(answer.sensor, uncertainty=known), chosen)
    assert own is not None  # noqa: S101 - what is known is stated
    (near, middle, far), sigma = chosen[:, 1].tolist(), np.sqrt(own[:, 1, 1]).tolist()
    return (near, middle, far), (sigma[0], sigma[1], sigma[2])
