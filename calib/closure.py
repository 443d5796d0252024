"""Is a calibrated robot better than its table? Judged on sockets that took no part in the fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.closure_problem import ClosureFit, Socket, closure_problem, positions, solve_closure
from geometry import InputError, RobotModel

Array = NDArray[np.float64]

PRIOR_SCALE = 3.0  # light arms are off by several times an industrial arm's default [uncertainty]
SEAT_MM = 0.1
_MIN_CONFIGURATIONS = 3
_GAIN = 0.9  # a held-out rms must fall below this share of the nominal robot's


@dataclass(frozen=True)
class HeldOut:
    """Rms distance [mm] of one location's points from their sockets, by models fitted to the other locations."""

    location: str
    nominal_mm: float
    calibrated_mm: float

    @property
    def gains(self) -> bool:
        """Whether the larger model is better here."""
        return self.calibrated_mm < _GAIN * self.nominal_mm


@dataclass(frozen=True, eq=False)
class ClosureResult:
    """Both models fitted to all sockets, and each location predicted from the others.

    keep: the fit to be used; the calibrated one only where it is better at every location it did not see.
    """

    nominal: ClosureFit
    calibrated: ClosureFit
    held_out: tuple[HeldOut, ...]
    text: str

    @property
    def gains(self) -> bool:
        """Whether the larger model is better at every held-out location."""
        return bool(self.held_out) and all(h.gains for h in self.held_out)

    @property
    def keep(self) -> ClosureFit:
        """The fit to be used."""
        return self.calibrated if self.gains else self.nominal


def closure(
    sockets: Sequence[Socket],
    robot: RobotModel,
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


def _text(held_out: Sequence[HeldOut]) -> str:
    if not held_out:
        return "one location only: the larger model can not be judged; add a location and calibrate again"
    worse = [h for h in held_out if not h.gains]
    if not worse:
        return "the calibrated robot is better at every location that it did not see: use it"
    places = ", ".join(f"{h.location} ({h.nominal_mm:.3f} → {h.calibrated_mm:.3f} mm)" for h in worse)
    return f"no gain from the larger model at {places}: keep the nominal robot"


def _check(sockets: Sequence[Socket], robot: RobotModel) -> None:
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
