"""Is a calibrated robot better than its table? Judged on sockets that took no part in the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from calib.closure.terms import ClosureFit, Socket, closure_problem, positions, predicted_covariance, solve_closure
from geometry import InputError, Robot
from geometry.special import stdtrit

Array = NDArray[np.float64]
Code = Literal[
    "ok",
    "no_gain",
    "too_few_locations",
    "not_converged",
    "robot_contradicts",
    "distance_contradicts",
    "priors_contradict",
]

PRIOR_SCALE = 3.0  # light arms are off by several times an industrial arm's default [uncertainty]
SEAT_MM = 0.1  # play of a ball in its socket, per axis, as recorded arms show it
MIN_LOCATIONS = 2  # one alone can not be left out
TRUSTED: frozenset[Code] = frozenset({"ok", "no_gain"})
_MIN_CONFIGURATIONS = 3  # fewer leave the socket's place and the tool's point open
_CONFIDENCE = 0.95  # that the larger model's gain is not chance
_RIGHT_CHI2 = 20.0  # by which a stated distance may fit worse than the best one: 4.5 σ; recorded arms stay below 16.3
_GROSS_MM = 50.0  # rms of the sockets by the table as given, where no arm's errors are so large
# recorded arms close to χ² 0.4 to 5.4 with pulls up to 14 σ (a joint zeroed anew, by 1.2°); other arms' tables do not
_MAX_CHI2 = 30.0
_MAX_PULL = 20.0  # of the prior's σ, three times [uncertainty]: 1.8° of a θ, 9 mm of a length


@dataclass(frozen=True)
class Correction:
    """What a fit corrects of one of the robot's parameters, in ``unit``, and in the σ of its prior."""

    parameter: str
    size: float
    unit: str
    pull_sigma: float


@dataclass(frozen=True)
class HeldOut:
    """Rms distance [mm] of one location's points from their sockets, by models fitted to the other locations.

    nominal_sigma_mm, calibrated_sigma_mm: what each model expects of it.
    """

    location: str
    nominal_mm: float
    calibrated_mm: float
    nominal_sigma_mm: float
    calibrated_sigma_mm: float

    @property
    def fall_mm2(self) -> float:
        """By how much the larger model makes the mean square smaller; negative where it predicts worse."""
        return self.nominal_mm**2 - self.calibrated_mm**2


@dataclass(frozen=True, eq=False)
class ClosureResult:
    """Both models fitted to all sockets, and each location predicted from the others.

    code, text: the judgement. found_distance_mm: of two sockets by the arm alone, with its σ, where one was given.
    pulls: of the calibrated robot's parameters, largest first.
    """

    nominal: ClosureFit
    calibrated: ClosureFit
    held_out: tuple[HeldOut, ...]
    code: Code
    text: str
    found_distance_mm: tuple[float, float] | None
    pulls: tuple[Correction, ...]

    @property
    def gain_mm2(self) -> tuple[float, float]:
        """Mean and standard error of the held-out fall of the mean square over the locations; NaN where none are."""
        return _gain(self.held_out)

    @property
    def gains(self) -> bool:
        """Whether the larger model is shown to predict locations that it did not see better: Student's test of the
        falls of the mean square, one-sided, 95 %. A few locations' standard error is itself uncertain; the test knows.
        """
        return _shown(*self.gain_mm2, len(self.held_out))

    @property
    def keep(self) -> ClosureFit:
        """The fit to be used; the calibrated one only where it gains."""
        return self.calibrated if self.gains else self.nominal

    @property
    def trustworthy(self) -> bool:
        """Whether the fit that is kept may be used."""
        return self.code in TRUSTED

    @property
    def widened(self) -> float:
        """How many times too small the kept model's σ are for what the locations left out show; 1 where not."""
        seen = sum((h.calibrated_mm if self.gains else h.nominal_mm) ** 2 for h in self.held_out)
        expected = sum((h.calibrated_sigma_mm if self.gains else h.nominal_sigma_mm) ** 2 for h in self.held_out)
        return max(1.0, float(np.sqrt(seen / expected))) if self.held_out else 1.0

    @property
    def predicted_sigma_mm(self) -> float | None:
        """σ (3-D) of positions at a location that took no part, by the kept model; None where none was left out."""
        sigmas = [h.calibrated_sigma_mm if self.gains else h.nominal_sigma_mm for h in self.held_out]
        return self.widened * float(np.sqrt(np.mean(np.square(sigmas)))) if sigmas else None

    @property
    def tool_covariance(self) -> Array:
        """Of the kept tool's point (3, 3) [mm²], with what the locations left out show."""
        return self.keep.tool_covariance * self.widened**2


def closure(
    sockets: Sequence[Socket],
    robot: Robot,
    distance_mm: float | None = None,
    prior_scale: float = PRIOR_SCALE,
    seat_mm: float = SEAT_MM,
) -> ClosureResult:
    """Fit the tool alone, and tool with robot, to sockets; choose between them by leave-one-location-out.

    Parameters
    ----------
    sockets : sequence of Socket
        One or two at each location.
    robot : Robot
        Nominal, with its [uncertainty].
    distance_mm : float, optional
        Between the two sockets of a base.
    prior_scale : float
        Times the robot's [uncertainty].
    seat_mm : float
        σ of the ball in its socket, per axis.

    Returns
    -------
    ClosureResult

    Raises
    ------
    InputError
        Where readings do not fit the robot or are not in radians.
    """
    _check(sockets, robot)

    def fit(chosen: Sequence[Socket], larger: bool, scale: float = prior_scale, free: bool = False) -> ClosureFit:
        problem = closure_problem(chosen, robot, distance_mm, scale, seat_mm)
        return solve_closure(problem, np.full(len(problem.prior_sigma), larger), free)

    calibrated = fit(sockets, True)
    shown = prior_scale * _prior_share(calibrated)  # the errors that this arm has, for what its table alone predicts
    nominal = fit(sockets, False, shown)
    held_out = []
    places = list(dict.fromkeys(s.location for s in sockets))
    for place in places if len(places) > 1 else []:
        others = [s for s in sockets if s.location != place]
        own = [s for s in sockets if s.location == place]
        fits = fit(others, False, shown), fit(others, True)
        rms, sigma = [held_out_rms(f, own) for f in fits], [predicted_rms(f, own) for f in fits]
        held_out.append(HeldOut(place, *rms, *sigma))
    pairs = len(sockets) - len(places)
    tried = fit(sockets, True, free=True) if distance_mm is not None and pairs else None
    pulls = _pulls(calibrated, robot)
    code, text = _judged(nominal, calibrated, tried, held_out, pulls)
    found = None if tried is None else tried.distance_mm
    return ClosureResult(nominal, calibrated, tuple(held_out), code, text, found, pulls)


def closing_rms(sockets: Sequence[Socket], robot: Robot) -> float:
    """Rms distance [mm] of a robot's tool points from their sockets, its table as given; for telling arms apart."""
    problem = closure_problem(sockets, robot, None, 1.0, SEAT_MM)
    return solve_closure(problem, np.zeros(len(problem.prior_sigma), dtype=bool)).rms_mm


def held_out_rms(fit: ClosureFit, sockets: Sequence[Socket]) -> float:
    """Rms distance [mm] of a fit's tool points from the mean point of each socket."""
    square = []
    for s in sockets:
        x = positions(fit.robot, s.joints_rad, fit.tool_mm)
        square.append(np.sum((x - x.mean(axis=0)) ** 2, axis=1))
    return float(np.sqrt(np.mean(np.concatenate(square))))


def predicted_rms(fit: ClosureFit, sockets: Sequence[Socket]) -> float:
    """The same as the fit's own uncertainty expects it [mm]."""
    total = sum(float(np.trace(predicted_covariance(fit, s.joints_rad))) for s in sockets)
    return float(np.sqrt(total / sum(len(s.joints_rad) for s in sockets)))


def _prior_share(calibrated: ClosureFit) -> float:
    """Which share of its prior σ the arm's errors show: departures over those that the data could have found."""
    expected = calibrated.learnt
    return float(np.sqrt(np.sum(calibrated.pulls**2) / expected)) if expected > 1 else 1.0


def _judged(
    nominal: ClosureFit,
    calibrated: ClosureFit,
    tried: ClosureFit | None,
    held_out: Sequence[HeldOut],
    pulls: Sequence[Correction],
) -> tuple[Code, str]:
    """The gravest first. tried: the calibrated robot with the distance of two sockets free."""
    if nominal.rms_mm > _GROSS_MM or calibrated.chi2_per_dof > _MAX_CHI2:
        best = tried if tried is not None and tried.chi2_per_dof < _MAX_CHI2 else None
        if best is None or nominal.rms_mm > _GROSS_MM:
            return "robot_contradicts", (
                f"no table near this robot's closes the sockets (rms {nominal.rms_mm:.3g} mm as given): check that it "
                "is this arm, the order, sign and unit of the joints, and which socket each file holds"
            )
    if not calibrated.converged:
        return "not_converged", "no minimum was reached: check the robot, the order and unit of the joints, the files"
    if tried is not None and tried.distance_mm is not None and calibrated.distance_mm is not None:
        excess = (calibrated.cost - tried.cost) / max(1.0, tried.chi2_per_dof)
        if excess > _RIGHT_CHI2 and np.max(np.abs(tried.pulls)) < _MAX_PULL:  # else the table, not the distance
            found, sigma = tried.distance_mm
            return "distance_contradicts", (
                "the distance of the sockets contradicts the arm: its table within its uncertainty puts them "
                f"{found:.2f} ± {sigma:.2f} mm apart, not {calibrated.distance_mm[0]:g} ({np.sqrt(excess):.0f} σ): "
                "check --distance-mm, in mm, from centre to centre"
            )
    if pulls and abs(pulls[0].pull_sigma) > _MAX_PULL:
        return "priors_contradict", (
            f"the sockets close only if {_in_words(pulls[:3])}: the robot's file is hardly this arm's; check its "
            "table, the joints' zeros and [uncertainty]"
        )
    if len(held_out) < MIN_LOCATIONS:
        return (
            "too_few_locations",
            "one location only: the larger model can not be judged; add a location and calibrate again",
        )
    return ("ok" if _shown(*_gain(held_out), len(held_out)) else "no_gain"), _text(held_out)


def _pulls(fit: ClosureFit, robot: Robot) -> tuple[Correction, ...]:
    rows = []
    for p, value, pull in zip(robot.parameters, fit.parameters, fit.pulls, strict=False):
        size, unit = (np.rad2deg(value), "deg") if p.unit == "rad" else (value, p.unit)
        rows.append(Correction(p.name, float(size), unit, float(pull)))
    return tuple(sorted(rows, key=lambda row: (-round(abs(row.pull_sigma), 6), row.parameter)))


def _in_words(pulls: Sequence[Correction]) -> str:
    return ", ".join(f"{p.parameter} is changed by {p.size:+.3g} {p.unit} ({abs(p.pull_sigma):.0f} σ)" for p in pulls)


def _gain(held_out: Sequence[HeldOut]) -> tuple[float, float]:
    falls = np.array([h.fall_mm2 for h in held_out])
    if len(falls) < MIN_LOCATIONS:
        return float("nan"), float("nan")
    return float(falls.mean()), float(falls.std(ddof=1) / np.sqrt(len(falls)))


def _text(held_out: Sequence[HeldOut]) -> str:
    mean, error = _gain(held_out)
    needed = float(stdtrit(len(held_out) - 1, _CONFIDENCE))
    figures = (
        f"at locations left out the mean square falls by {mean:.3f} ± {error:.3f} mm² (standard error over "
        f"{len(held_out)} locations; {needed:.1f} standard errors would show a gain)"
    )
    if _shown(mean, error, len(held_out)):
        return f"the calibrated robot is better: {figures}; use it"
    return f"no gain from the larger model is shown: {figures}; keep the nominal robot, or add locations"


def _shown(mean: float, error: float, count: int) -> bool:
    return count > 1 and bool(mean > stdtrit(count - 1, _CONFIDENCE) * error)


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
