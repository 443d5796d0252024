"""Whether a sensor's calibration can be trusted, and what to record next where it can not."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from calib.sensor.choice import Choice
from calib.sensor.result import SensorSolution, SensorVerdict

Array = NDArray[np.float64]

MIN_ANGLE_DEG = 8.0  # between some two boards: less, focal length and distance trade places
STRIPES_NEEDED = 2
MAX_PLANE_SIGMA_DEG = 2.0  # of the plane's turn: beyond, boards met the sheet in one line or hardly at all
WEAK_PLANE_SIGMA_DEG = 0.1  # 0.5 mm at 300 mm
WEAK_FOCAL_SHARE = 0.005
WEAK_VIEWS = 5
WEAK_SOFT = 1 / 3  # of the views, out of focus: a lens's blur is not even, and draws corners its own way
MISFIT_PX = 1.0  # a lens that OpenCV's model knows leaves tenths
APART_PX = 1.0  # of whole stripes: a flat board that stood still leaves tenths
APART_OF_FEW_PX = 0.3  # of two or three, which follow the plane that they bend: a third of what they are off is seen
TOLD_APART = 4  # views with a stripe, from which what they have in common is part of every σ


def too_few(count: int) -> SensorVerdict:
    """The verdict on fewer views than can be solved."""
    seen = "no view shows" if count == 0 else "one view shows" if count == 1 else f"{count} views show"
    return SensorVerdict(
        "too_few_views", f"{seen} the board: at least three are needed, ten or more with tilts of 20° to 45° are good"
    )


def no_camera() -> SensorVerdict:
    """The verdict on corners that fit no camera at all."""
    return SensorVerdict(
        "not_converged",
        "the corners found fit no camera: is the board what board.toml says (its kind, its number of inner corners)?",
    )


def boards_parallel() -> SensorVerdict:
    """The verdict on boards that all stand alike."""
    return SensorVerdict(
        "boards_parallel",
        "all boards stand parallel: focal length, distance and laser plane can not be told apart; tilt the board "
        "by 20° to 45° about both its axes",
    )


def judge(
    choice: Choice, solution: SensorSolution, given: int, *, contradicted: bool, stripes_apart_px: float
) -> SensorVerdict:
    """The verdict on a solution.

    Parameters
    ----------
    choice, solution
        The terms chosen and their solution.
    given
        Views before any was left out.
    contradicted
        Whether a view still stands out though no more may be left out.
    stripes_apart_px
        How far whole stripes lie apart beyond their own noise.
    """
    sigma = solution.uncertainty.sigma
    turn = float(np.rad2deg(np.hypot(sigma["plane_tilt_y_rad"], sigma["plane_tilt_z_rad"])))
    focal = sigma["fx_px"] / solution.camera[0]
    with_stripe = int((choice.left_out.stripe_count > 0).sum())
    if contradicted:
        return SensorVerdict(
            "outliers",
            f"more of {given} views contradict the others than can be left out (a third, and three must stay): was the "
            "board moved between laser off and on, is the sensor itself the same in all, is the board flat?",
        )
    if _largest_angle_deg(solution) < MIN_ANGLE_DEG:
        return boards_parallel()
    if not choice.result.converged or not np.isfinite(turn + focal):
        return SensorVerdict("not_converged", "the bundle did not settle: check board.toml's corners and the pictures")
    if with_stripe < STRIPES_NEEDED or turn > MAX_PLANE_SIGMA_DEG:
        return SensorVerdict(
            "plane_not_determined",
            f"the laser plane is open to {turn:.2g}°: {with_stripe} views show the stripe, and they meet the sheet in "
            "nearly one line; record boards at other distances, so that the stripe falls elsewhere in the image",
        )
    apart = (
        f"stripes of whole views lie {stripes_apart_px:.2f} px apart beyond their noise and none stands out (a board "
        "that is not flat, or that moved between laser off and on?)"
    )
    few = with_stripe < TOLD_APART
    told = stripes_apart_px > (APART_OF_FEW_PX if few else APART_PX)
    if told and few:
        return SensorVerdict("outliers", f"{apart}; {with_stripe} do not tell which: record ten or more")
    return _on_quality(choice, solution, turn, focal, [apart] if told else [])


def _on_quality(choice: Choice, solution: SensorSolution, turn: float, focal: float, weak: list[str]) -> SensorVerdict:
    used = len(choice.bundle.views)
    errors = choice.bundle.corner_term.errors(choice.result.state).residual
    rms = float(np.sqrt(np.mean(np.sum(errors**2, axis=1))))
    if rms > MISFIT_PX:
        return SensorVerdict(
            "model_misfit",
            f"corners are {rms:.2f} px off: the board is not flat, the lens not of this kind, or corners are counted "
            "wrongly in board.toml; σ are widened by what is left",
        )
    weak = list(weak)
    soft = sum(v.soft for v in choice.bundle.views.views)
    if soft > WEAK_SOFT * used:
        weak.append(f"{soft} of {used} boards are out of focus (stop down, or keep them within the depth of field)")
    if used < WEAK_VIEWS:
        weak.append(f"only {used} views")
    if focal > WEAK_FOCAL_SHARE:
        weak.append(f"the focal length is known to {100 * focal:.2g} % only (tilt the board more)")
    if turn > WEAK_PLANE_SIGMA_DEG:
        weak.append(f"the laser plane's turn to {turn:.2g}° only (record nearer and farther boards)")
    if weak:
        return SensorVerdict("weak", "; ".join(weak))
    return SensorVerdict(
        "ok", f"{used} views agree; left-out views are predicted to {choice.left_out.plane_rms_mm:.3f} mm"
    )


def _largest_angle_deg(solution: SensorSolution) -> float:
    normal = solution.boards.R[..., :, 2]
    return float(np.rad2deg(np.arccos(np.clip(np.min(np.abs(normal @ normal.T)), 0.0, 1.0))))
