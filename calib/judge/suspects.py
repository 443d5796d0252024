"""What could be wrong in a file: every number that has a prior, or that the file takes for exact, tried one at a time.

At the solution with everything free within its prior the problem is as good as linear: half the cost is
zᵀSz/2 - bᵀz + Σ z²/2V, z the departures of all common unknowns, V the priors' variances. The solution of any other
priors follows from S and b alone. A number's *pull* is its departure z over what that is expected to be,
√(V - posterior variance): normally distributed with unit variance where all priors are true, whether the data see the
number well or hardly. It is the w-test of data snooping for the pseudo-observation that a prior is. Where one number
is wrong, its own pull is the largest, and what it would be with its prior dropped is its size.

References
----------
Baarda, A testing procedure for use in geodetic networks, 1968.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from calib.bundle import Bundle, Solution
from calib.engine import departure, reduced, reduced_gradient, total_normal
from calib.sensor_errors import SensorErrors
from geometry import Sensor, State, require_arm
from geometry.robot import READING_SCALE, is_arm, with_reading_scales, without_reading_scales
from geometry.sensor import AGAINST
from jig_cad import SIZES, Jig, SizedJig

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# how far off a number that is wrong usually is: makers' tables and typing errors, encoders that lost their zero
GROSS = {"theta": np.deg2rad(0.5), "d": 2.0, "a": 2.0, "alpha": np.deg2rad(0.5), "beta": np.deg2rad(0.5)}
GROSS |= {READING_SCALE: 5e-3}  # a gear of one tooth in two hundred more
GROSS_TIMES = 10.0  # a prior's σ, for kinds of parameters that are not listed
GROSS_ANCHOR_MM = 0.5
GROSS_SIZE_MM = {"side_mm": 1.0, "height_mm": 1.0, "string_diameter_mm": 0.3}
GROSSER = 6.0  # times these: 12 mm, 3°, 6 mm of a jig, 1.8 mm of a string; what was linearised is not what is there
SEEN = 1.0  # pull that an error of gross size makes at least, if its number can be suspected from the data at all
HARDLY = 0.1  # of its gross size that the data leave of a number they hardly see
MORE_COMPONENTS = 4.0  # gain that chance gives for each component beyond the first, at the tail that matters
SAME_CHI2 = 9.0  # suspects whose gains are this near are told apart by nothing: a likelihood ratio of 90
FILE_BLOCK = {"robot": "robot", "shape": "jig", "sensor": "sensor"}  # blocks by the file that states them
FOCAL = "focal scale (fx_px, fy_px)"
# what a sensor's number is off by where it is wrong, whatever its file states
SOURCE_GROSS = {"cx_px": 5.0, "cy_px": 5.0, "fx_px": 15.0, "k1": 0.1, "plane_shift_mm": 0.5, "scale_y": 0.01}
SHIFT, SHIFTED, SHIFTED_TIMES = "plane_shift_mm", ("plane_tilt_y_rad",), 3.0
SOURCE_GROSS |= {"plane_tilt_y_rad": 3e-3, "plane_tilt_z_rad": 3e-3, "scale_z": 0.01}


@dataclass(frozen=True, eq=False)
class Suspect:
    """Components of one block that are wrong together or not at all.

    block: of the unknowns. parameter, row: as files call it, with the joint. unit: of files; per_unit: what turns the
    block's own unit into it. index (k,): in the block. gross (k,): σ of the components if they are wrong.
    along (k,): what one of the number does to the components, where they are not numbers of their own.
    """

    block: str
    parameter: str
    row: int | None
    unit: str
    per_unit: float
    index: Index
    gross: Array
    along: Array | None = None

    def of_file(self, size: Array) -> float:
        """The number in its file's unit for components of ``size`` (k,); a length where each is a number by itself."""
        if self.along is not None:
            return self.per_unit * float(self.along @ size / (self.along @ self.along))
        length = self.block != "sensor" and len(size) > 1
        return self.per_unit * float(np.linalg.norm(size) if length else size[0])


@dataclass(frozen=True, eq=False)
class SuspectTrial:
    """One suspect tried.

    where (k,): among the common unknowns. size (k,): what it would be with no prior, in the block's own unit. sigma
    (k,): how well the data know that, the prior's σ of the number included. pull: how many σ that is, with the sign of
    a single component. seen: whether a gross error of it would show. support: logarithm of how much likelier an error
    of gross size (of the size found, where that is larger) makes the data than none, its own size averaged over.
    """

    suspect: Suspect
    where: Index
    size: Array
    sigma: Array
    pull: float
    seen: bool
    support: float = 0.0

    @property
    def gross(self) -> bool:
        """Whether it is off by much more than a number that is wrong usually is."""
        return bool(np.any(np.abs(self.size) > GROSSER * self.suspect.gross))

    @property
    def hardly_seen(self) -> bool:
        """Whether an error of gross size can pass for chance: it pulls by a few σ."""
        return bool(np.any(self.sigma > HARDLY * self.suspect.gross))

    @property
    def gain(self) -> float:
        """Cost that dropping its prior saves: twice the logarithm of a likelihood ratio."""
        return self.pull**2


@dataclass(frozen=True, eq=False)
class Posterior:
    """Departures z (C,) of the common unknowns and their covariance (C, C)."""

    z: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class LinearEvidence:
    """The linear problem about a solution: S (C, C) and b (C,) in units of ``scale`` (C,).

    bundle: names all unknowns. variance (C,): of their priors, 0 where a number is taken for exact, infinite where
    nothing is known.
    """

    bundle: Bundle
    S: Array
    b: Array
    scale: Array
    variance: Array

    def solve(self, variance: Array | None = None) -> Posterior:
        """With priors of ``variance`` (C,), those stated by default."""
        z, cov = self._scaled(self.variance if variance is None else variance)
        return Posterior(z * self.scale, cov * np.outer(self.scale, self.scale))

    def trials(self) -> tuple[SuspectTrial, ...]:
        """Every suspect alone."""
        _, cov = self._scaled(self.variance)
        taken = self.S @ cov
        c, G = self.b - taken @ self.b, self.S - taken @ self.S
        return tuple(self._trial(s, c, G) for s in suspects_of(self.bundle))

    def alike(self, first: SuspectTrial, trials: tuple[SuspectTrial, ...]) -> tuple[SuspectTrial, ...]:
        """The other suspects that explain the data as well as the first, best first."""
        same = [t for t in trials if t is not first and t.seen and t.gain > first.gain - SAME_CHI2]
        return tuple(sorted(same, key=lambda t: -t.gain))

    def relaxed(self, trial: SuspectTrial) -> Array:
        """Variances (C,) with the prior of a suspect as wide as an error of its size."""
        out = self.variance.copy()
        out[trial.where] = np.maximum(trial.suspect.gross, np.abs(trial.size)) ** 2
        return out

    def gain(self, variance: Array) -> float:
        """Twice the logarithm of how much likelier priors of ``variance`` (C,) make the data than those stated.

        None are, where data that contradict one another leave a number without a prior open.
        """
        try:
            return self._log(variance) - self._log(self.variance)
        except np.linalg.LinAlgError:
            return 0.0

    def unscaled(self) -> Array:
        """S (C, C) in the blocks' own units."""
        return self.S / np.outer(self.scale, self.scale)

    def _log(self, variance: Array) -> float:
        V = variance / self.scale**2
        active = np.flatnonzero(V > 0)
        H = self.S[np.ix_(active, active)] + np.diag(1 / V[active])
        known = V[active][np.isfinite(V[active])]
        occam = float(np.linalg.slogdet(H)[1]) + float(np.sum(np.log(known)))
        return float(self.b[active] @ np.linalg.solve(H, self.b[active])) - occam

    def _scaled(self, variance: Array) -> tuple[Array, Array]:
        V = variance / self.scale**2
        active = np.flatnonzero(V > 0)
        inverse = _inverse(self.S[np.ix_(active, active)] + np.diag(1 / V[active]))
        z, cov = np.zeros(len(V)), np.zeros((len(V), len(V)))
        z[active], cov[np.ix_(active, active)] = inverse @ self.b[active], inverse
        return z, cov

    def _trial(self, suspect: Suspect, c: Array, G: Array) -> SuspectTrial:
        where = self.bundle.unknowns.indices(suspect.block)[suspect.index]
        information = G[np.ix_(where, where)]  # of its components, in units of their gross size
        seen = bool(np.linalg.eigvalsh(information)[0] > SEEN**2)
        if not seen:
            return SuspectTrial(suspect, where, np.zeros(len(where)), np.full(len(where), np.inf), 0.0, seen)
        inverse = np.linalg.inv(information)
        size = inverse @ c[where]
        pull = float(np.sqrt(max(float(c[where] @ size) - MORE_COMPONENTS * (len(where) - 1), 0.0)))
        sign = -1.0 if len(where) == 1 and size[0] < 0 else 1.0
        gross = self.scale[where]
        expected = information + np.diag(1 / np.maximum(np.abs(size), 1.0) ** 2)
        occam = np.linalg.slogdet(expected)[1] + 2 * np.sum(np.log(np.maximum(np.abs(size), 1.0)))
        support = (float(c[where] @ np.linalg.solve(expected, c[where])) - float(occam)) / 2
        sigma = np.sqrt(np.maximum(np.diag(inverse), 0.0)) * gross
        return SuspectTrial(suspect, where, size * gross, sigma, sign * pull, seen, support)


def _inverse(matrix: Array) -> Array:
    """Of a symmetric matrix; directions that data which contradict one another leave open stay at rest."""
    try:
        return np.asarray(np.linalg.inv(matrix))
    except np.linalg.LinAlgError:
        return np.asarray(np.linalg.pinv(matrix, hermitian=True))


def evidence_of(solution: Solution, sensor: Sensor | None) -> LinearEvidence:
    """All that could be wrong, linearised where everything was free within its prior."""
    bundle = suspected_bundle(solution.bundle, sensor)
    every, u = solution.every, bundle.unknowns
    state = grown(bundle, every.state)
    normal = total_normal(
        u,
        state,
        [t.linearise(state) for t in (*bundle.terms, *bundle.further)],
        every.whites,
        np.ones(u.size, dtype=bool),
    )
    schur, gains = reduced(normal)
    x, weight = departure(u, state), u.prior_weight
    data = schur - np.diag(weight)
    b = data @ x - (reduced_gradient(normal, gains) - weight * x)
    scale = np.where(np.isfinite(u.sigma) & (u.sigma > 0), u.sigma, 1.0)
    scale[u["scp"]] = [1.0] * 3 + [1e-3] * 3
    for suspect in suspects_of(bundle):
        scale[u.indices(suspect.block)[suspect.index]] = suspect.gross
    return LinearEvidence(bundle, data * np.outer(scale, scale), b * scale, scale, u.sigma**2)


def grown(bundle: Bundle, state: State) -> State:
    """The state with what the problem knows more of robot, shapes and sensor at rest, less what it does not know."""
    more = {n: np.zeros(bundle.unknowns.block(n).size) for n in ("robot", *bundle.shape_blocks, "sensor")}
    for name, value in more.items():
        old = state.vector(name)[: len(value)]
        value[: len(old)] = old
    return State({**state.values, **more})


def suspected_bundle(bundle: Bundle, sensor: Sensor | None) -> Bundle:
    """The bundle with unknowns for what its files take for exact: scales of readings, a jig's sizes, the sensor's."""
    jig = bundle.target if len(bundle.terms) == 1 else None
    out = bundle.of_target(SizedJig(jig)) if isinstance(jig, Jig) else bundle
    if sensor is not None and (out.errors is None or not out.errors.complete):
        out = out.of_sensor(SensorErrors.suspected(sensor, bundle.errors))
    if is_arm(out.hands.robot) and not out.hands.inferred:
        out = with_scales(out)
    return out.estimating(np.ones(len(out.estimated), dtype=bool), sensor=True)


def with_scales(bundle: Bundle) -> Bundle:
    """The bundle with the scale of each joint's readings among its unknowns, exact where it was not known."""
    robot = with_reading_scales(bundle.hands.robot)
    if robot is bundle.hands.robot:
        return bundle
    sigma, scales = bundle.unknowns.block("robot").sigma, np.zeros(robot.n_joints)
    return bundle.of_robot(robot).knowing(robot=np.concatenate([sigma, scales]))


def without_scales(bundle: Bundle) -> Bundle:
    """The bundle as it was before, where the scale of no reading is uncertain."""
    robot, sigma = bundle.hands.robot, bundle.unknowns.block("robot").sigma
    plain = without_reading_scales(robot)
    n = len(plain.parameters)
    if plain is robot or np.any(sigma[n:]):
        return bundle
    return bundle.of_robot(plain).knowing(robot=sigma[:n])


def suspects_of(bundle: Bundle) -> tuple[Suspect, ...]:
    """Everything in robot, target and sensor that could be wrong."""
    return (*_of_robot(bundle), *_of_readings(bundle), *_of_shape(bundle), *_of_sensor(bundle))


def _of_robot(bundle: Bundle) -> Iterator[Suspect]:
    for i, p in enumerate(bundle.hands.robot.parameters):
        if p.sigma > 0 or p.group == READING_SCALE:
            gross = max(float(GROSS.get(p.group, GROSS_TIMES * p.sigma)), 3 * p.sigma)
            unit, per = ("%", 100.0) if p.group == READING_SCALE else _file_unit(p.unit)
            yield Suspect("robot", p.name, p.joint, unit, per, np.array([i]), np.array([gross]))


def _of_readings(bundle: Bundle) -> Iterator[Suspect]:
    """Joints whose reading turns more than one axis, as where two motors drive a parallelogram: each one's zero."""
    robot = bundle.hands.robot
    if not is_arm(robot) or require_arm(robot).dh_part().coupling is None:
        return
    arm = require_arm(robot).dh_part()
    place = {p.joint: i for i, p in enumerate(robot.parameters) if p.group == "theta" and p.sigma > 0}
    for j, column in enumerate(np.transpose(arm.sign[:, None] * np.asarray(arm.coupling))):
        turned = [int(i) + 1 for i in np.flatnonzero(column)]
        if len(turned) > 1 and all(k in place for k in turned):
            where = np.array([place[k] for k in turned])
            along = column[np.array(turned) - 1]
            unit, per = _file_unit("rad")
            name = f"readings of joint {j + 1} ({', '.join(f'theta{k}' for k in turned)})"
            yield Suspect("robot", name, j + 1, unit, per, where, np.full(len(where), GROSS["theta"]), along)


def _of_shape(bundle: Bundle) -> Iterator[Suspect]:
    jig = bundle.target if len(bundle.terms) == 1 else None
    if not isinstance(jig, SizedJig):
        return
    for k in jig.jig.used_anchors:
        where = np.array([2 * k, 2 * k + 1])
        yield Suspect("shape", f"anchor {jig.jig.anchors[k]}", None, "mm", 1.0, where, np.full(2, GROSS_ANCHOR_MM))
    labels = jig.shape.labels
    for name in SIZES:
        where = np.array([labels.index(name)])
        yield Suspect("shape", name, None, "mm", 1.0, where, np.array([GROSS_SIZE_MM[name]]))


def _of_sensor(bundle: Bundle) -> Iterator[Suspect]:
    errors = bundle.errors
    if errors is None:
        return
    names = errors.deviation.names
    for k, label in enumerate(errors.labels):
        if label.endswith(AGAINST):
            continue
        main = names.index(label.split(", ")[0])
        unit, per = _file_unit(_unit_of(names[main]))
        usual = SOURCE_GROSS.get(names[main], 1.0)
        moved = abs(errors.basis[main, k])
        parameter = FOCAL if label == "fx_px, fy_px" else label.replace("_rad", "_deg")
        gross = max(usual / moved if errors.sigma[k] else 1.0, 3 * errors.sigma[k])
        where, sizes = [k], [gross]
        if names[main] in SHIFTED and SHIFT in errors.labels:  # a plane turns about wherever it is held
            where.append(errors.labels.index(SHIFT))
            sizes.append(max(SHIFTED_TIMES, gross))
        yield Suspect("sensor", parameter, None, unit, per * errors.basis[main, k], np.array(where), np.array(sizes))


def _unit_of(name: str) -> str:
    return next((unit for unit in ("px", "rad", "mm") if name.endswith(f"_{unit}")), "")


def _file_unit(unit: str) -> tuple[str, float]:
    """The unit of files, and how many of it are one of ours."""
    return ("deg", float(np.rad2deg(1.0))) if unit == "rad" else (unit, 1.0)
