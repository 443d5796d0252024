"""Which noise makes the weights: what was stated, unless the residuals contradict it; then what they say it is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from calib.bundle.problem import Bundle
from calib.bundle.solve import hand_twists, linearisations, other_linearisations
from calib.config import CalibConfig
from calib.engine import Result, deviance, lowest, total_cost
from geometry import require_arm
from geometry.robot import is_arm

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_MAX_EVALUATIONS = 80  # of the deviance; two variances settle in some forty
_LOG_TOLERANCE = 0.02  # of a variance; far below its own uncertainty
_DEVIANCE_TOLERANCE = 1e-2  # 4.6 would be one percent by chance
_SCORE_STEP = 0.3  # of a variance's logarithm, for differences by it
_MAX_LOG = 14.0  # a variance a million times smaller or larger than at the start: a σ a thousand times so
_SIMPLEX = -0.7  # first steps of the search, in the logarithm of a variance

# benchmarks/calib_consistency.py and benchmarks/calib_targets.py show that σ stay true with these, also where the noise
# stated is wrong
# σ of the logarithms of two variances that are not as stated: the points' bounds below are two of them; joints, whose σ
# is a data sheet's or a habit's, are commonly off by a factor of two
_PRIOR_LOG = np.array([0.46, 1.39])
_LEAST_SHARE = 0.1  # of the other noise; with less nothing is changed
_STEPS, _SETTLED = 12, 1e-4  # of Newton's steps to it, in logarithms; four to six are taken
_CONTRADICTION = 13.8  # deviance gained by two variances; 0.1 % by chance
_POINT_BOUNDS = (0.5, 2.5)  # factors of a variance beyond which the model, not the noise, is wrong
_JOINT_BOUNDS = (0.01, 9.0)  # of the joints' variance: an arm ten times better or three times worse than stated
_OWN_BOUNDS = (0.0, 1e4)  # of a share; above 1 the robot's errors are up to a hundred times what the file says
_LARGER_GAIN = 16.0  # deviance: what a pull of 4 σ gains
# of the noise: of readings as weighed and as their file has it; of points, over theirs
JOINT, JOINT_STATED, POINTS = "joint_sigma_deg", "joint_sigma_stated_deg", "point_sigma_factor"
ROBOT_TIMES, ROBOT_EVIDENCE = "robot_error_times", "robot_error_evidence_sigma"  # of the noise found, where larger
_OWN_START = 0.1  # share of the robot's variance that is a frame's own, where its search starts
_MAX_CHI2 = 10.0  # per degree of freedom; beyond this something else than the noise is wrong


@dataclass(frozen=True, eq=False)
class Weighed:
    """The problem with the noise that makes the weights, and with the noise by which χ² is formed.

    stated: the points' own covariances; the joints' noise as stated or, where smaller, as found. noise: the σ, by name.
    """

    bundle: Bundle
    stated: Bundle
    changed: bool
    noise: dict[str, float]


def weigh(bundle: Bundle, result: Result, config: CalibConfig) -> Weighed:
    """Keep the noise stated, or estimate the factors of the points' and the joints' variances from the residuals."""
    if bundle.hands.poses_only:
        return _weigh_poses(bundle, result, config)
    if bundle.hands.inferred:
        return _weigh_inferred(bundle, result, config)
    hand, freedom = bundle.hand_noise, bundle.degrees_of_freedom
    sane = result.converged and result.cost < _MAX_CHI2 * freedom
    told = config.noise == "auto" and sane and bool(np.any(hand))
    factors = _likely_factors(bundle, result) if told else np.ones(2)
    joint = joint_sigma_deg(bundle)
    noise = {
        JOINT: joint * float(np.sqrt(factors[1])) * _hand_noise_times(bundle),
        JOINT_STATED: joint,
        POINTS: float(np.sqrt(factors[0])),
        "anchor_sigma_mm": shape_sigma_mm(bundle),
    }
    stated = bundle.with_noise(1.0, min(1.0, factors[1]) * hand)
    used = bundle.with_noise(factors[0], factors[1] * hand)
    return Weighed(used, stated, bool(np.any(factors != 1)), noise)


def _likely_factors(bundle: Bundle, result: Result) -> Array:
    """Factors (2,) of the points' and the joints' variances: the mean of what is stated and of what is found.

    Each counts by how likely it makes the residuals. That the noise is another one means that it lies anywhere within
    the prior's width of the stated one, which the data narrow (Laplace's approximation): few residuals narrow it little
    and gain little, so that the noise stays as stated, and many find it.

    References
    ----------
    MacKay, "Bayesian interpolation", Neural Computation 4 (1992) 415–447, on Occam's factor.
    """
    variances = Variances((bundle.hand_noise,), np.ones(2), np.ones(2, dtype=bool))

    def of(x: Array) -> float:
        """Minus twice the logarithm of likelihood and prior."""
        return _deviance(variances.bundle(bundle, x), result) + float(np.sum((x / _PRIOR_LOG) ** 2))

    here = stated = _Bend.of(of, np.zeros(2))
    if _share(stated.gain, stated) < _LEAST_SHARE:  # by a parabola through the stated noise: most sound cells end here
        return np.ones(2)
    x, bounds = np.zeros(2), np.log(np.transpose([_POINT_BOUNDS, _JOINT_BOUNDS]))
    for _ in range(_STEPS):
        before, x = x, np.clip(x + here.step, *bounds)
        here = _Bend.of(of, x)
        if np.max(np.abs(x - before)) < _SETTLED:
            break
    share = _share(stated.value - here.value, here)
    return 1 + share * (np.exp(x) - 1) if share > _LEAST_SHARE else np.ones(2)


def _share(gain: float, bend: _Bend) -> float:
    """How likely another noise is than the one stated, which it gains so much on, by Laplace's approximation."""
    narrowed = float(np.linalg.slogdet(0.5 * bend.curvature * np.outer(_PRIOR_LOG, _PRIOR_LOG))[1])
    odds = np.exp(np.clip(0.5 * (gain - max(narrowed, 0.0)), -50.0, 50.0))
    return float(odds / (1 + odds))


@dataclass(frozen=True, eq=False)
class _Bend:
    """A function's value, slope (N,) and curvature (N, N) at a point, by differences."""

    value: float
    slope: Array
    curvature: Array

    @staticmethod
    def of(function: Callable[[Array], float], x: Array) -> _Bend:
        """At a point (N,)."""
        middle, e = function(x), _SCORE_STEP * np.eye(len(x))
        above, below = (np.array([function(x + sign * s) for s in e]) for sign in (1.0, -1.0))
        curvature = np.diag(above + below - 2 * middle)
        for i, j in zip(*np.triu_indices(len(x), 1), strict=True):
            curvature[i, j] = curvature[j, i] = function(x + e[i] + e[j]) - above[i] - above[j] + middle
        return _Bend(middle, (above - below) / (2 * _SCORE_STEP), _bent(curvature / _SCORE_STEP**2))

    @property
    def step(self) -> Array:
        """To the parabola's lowest point (N,), at most as far as the logarithm bends."""
        return np.clip(-np.linalg.solve(self.curvature, self.slope), -1.0, 1.0)

    @property
    def gain(self) -> float:
        """How much lower the parabola's lowest point is."""
        return 0.5 * float(self.slope @ np.linalg.solve(self.curvature, self.slope))


def _bent(curvature: Array) -> Array:
    """A curvature (N, N) that bends upwards everywhere, by a unit of deviance at least."""
    values, vectors = np.linalg.eigh(curvature)
    return np.asarray((vectors * np.maximum(values, 1.0)) @ vectors.T)


def stated_cost(stated: Bundle, result: Result) -> float:
    """Cost of a fit by the noise stated."""
    terms = (*stated.terms, *stated.further)
    return total_cost(result.unknowns, result.state, [t.linearise(result.state) for t in terms])


def joint_sigma_deg(bundle: Bundle) -> float:
    """The joints' repeatability that robot.toml states [deg], 0 where no table stands behind the readings."""
    robot = bundle.hands.robot
    return float(np.rad2deg(require_arm(robot).dh_part().uncertainty.joint_sigma_rad)) if is_arm(robot) else 0.0


def _hand_noise_times(bundle: Bundle) -> float:
    """How many times the σ that the robot's file gives its readings the problem's hands have, 1 where it gives none."""
    stated = float(np.sum(np.trace(bundle.hands.noise, axis1=1, axis2=2)))
    return float(np.sqrt(np.sum(np.trace(bundle.hand_noise, axis1=1, axis2=2)) / stated)) if stated > 0 else 1.0


def shape_sigma_mm(bundle: Bundle) -> float:
    """The largest prior σ of the target's shape."""
    return max(float(np.max(t.target.shape.sigma, initial=0.0)) for t in bundle.terms)


@dataclass(frozen=True, eq=False)
class Variances:
    """Noise as variances to be found: of the points (a factor), then of each component of the hand poses' noise.

    components: covariances (F, 6, 6) of unit variance, whose sum, each times its variance, is the hand poses' noise.
    value: (1 + K,). free: which of them the data may change.
    """

    components: tuple[Array, ...]
    value: Array
    free: Mask

    def bundle(self, bundle: Bundle, log_free: Array) -> Bundle:
        """The problem with the free variances at exp(``log_free``)."""
        value = self.at(log_free)
        return bundle.with_noise(value[0], np.einsum("k,kfij->fij", value[1:], np.array(self.components)))

    def at(self, log_free: Array) -> Array:
        """All variances (1 + K,) with the free ones at exp(``log_free``), held near their start.

        Further off nothing is gained, and the common unknowns' information is lost in the rounding of the points'.
        """
        value = self.value.copy()
        start = np.log(value[self.free])
        value[self.free] = np.exp(np.clip(log_free, start - _MAX_LOG, start + _MAX_LOG))
        return value


def estimate_noise(bundle: Bundle, result: Result, variances: Variances) -> Array:
    """Variances (1 + K,) that make the residuals most likely, the solution's linearisation held."""

    def of(log_free: Array) -> float:
        return _deviance(variances.bundle(bundle, log_free), result)

    start = np.log(variances.value[variances.free])
    simplex = np.vstack([start, start + _SIMPLEX * np.eye(len(start))])
    return variances.at(lowest(of, simplex, _LOG_TOLERANCE, _DEVIANCE_TOLERANCE, _MAX_EVALUATIONS))


def _deviance(noisy: Bundle, result: Result) -> float:
    """Of a problem's noise, at the linearised solution."""
    lins = zip(noisy.terms, linearisations(result), strict=True)
    return deviance(result, [*(t.relinearised(lin) for t, lin in lins), *other_linearisations(result)])


def _gain(other: Bundle, bundle: Bundle, result: Result) -> float:
    return _deviance(bundle, result) - _deviance(other, result)


def _weigh_inferred(bundle: Bundle, result: Result, config: CalibConfig) -> Weighed:
    """Joints inferred from poses: what of the robot's errors is a frame's own, its joints being another solution's.

    Kept at nothing, with the joints' noise as stated, unless the residuals contradict it.
    """
    hand = bundle.hand_noise
    columns = hand_twists(bundle, result) * bundle.hands.sigma
    own = columns @ np.swapaxes(columns, -1, -2)
    factors, gain = np.array([1.0, 0.0]), 0.0
    given = config.noise == "given" or (config.hand_sigma_mm is not None and config.hand_sigma_deg is not None)
    if not given and result.converged:
        found = _inferred_factors(bundle, result, own)
        within = np.minimum(found, 1.0)
        gain = _gain_of(bundle, result, own, found, within)
        found = found if gain > _LARGER_GAIN else within
        factors = found if _gain_of(bundle, result, own, found, factors) > _CONTRADICTION else factors
    larger = max(1.0, float(factors[1]))
    if larger > 1:
        bundle = bundle.knowing(robot=np.sqrt(larger) * bundle.unknowns.block("robot").sigma)
    joint = joint_sigma_deg(bundle)
    noise = {
        JOINT: joint * float(np.sqrt(factors[0])),
        JOINT_STATED: joint,
        "own_robot_error_share": float(min(factors[1], 1.0)),
        "anchor_sigma_mm": shape_sigma_mm(bundle),
    }
    noise |= {ROBOT_TIMES: float(np.sqrt(larger)), ROBOT_EVIDENCE: float(np.sqrt(gain))} if larger > 1 else {}
    used = bundle.with_noise(1.0, factors[0] * hand + factors[1] * own)
    stated = bundle.with_noise(1.0, min(1.0, factors[0]) * hand + factors[1] * own)
    return Weighed(used, stated, bool(np.any(factors != [1.0, 0.0])), noise)


def _inferred_factors(bundle: Bundle, result: Result, own: Array) -> Array:
    """Factors (2,) of the joints' variance, at most as stated, and of the robot's errors that are a frame's own.

    What is beyond the joints' noise is taken for errors of the table: these are common to the frames, too, and the
    SCP's σ must carry them. A factor above 1 means errors larger than the file states.
    """
    start = np.array([1.0, 1.0, _OWN_START])
    variances = Variances((bundle.hand_noise, own), start, np.array([False, True, True]))
    found = estimate_noise(bundle, result, variances)[1:]
    if found[0] > 1:
        alone = replace(variances, free=np.array([False, False, True]))
        found = np.array([1.0, estimate_noise(bundle, result, alone)[2]])
    return np.asarray(np.clip(found, *np.transpose([(_JOINT_BOUNDS[0], 1.0), _OWN_BOUNDS])))


def _gain_of(bundle: Bundle, result: Result, own: Array, factors: Array, other: Array) -> float:
    """Deviance that hand noise of ``factors`` (2,) of joints and own errors gains on that of ``other``."""
    noisy, plain = (bundle.with_noise(1.0, f[0] * bundle.hand_noise + f[1] * own) for f in (factors, other))
    return _gain(noisy, plain, result)


def _weigh_poses(bundle: Bundle, result: Result, config: CalibConfig) -> Weighed:
    """Hand poses alone: their noise, where it was not given, as one σ of translation and one of rotation."""
    sigma = np.sqrt(_own_variances(bundle))
    given = given_noise(config)
    if not given:
        sigma = np.sqrt(estimate_noise(bundle, result, _of_poses(bundle))[1:])
    noise = {
        "hand_sigma_mm": float(sigma[0]),
        "hand_sigma_deg": float(np.rad2deg(sigma[1])),
        "anchor_sigma_mm": shape_sigma_mm(bundle),
    }
    used = bundle.with_noise(1.0, _carried(bundle, np.diag(np.repeat(sigma, 3) ** 2)))
    return Weighed(used, used, not given, noise)


def given_noise(config: CalibConfig) -> bool:
    """Whether the noise of hand poses was stated, so that it is not estimated."""
    return config.hand_sigma_mm is not None and config.hand_sigma_deg is not None


def reweighed(bundle: Bundle, result: Result) -> Bundle:
    """The problem of hand poses with their noise found anew from a solution near by, by one step."""
    start = _of_poses(bundle)
    x = np.log(start.value[start.free])
    bend = _Bend.of(lambda here: _deviance(start.bundle(bundle, here), result), x)
    return start.bundle(bundle, x + bend.step)


def _of_poses(bundle: Bundle) -> Variances:
    """The two variances of hand poses alone, of translation and rotation."""
    parts = [np.diag([1.0] * 3 + [0.0] * 3), np.diag([0.0] * 3 + [1.0] * 3)]
    components = tuple(_carried(bundle, p) for p in parts)
    return Variances(components, np.array([1.0, *_own_variances(bundle)]), np.array([False, True, True]))


def _own_variances(bundle: Bundle) -> Array:
    """Variances (2,) of translation and rotation of the first hand's noise, where it acts."""
    back = np.linalg.inv(bundle.hands.carried[0])
    return np.diagonal(back @ bundle.hand_noise[0] @ back.T)[[0, 3]].copy()


def _carried(bundle: Bundle, covariance: Array) -> Array:
    """A covariance (6, 6) of every hand's noise where it acts, as one of the poses' twists (F, 6, 6)."""
    carried = bundle.hands.carried
    return np.asarray(carried @ covariance @ np.swapaxes(carried, -1, -2))
