"""One solve of the labelled frames: starts, robust bundle, uncertainty, and what the data say of the answer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle.evidence import Evidence
from calib.bundle.hands import Hands
from calib.bundle.noise import Weighed, stated_cost, weigh
from calib.bundle.problem import Bundle, estimated_parameters, estimates_sensor
from calib.bundle.robust import RobustResult, solve_robust
from calib.bundle.solve import solve_bundle
from calib.bundle.starts import chain_start, hand_eye_start, strays
from calib.config import CalibConfig
from calib.engine import Covariance, Result, covariance, scaled_condition
from calib.figures import pose_distance
from calib.sensor_errors import SensorErrors
from geometry import Arm, Frame, Pose, Robot, Sensor, State, Surface, Target, stack_poses, with_beta_prior

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_HAND_SIGMA_MM, _HAND_SIGMA_DEG = 0.3, 0.03  # of poses from an arm's nominal table, until the residuals tell it

_STATED_BETA_DEG = 1e-4  # moves what an arm of a metre carries by 2 µm

_RIVAL_ITERATIONS = 100  # mirrored starts may lie far from the answer that they lead to
# of joints that follow from hand poses an error of the table is each frame's own, and gates by the file's σ lose frames
_OWN_LOST = 0.2  # share of the points lost by them from which gates so much wider are tried; a bad frame loses 0.05
_OWN_WIDER = 30.0
_MILLIMETRES = 1e4  # times the variance of points on surfaces, of some 0.01 mm: their σ are then a millimetre
_STRANGER_ITERATIONS = 20  # without it the others come to the millimetre, with it they stay far away
_STRANGER_TIMES = 4.0  # by which the fit without any other frame is worse: one that is not alone is no stranger
_OTHER_MM = 5.0  # poses of the target that are farther apart are different answers: mirrors stand 45 mm apart


@dataclass(frozen=True, eq=False)
class Solution:
    """The answer to the used calibrate frames.

    bundle: the problem with the noise that made the weights. every: its solve with robot and sensor free within their
    priors. result: the solve that answers. applied: robot parameters
    (P,) that its robot takes over. outlier (F, M), frame_outlier (F,): what was left out. Ts_sensor_target: each
    frame's own pose, of its candidates the one that agrees with the others. chi2_per_dof: of the model's own fit, by
    the noise of points and joints and the tolerance of the target's shape. explained, nominal: the same with all robot
    errors free within their priors, and with none; alone: the solve with none. noise: the σ that made the weights.
    rival: how much larger the χ² of the next best answer is (other poses from the same points); infinite where none.
    """

    bundle: Bundle
    every: Result
    result: Result
    alone: Result
    applied: Mask
    outlier: Mask
    frame_outlier: Mask
    covariance: Covariance
    condition: float
    Ts_sensor_target: Pose
    dof: int
    chi2_per_dof: float
    explained: float
    nominal: float
    noise: dict[str, float]
    rival: float

    @property
    def T_hand_sensor(self) -> Pose:
        """The solved SCP."""
        return self.result.state.pose("scp")

    @property
    def places(self) -> dict[str, Pose]:
        """T_base_target of every location."""
        poses = self.bundle.places(self.result.state)
        return {name: poses[k] for k, name in enumerate(self.bundle.locations)}

    @property
    def parameters(self) -> Array:
        """Corrections (P,) of the robot that belong to the answer."""
        return np.where(self.applied, self.result.state.vector("robot"), 0.0)

    @property
    def robot(self) -> Robot | None:
        """The robot with its corrections, None where only hand poses are known."""
        if self.bundle.hands.poses_only:
            return None
        robot = self.bundle.hands.robot
        return robot.corrected(self.parameters) if np.any(self.applied) else robot


def make_bundle(
    used: tuple[Frame, ...],
    target: Target | Mapping[str, Target],
    robot: Robot | None,
    config: CalibConfig,
    sensor: Sensor | None = None,
    evidence: Sequence[Evidence] = (),
) -> Bundle:
    """The problem of labelled frames on a target, or on one by location; without a ``sensor`` its file is exact.

    evidence: what is known beside the points.
    """
    bundle = _of_points(used, target, robot, config, sensor)
    return bundle.with_evidence(evidence) if evidence else bundle


def _of_points(
    used: tuple[Frame, ...],
    target: Target | Mapping[str, Target],
    robot: Robot | None,
    config: CalibConfig,
    sensor: Sensor | None,
) -> Bundle:
    errors = SensorErrors.of(sensor, estimates_sensor(config.model))
    joints = [f.joints_rad for f in used]
    locations = [f.location for f in used]
    if robot is None or any(q is None for q in joints):
        fixed = any(f.sensor_fixed for f in used)
        hands = Hands.at_poses(stack_poses([f.at for f in used]), _hand_noise(config), inverted=fixed)
        return Bundle.of([f.axis for f in used], locations, target, hands, errors=errors)
    inferred = any(f.joints_inferred for f in used)
    known = with_beta_prior(robot, float(np.deg2rad(max(config.beta_sigma_deg, _stated_beta_deg(robot)))))
    hands = Hands(known, np.array(joints), inferred)
    bundle = Bundle.of([f.axis for f in used], locations, target, hands, errors=errors)
    if inferred and config.hand_sigma_mm is not None and config.hand_sigma_deg is not None:
        given = Hands.at_poses(
            hands.pose(np.zeros(len(hands.sigma))), _hand_noise(config), inverted=used[0].sensor_fixed
        )
        return bundle.with_noise(1.0, given.noise)
    return bundle


def _stated_beta_deg(robot: Robot) -> float:
    """σ of Hayati's β in a table that states it: as good as exact, and a number that can be suspected."""
    stated = isinstance(robot, Arm) and bool(np.any(robot.dh_part().beta != 0))
    return _STATED_BETA_DEG if stated else 0.0


def _hand_noise(config: CalibConfig) -> Array:
    """Covariance (6, 6) of given hand poses, hand axes."""
    mm, deg = config.hand_sigma_mm or _HAND_SIGMA_MM, config.hand_sigma_deg or _HAND_SIGMA_DEG
    return np.diag(np.square([mm] * 3 + [np.deg2rad(deg)] * 3))


@dataclass(frozen=True, eq=False)
class Explained:
    """The frames solved with robot and sensor free within their priors, outliers out, noise weighed.

    kept: the problem without outliers. cost: by the noise stated. own: each frame's pose that agrees with the others.
    """

    kept: Bundle
    robust: RobustResult
    weighed: Weighed
    every: Result
    own: Pose

    @property
    def cost(self) -> float:
        """By the noise stated."""
        return stated_cost(self.weighed.stated, self.every)


def explain(
    bundle: Bundle, candidates: Sequence[Pose], T_hand_sensor: Pose, config: CalibConfig, start: State | None = None
) -> Explained:
    """Find outliers and noise with all errors free within their priors, from an SCP or from a ``start`` nearby."""
    robust, own = _robust(bundle, candidates, T_hand_sensor, config, start)
    if bundle.hands.inferred and np.mean(robust.left_out[bundle.present]) > _OWN_LOST:
        wide = bundle.knowing(robot=_OWN_WIDER * bundle.unknowns.block("robot").sigma)
        again, posed = _robust(wide, candidates, T_hand_sensor, config, start)
        if again.result.converged and np.sum(again.left_out) < np.sum(robust.left_out):
            robust, own = again, posed
    kept, every = bundle.without(robust.left_out), robust.result
    if bundle.hands.inferred:
        every = solve_bundle(kept.estimating(np.ones_like(bundle.estimated), sensor=True), every.state)
    weighed = weigh(kept, every, config)
    if weighed.changed:
        every = solve_bundle(weighed.bundle.estimating(every.unknowns.block("robot").free, sensor=True), every.state)
    return Explained(kept, robust, weighed, every, own)


def solve_problem(bundle: Bundle, candidates: Sequence[Pose], T_hand_sensor: Pose, config: CalibConfig) -> Solution:
    """Solve the bundle from the SCP given or, where that fails, from a closed form.

    candidates: poses T_sensor_target of each frame. Outliers and noise are judged with all robot errors free within
    their priors, so that a misfit of the nominal robot is not taken for either. χ² is by the stated noise of the
    points.
    """
    explained = explain(bundle, candidates, T_hand_sensor, config)
    rival = _rival(explained.kept, candidates, explained.own, explained.robust)
    return answered(bundle, explained, rival, config)


def answered(bundle: Bundle, explained: Explained, rival: float, config: CalibConfig) -> Solution:
    """The solution of the model asked for, and that of the nominal robot, with the noise and outliers found."""
    uncertain = bundle.unknowns.block("robot").sigma > 0
    applied = estimated_parameters(bundle.hands, config.model) & uncertain
    robust, weighed, every = explained.robust, explained.weighed, explained.every
    sensor = estimates_sensor(config.model) or not np.any(bundle.unknowns.block("sensor").sigma > 0)
    model = (
        every if np.all(applied | ~uncertain) and sensor else _fit_model(weighed.bundle, every, applied, sensor=sensor)
    )
    none = np.zeros_like(applied)
    nominal = _fit_model(weighed.bundle, every, none) if np.any(applied) or estimates_sensor(config.model) else model
    dof = explained.kept.degrees_of_freedom
    chi2, nominal_chi2 = (stated_cost(weighed.stated, fit) / max(dof, 1) for fit in (model, nominal))
    return Solution(
        bundle=weighed.bundle,
        every=every,
        result=model,
        alone=nominal,
        applied=applied,
        outlier=robust.outlier,
        frame_outlier=robust.frame_outlier,
        covariance=covariance(model),
        condition=scaled_condition(model, "scp"),
        Ts_sensor_target=explained.own,
        dof=dof,
        chi2_per_dof=chi2,
        explained=explained.cost / max(dof, 1),
        nominal=nominal_chi2,
        noise=weighed.noise,
        rival=rival,
    )


def _rival(kept: Bundle, candidates: Sequence[Pose], own: Pose, best: RobustResult) -> float:
    """How much more χ² the answer from the frames' other candidates has, or infinity where there is none."""
    if any(len(c) == 1 for c in candidates):
        return float("inf")
    others = [c[np.flatnonzero(pose_distance(c, own[i : i + 1]) > _OTHER_MM)] for i, c in enumerate(candidates)]
    if any(len(c) == 0 for c in others):
        return float("inf")
    state = best.result.state
    start, _ = chain_start(kept, state.pose("scp"), others)
    try:
        rival = solve_bundle(
            kept.estimating(best.result.unknowns.block("robot").free, sensor=True),
            start,
            max_iterations=_RIVAL_ITERATIONS,
        )
    except np.linalg.LinAlgError:
        return float("inf")
    apart = pose_distance(kept.places(rival.state), kept.places(state))
    different = rival.converged and float(np.max(apart)) > _OTHER_MM
    return max(0.0, rival.cost - best.result.cost) if different else float("inf")


def _robust(
    bundle: Bundle, candidates: Sequence[Pose], T_hand_sensor: Pose, config: CalibConfig, near: State | None
) -> tuple[RobustResult, Pose]:
    # of a pose's several joint solutions the wrong one may be taken: its robot errors are then its own, in the gates
    every = bundle.estimating(np.full(len(bundle.estimated), not bundle.hands.inferred), sensor=True)
    start, own = chain_start(bundle, T_hand_sensor, candidates)
    posed = not any(isinstance(t.target, Surface) for t in bundle.terms)  # one curve tells no pose of a surface
    stray = strays(bundle, start, own) if posed else None
    robust = solve_robust(every, near or start, config.outlier_chi2, config.max_outlier_share, stray)
    if near is None and not posed and np.mean(robust.left_out[bundle.present]) > config.max_outlier_share:
        robust = _without_stranger(every, start, config) or robust
    if near is not None or not _doubtful(robust):
        return robust, own
    nominal = bundle.hands.pose(start.vector("robot"))
    other = hand_eye_start(nominal, own, bundle.location) if posed else None
    if other is None:
        return robust, own
    start, again = chain_start(bundle, other, candidates)
    second = solve_robust(every, start, config.outlier_chi2, config.max_outlier_share)
    return (second, again) if _score(second) < _score(robust) else (robust, own)


def _without_stranger(every: Bundle, start: State, config: CalibConfig) -> RobustResult | None:
    """What the frames on surfaces tell without one that has drawn the fit away from all; None where that is not it."""
    alone = _stranger(every, start)
    if alone is None:
        return None
    less = solve_robust(every, alone[1], config.outlier_chi2, config.max_outlier_share, alone[0])
    few = float(np.mean(less.left_out[every.present])) <= config.max_outlier_share
    return less if few and less.result.converged else None


def _stranger(every: Bundle, start: State) -> tuple[Mask, State] | None:
    """The frame (F,) on a surface without which all others fit to the millimetre, and their fit; None where none is."""
    wide = every.with_noise(_MILLIMETRES, every.hand_noise)
    costs, states = list[float](), list[State]()
    for i in range(len(every.location)):
        less = wide.without(_one_frame(every, i)[:, None] & every.present)
        try:
            found = solve_bundle(less, start, max_iterations=_STRANGER_ITERATIONS)
        except np.linalg.LinAlgError:
            return None
        costs.append(found.cost)
        states.append(found.state)
    best, next_best = np.sort(costs)[:2] if len(costs) > 1 else (np.inf, np.inf)
    if next_best < _STRANGER_TIMES * best:
        return None
    k = int(np.argmin(costs))
    return _one_frame(every, k), states[k]


def _one_frame(bundle: Bundle, index: int) -> Mask:
    return np.asarray(np.arange(len(bundle.location)) == index)


def _fit_model(bundle: Bundle, every: Result, applied: Mask, *, sensor: bool = False) -> Result:
    """The bundle with only the ``applied`` robot parameters as unknowns, and the sensor's where asked."""
    rest = {} if sensor else {"sensor": bundle.unknowns.block("sensor").at_rest()}
    start = State({**every.state.values, "robot": np.zeros(len(applied)), **rest})
    return solve_bundle(bundle.estimating(applied, sensor=sensor), start)


def _doubtful(robust: RobustResult) -> bool:
    return not robust.result.converged or bool(np.mean(robust.outlier) > 0.05 or np.any(robust.frame_outlier))


def _score(robust: RobustResult) -> tuple[bool, int, float]:
    return not robust.result.converged, int(robust.left_out.sum()), robust.result.cost
