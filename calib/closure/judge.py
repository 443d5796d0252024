"""Is a calibrated robot better than its table? Judged on sockets that took no part in the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student_t

from calib.closure.terms import ClosureFit, Socket, closure_problem, positions, solve_closure
from geometry import InputError, Robot

Array = NDArray[np.float64]

PRIOR_SCALE = 3.0  # light arms are off by several times an industrial arm's default [uncertainty]
SEAT_MM = 0.1  # play of a ball in its socket, per axis, as recorded arms show it
_MIN_CONFIGURATIONS = 3  # fewer leave the socket's place and the tool's point open
_CONFIDENCE = 0.95  # that the larger model's gain is not chance


@dataclass(frozen=True)
class HeldOut:
    """Rms distance [mm] of one location's points from their sockets, by models fitted to the other locations."""

    location: str
    nominal_mm: float
    calibrated_mm: float

    @property
    def fall_mm2(self) -> float:
        """By how much the larger model makes the mean square smaller; negative where it predicts worse."""
        return self.nominal_mm**2 - self.calibrated_mm**2


@dataclass(frozen=True, eq=False)
class ClosureResult:
    """Both models fitted to all sockets, and each location predicted from the others.

    keep: the fit to be used; the calibrated one only where it gains. gain_mm2: mean fall of the held-out locations'
    mean squares, and its standard error over the locations, NaN where there are none.
    """

    nominal: ClosureFit
    calibrated: ClosureFit
    held_out: tuple[HeldOut, ...]
    text: str

    @property
    def gain_mm2(self) -> tuple[float, float]:
        """Mean and standard error of the held-out fall."""
        return _gain(self.held_out)

    @property
    def gains(self) -> bool:
        """Whether the larger model is shown to predict locations that it did not see better: Student's test of the
        falls of the mean square, one-sided, 95 %. A few locations' standard error is itself uncertain; the test knows.
        """
        return _shown(*self.gain_mm2, len(self.held_out))

    @property
    def keep(self) -> ClosureFit:
        """The fit to be used."""
        return self.calibrated if self.gains else self.nominal


def closure(
    sockets: Sequence[Socket],
    robot: Robot,
    distance_mm: float | None = None,
    prior_scale: float = PRIOR_SCALE,
    seat_mm: float = SEAT_MM,
) -> ClosureResult:
    """Fit the tool alone, and tool with robot, to sockets; choose between them by leave-one-location-out.

    distance_mm: between the two sockets of a base. prior_scale: times the robot's [uncertainty].
    """
    _check(sockets, robot)

    def fit(chosen: Sequence[Socket], larger: bool) -> ClosureFit:
        problem = closure_problem(chosen, robot, distance_mm, prior_scale, seat_mm)
        return solve_closure(problem, np.full(len(problem.prior_sigma), larger))

    held_out = []
    places = list(dict.fromkeys(s.location for s in sockets))
    for place in places if len(places) > 1 else []:
        others = [s for s in sockets if s.location != place]
        own = [s for s in sockets if s.location == place]
        rms = [held_out_rms(fit(others, larger), own) for larger in (False, True)]
        held_out.append(HeldOut(place, *rms))
    return ClosureResult(fit(sockets, False), fit(sockets, True), tuple(held_out), _text(held_out))


def held_out_rms(fit: ClosureFit, sockets: Sequence[Socket]) -> float:
    """Rms distance [mm] of a fit's tool points from the mean point of each socket."""
    square = []
    for s in sockets:
        x = positions(fit.robot, s.joints_rad, fit.tool_mm)
        square.append(np.sum((x - x.mean(axis=0)) ** 2, axis=1))
    return float(np.sqrt(np.mean(np.concatenate(square))))


def _gain(held_out: Sequence[HeldOut]) -> tuple[float, float]:
    falls = np.array([h.fall_mm2 for h in held_out])
    if len(falls) < 2:
        return float("nan"), float("nan")
    return float(falls.mean()), float(falls.std(ddof=1) / np.sqrt(len(falls)))


def _text(held_out: Sequence[HeldOut]) -> str:
    if len(held_out) < 2:
        return "one location only: the larger model can not be judged; add a location and calibrate again"
    mean, error = _gain(held_out)
    needed = float(student_t.ppf(_CONFIDENCE, len(held_out) - 1))
    figures = (
        f"at locations left out the mean square falls by {mean:.3f} ± {error:.3f} mm² (standard error over "
        f"{len(held_out)} locations; {needed:.1f} standard errors would show a gain)"
    )
    if _shown(mean, error, len(held_out)):
        return f"the calibrated robot is better: {figures}; use it"
    return f"no gain from the larger model is shown: {figures}; keep the nominal robot, or add locations"


def _shown(mean: float, error: float, count: int) -> bool:
    return count > 1 and bool(mean > student_t.ppf(_CONFIDENCE, count - 1) * error)


def _check(sockets: Sequence[Socket], robot: Robot) -> None:
    for s in sockets:
        if s.joints_rad.ndim != 2 or s.joints_rad.shape[1] != robot.n_joints:
            raise InputError(
                f"socket {s.location}/{s.name} has joint rows of {s.joints_rad.shape[-1]} values, the robot "
                f"{robot.n_joints} joints"
            )
        if len(s.joints_rad) < _MIN_CONFIGURATIONS:
            raise InputError(
                f"socket {s.location}/{s.name} has {len(s.joints_rad)} configurations: at least {_MIN_CONFIGURATIONS} "
                "are needed"
            )
        if not np.all(np.isfinite(s.joints_rad)):
            raise InputError(f"socket {s.location}/{s.name} holds a joint reading that is not finite")
