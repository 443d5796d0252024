"""Which number of the files contradicts the data, what can not be told from it, and which σ then hold.

A suspect is named where dropping its prior, and solving anew with outliers sought anew, saves more cost than chance
does. It then keeps a prior of the size it was found to have. What else explains the data nearly as well stays possible:
covariances are those of the mixture over all that could be wrong, each by its likelihood, nothing wrong among them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from calib import engine
from calib.bundle import (
    JOINT,
    JOINT_STATED,
    POINTS,
    Bundle,
    Explained,
    Solution,
    answered,
    estimated_parameters,
    estimates_sensor,
    explain,
)
from calib.config import CalibConfig
from calib.judge.afar import FOLLOWED, Coarse, coarse_solutions, followed, lost_too_many
from calib.judge.suspects import (
    MORE_COMPONENTS,
    LinearEvidence,
    Suspect,
    SuspectTrial,
    evidence_of,
    grown,
    suspected_bundle,
    without_scales,
)
from calib.judge.verdict import REST_SLACK, misfit_limit
from geometry import Pose, Sensor

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

MORE = 5  # and so many more where none of these explains all
TRIED = 3  # suspects that are solved for anew, those of the largest pulls
LOOK = 3.2  # a pull from which that is worth while: one sound cell in ten or so has it
LOOK_CHI2 = 1.3  # and the χ² per degree of freedom from which it is, whatever the pulls
BEYOND_CHI2 = 300.0  # beyond this no small error of one number is the cause, and nothing that was linearised holds
TIMES = (1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0)  # by which [uncertainty] of a robot is tried
AT_FIRST = 10.0  # of these, where the noise of the readings has taken up what the table's errors are
SCATTER = 1.2  # times the stated noise of readings or points from which it may have
MOST_CHI2 = 30.0  # beyond this it is not the uncertainty of a table or of readings
EVIDENCE = 4.0  # by which that must be better than one number alone: a likelihood ratio of 7
WRONG = 0.02  # odds that a number of the files is wrong, before anything is seen: one of some 50 in every other cell
LIKELY = -2 * float(np.log(WRONG))  # cost saved by which something wrong is likelier than nothing
COVERED = 3.0  # σ within which the answer lies by whatever the data can not tell from the culprit, likely or not
DOUBTED = 0.005  # a number hardly seen that is wrong with this probability is covered so, too: in some cells it is
POSSIBLE = 1e-4  # a hypothesis less probable than this widens nothing
UNCERTAINTY, SCATTERED = "[uncertainty]", "[uncertainty] joint_sigma_deg"
LEFT_OUT = 25.0  # cost of a point that is left out: the gate that it failed


@dataclass(frozen=True, eq=False)
class Finding:
    """What a solution's priors and the data say of each other.

    solution: with the culprit's prior widened, where there is one. evidence: about it, its variances those stated.
    trials: of every suspect. culprit, alike: what is wrong, and what the data can not tell from it. rest: the largest
    pull that is left once it is allowed for. allowed (C,): variances with that. prior_cost, prior_expected: squared
    departures from the stated priors, and what they are expected to be. whole: [uncertainty] of the robot, where it is
    no culprit and wider priors make the data likelier.
    """

    solution: Solution
    evidence: LinearEvidence
    trials: tuple[SuspectTrial, ...]
    culprit: SuspectTrial | None
    alike: tuple[SuspectTrial, ...]
    rest: float
    allowed: Array
    prior_cost: float
    prior_expected: float
    whole: SuspectTrial | None = None

    def hypotheses(self) -> list[tuple[SuspectTrial | None, float]]:
        """What could be wrong with its probability, most probable first; None stands for nothing."""
        if self.culprit is not None and self.culprit.suspect.parameter == SCATTERED:
            return [(self.culprit, 1.0)]
        odds: list[tuple[SuspectTrial | None, float]] = [(None, 0.0)]
        odds += [(t, t.support + np.log(WRONG)) for t in self.trials if t.seen]
        if self.whole is not None:
            odds.append((self.whole, self.whole.support + np.log(WRONG)))
        if self.culprit is not None and self.culprit.suspect.parameter == UNCERTAINTY:
            odds = [(t, t.support) for t in _by_times(self.evidence)]
        top = max(logarithm for _, logarithm in odds)
        weights = [(t, float(np.exp(logarithm - top))) for t, logarithm in odds]
        total = sum(w for _, w in weights)
        return sorted(((t, w / total) for t, w in weights if w / total > POSSIBLE), key=lambda h: -h[1])


def find(
    bundle: Bundle,
    candidates: Sequence[Pose],
    solution: Solution,
    sensor: Sensor | None,
    config: CalibConfig,
    begin: Pose | None = None,
) -> Finding:
    """Try what could be wrong and keep what explains the data, or nothing; ``begin``: the SCP before all solving."""
    case = _Case(bundle, candidates, solution, sensor, config, begin or solution.T_hand_sensor)
    if lost_too_many(solution, config):
        return _from_afar(case) or _from_nearby(case)
    found = _from_nearby(case)
    if not _doubtful(found, config) or solution.bundle.hands.inferred:
        return found
    return _one_from_afar(case)[0] or found


@dataclass(frozen=True, eq=False)
class _Case:
    """A solution that is judged: the problem as stated, the frames' poses, and the SCP before all solving."""

    bundle: Bundle
    candidates: Sequence[Pose]
    solution: Solution
    sensor: Sensor | None
    config: CalibConfig
    begin: Pose

    @cached_property
    def every(self) -> Bundle:
        """The problem with everything that could be wrong among its unknowns."""
        return suspected_bundle(self.bundle, self.sensor)


def _from_nearby(case: _Case) -> Finding:
    """What could be wrong where the solution tells the likeliest suspects."""
    candidates, solution, sensor, config, every = case.candidates, case.solution, case.sensor, case.config, case.every
    first = evidence_of(solution, sensor)
    trials = first.trials()
    gain, culprit, found = config.pull_limit**2, None, None
    for k, trial in enumerate(_tried(first, trials, solution.explained) if _worth_while(solution, trials) else ()):
        if k >= TRIED and found is not None and _fits(found[1], config):
            break
        relaxed = _relaxed(every, first, trial, config)
        explained = _explained(relaxed, candidates, solution, config)
        if explained is None:
            continue
        more = MORE_COMPONENTS * (len(trial.where) - 1)
        saved = trial.gain if trial.suspect.parameter == UNCERTAINTY else _gain(solution, explained) - more
        if saved > gain:
            gain, culprit, found = saved, trial, (relaxed, explained)
    whole = _uncertainty(first)
    whole = whole if whole is not None and whole.suspect.per_unit > 1 else None
    plain = replace(_finding(None, solution, first, sensor), whole=whole)
    one = plain
    if culprit is not None and found is not None:
        accused = _finding(culprit, answered(*found, solution.rival, config), first, sensor)
        one = accused if accused.culprit is not None and abs(accused.culprit.pull) > config.pull_limit else plain
    likely = whole is not None and whole.gain > LIKELY
    if not likely and not _doubtful(one, config) and not _scattered(solution):
        return one
    return _uncertain(every, candidates, one, config, sensor) or one


def _from_afar(case: _Case) -> Finding | None:
    """The suspect that brings the points back which were left out, else [uncertainty]; None where neither does."""
    one, last = _one_from_afar(case)
    if one is not None or last is None:
        return one
    whole = _finding(None, last.solution, last.evidence, case.sensor)
    wider = _uncertain(case.every, case.candidates, whole, case.config, case.sensor, BEYOND_CHI2)
    return wider if wider is not None and wider.solution.result.converged else None


def _one_from_afar(case: _Case) -> tuple[Finding | None, Coarse | None]:
    """The suspect that explains the data, followed down from coarse noise, if any; and the last solution tried."""
    solution, config, last, best, first = case.solution, case.config, None, None, None
    for at in coarse_solutions(case.bundle, case.candidates, solution, case.sensor, case.begin):
        last = at
        relaxed = (_relaxed(case.every, at.evidence, t, config) for t in at.trials[:FOLLOWED])
        for tried in followed(at, relaxed, case.candidates, case.begin, config):
            if best is None or _misfit(tried.explained) < _misfit(best.explained):
                best, first = tried, at.evidence
        if best is not None and _fits(best.explained, config):
            break
    if best is None or first is None:
        return None, last
    answer = answered(best.relaxed, best.explained, solution.rival, config)
    one = _finding(best.trial, answer, first, case.sensor)
    named = one.culprit is not None and abs(one.culprit.pull) > config.pull_limit
    return (one if named and one.solution.result.converged and not _doubtful(one, config) else None), last


def _misfit(explained: Explained) -> float:
    """What is left unexplained, points that were left out included."""
    return explained.cost + LEFT_OUT * float(explained.robust.left_out[explained.kept.present].sum())


def _doubtful(finding: Finding, config: CalibConfig) -> bool:
    """Whether no σ can be given."""
    solution = finding.solution
    limit = misfit_limit(solution.dof, config.misfit_chi2)
    explains = solution.explained <= limit and finding.rest <= config.pull_limit + REST_SLACK
    return not explains


def _scattered(solution: Solution) -> bool:
    """Whether readings or points were found to scatter more than stated, which errors of the table may be."""
    noise = solution.noise
    readings = noise.get(JOINT, 0.0) > SCATTER * noise.get(JOINT_STATED, np.inf)
    return readings or noise.get(POINTS, 1.0) > SCATTER


@dataclass(frozen=True, eq=False)
class WiderRobot:
    """The frames explained with all of the robot's uncertainty wider by the factor of ``trial``."""

    trial: SuspectTrial
    explained: Explained
    finding: Finding


def _uncertain(
    every: Bundle,
    candidates: Sequence[Pose],
    one: Finding,
    config: CalibConfig,
    sensor: Sensor | None,
    most_chi2: float = MOST_CHI2,
) -> Finding | None:
    """[uncertainty] as a whole, where that explains the data and does it better than one number or none."""
    before = one.solution
    if not before.every.converged or before.explained > most_chi2:
        return None
    stated = replace(one.evidence, variance=every.unknowns.sigma**2)
    start = _wider(every, candidates, before, stated, AT_FIRST, config, sensor)
    if start is None:  # the factor is sought by the noise that is left once the table's errors may be large
        return None
    w = _wider(every, candidates, before, start.finding.evidence, None, config, sensor)
    if w is None or not _fits(w.explained, config) or w.finding.rest > config.pull_limit:
        return None
    saved = engine.evidence(before.every) - engine.evidence(w.explained.every)
    same = np.array_equal(w.explained.robust.left_out, before.outlier | before.frame_outlier[:, None])
    if same and saved < LIKELY:
        return None
    accused = w.trial.suspect
    if accused.per_unit == 1.0:  # the table's errors are as stated, the readings' noise is not
        noise = w.explained.weighed.noise
        accused = replace(accused, parameter=SCATTERED, per_unit=noise[JOINT] / noise[JOINT_STATED])
    return replace(w.finding, culprit=replace(w.trial, suspect=accused, pull=float(np.sqrt(max(saved, LIKELY)))))


def _wider(
    every: Bundle,
    candidates: Sequence[Pose],
    before: Solution,
    stated: LinearEvidence,
    times: float | None,
    config: CalibConfig,
    sensor: Sensor | None,
) -> WiderRobot | None:
    """The frames with the robot's uncertainty ``times`` as large, by default as the evidence has it likeliest."""
    trial = _uncertainty(stated, times)
    if trial is None:
        return None
    relaxed = _relaxed(every, stated, trial, config)
    explained = _explained(relaxed, candidates, before, config)
    if explained is None:
        return None
    solution = answered(relaxed, explained, before.rival, config)
    return WiderRobot(trial, explained, _finding(trial, solution, stated, sensor))


def _fits(explained: Explained, config: CalibConfig) -> bool:
    """Whether nothing is left to be explained: no outliers, and χ² as noise has it."""
    whole = not np.any(explained.robust.left_out[explained.kept.present])
    return whole and explained.cost <= LOOK_CHI2 * max(explained.kept.degrees_of_freedom, 1)


def _worth_while(solution: Solution, trials: tuple[SuspectTrial, ...]) -> bool:
    if not solution.every.converged or solution.explained > BEYOND_CHI2:
        return False
    removed = np.any(solution.outlier) or np.any(solution.frame_outlier)
    largest = max((abs(t.pull) for t in trials), default=0.0)
    return bool(removed) or largest > LOOK or solution.explained > LOOK_CHI2


def _tried(evidence: LinearEvidence, trials: tuple[SuspectTrial, ...], explained: float) -> list[SuspectTrial]:
    """The suspects of the largest pulls, and the robot's stated uncertainty as a whole."""
    single = sorted((t for t in trials if t.seen), key=lambda t: -t.gain)[: TRIED + MORE]
    whole = _uncertainty(evidence) if explained <= MOST_CHI2 else None
    if whole is None:
        return single
    alone = max((evidence.gain(evidence.relaxed(t)) for t in single), default=0.0)
    return [whole, *single] if whole.gain > alone + EVIDENCE else single


def _uncertainty(evidence: LinearEvidence, times: float | None = None) -> SuspectTrial | None:
    """All priors of the robot wider by a factor, as one suspect whose size is the factor; by default the likeliest."""
    wider = _by_times(evidence, TIMES if times is None else (times,))
    return max(wider, key=lambda t: t.support) if wider else None


def _by_times(evidence: LinearEvidence, factors: tuple[float, ...] = TIMES) -> list[SuspectTrial]:
    """All priors of the robot wider by each factor; none of joints that follow from hand poses."""
    robot = evidence.bundle.unknowns.block("robot")
    if bool(evidence.bundle.hands.inferred) or not np.any(robot.sigma > 0):
        return []
    where = evidence.bundle.unknowns.indices("robot")
    wider = []
    for times in factors:
        variance = evidence.variance.copy()
        variance[where] *= times**2
        gain, sigma = evidence.gain(variance), np.sqrt(variance[where])
        suspect = Suspect("robot", UNCERTAINTY, None, "times", times, np.arange(len(where)), sigma)
        pull = float(np.sqrt(max(gain, 0.0)))
        wider.append(SuspectTrial(suspect, where, np.zeros(len(where)), sigma, pull, seen=True, support=gain / 2))
    return wider


def _explained(
    relaxed: Bundle, candidates: Sequence[Pose], solution: Solution, config: CalibConfig
) -> Explained | None:
    """The frames explained with a suspect's prior as wide as its size; None where that settles nowhere."""
    start = grown(relaxed, solution.every.state) if solution.every.converged else None
    try:
        found = explain(relaxed, candidates, solution.T_hand_sensor, config, start)
    except np.linalg.LinAlgError:
        return None
    return found if found.every.converged else None


def _relaxed(bundle: Bundle, evidence: LinearEvidence, trial: SuspectTrial, config: CalibConfig) -> Bundle:
    """The problem of all suspects, one of them with a prior of its size."""
    suspect, u = trial.suspect, bundle.unknowns
    sigma = {b: u.block(b).sigma.copy() for b in ("robot", *bundle.shape_blocks, "sensor")}
    wide = np.sqrt(evidence.relaxed(trial)[trial.where])
    if not _estimated(suspect, bundle, config) and suspect.parameter != UNCERTAINTY:
        wide = np.maximum(np.abs(trial.size), sigma[suspect.block][suspect.index])
    sigma[suspect.block][suspect.index] = wide
    wider = without_scales(bundle.knowing(**sigma))
    if suspect.parameter != UNCERTAINTY or config.noise == "given":
        return wider
    return wider.with_noise(1.0, AT_FIRST**2 * wider.hand_noise)  # of the readings: at most; the residuals tell


def _estimated(suspect: Suspect, bundle: Bundle, config: CalibConfig) -> bool:
    """Whether the model estimates the suspect: else its σ is all that is carried."""
    if suspect.block == "robot":
        return bool(np.all(estimated_parameters(bundle.hands, config.model)[suspect.index]))
    return suspect.block in bundle.shape_blocks or estimates_sensor(config.model)


def _gain(before: Solution, after: Explained) -> float:
    """Cost saved, points brought back included, in units of the noise that is left.

    Of joints that follow from hand poses the marginal likelihood, where the same points are left out: of errors of the
    table a share is each frame's own, which is found anew, so that costs do not compare.
    """
    gone_before = before.outlier | before.frame_outlier[:, None]
    if before.bundle.hands.inferred and np.array_equal(gone_before, after.robust.left_out):
        return engine.evidence(before.every) - engine.evidence(after.every)
    left = after.cost / max(after.kept.degrees_of_freedom, 1)
    gone = LEFT_OUT * (float(_gone(before.outlier, before) - after.robust.left_out[before.bundle.present].sum()))
    return (before.explained * before.dof - after.cost + gone) / max(1.0, left)


def _gone(outlier: Mask, solution: Solution) -> float:
    return float((outlier | solution.frame_outlier[:, None])[solution.bundle.present].sum())


def _finding(culprit: SuspectTrial | None, solution: Solution, first: LinearEvidence, sensor: Sensor | None) -> Finding:
    about = evidence_of(solution, sensor)
    allowed = about.variance
    if culprit is None:
        trials = about.trials()
        return Finding(solution, about, trials, None, (), _largest(trials, None), allowed, *_priors(about))
    stated = replace(about, variance=first.variance)
    trials = stated.trials()
    rest = _largest(about.trials(), culprit)
    if culprit.suspect.parameter == UNCERTAINTY:
        return Finding(solution, stated, trials, culprit, (), rest, allowed, *_priors(stated))
    same = {t.suspect.parameter: t for t in trials}
    named = same.get(culprit.suspect.parameter, culprit)
    named = named if named.seen else culprit
    alike = stated.alike(named, trials)
    return Finding(solution, stated, trials, named, alike, rest, allowed, *_priors(stated))


def _largest(trials: tuple[SuspectTrial, ...], but: SuspectTrial | None) -> float:
    name = None if but is None else but.suspect.parameter
    return max((abs(t.pull) for t in trials if t.seen and t.suspect.parameter != name), default=0.0)


def _priors(evidence: LinearEvidence) -> tuple[float, float]:
    """Squared departures from the priors in σ, and their expectation."""
    found = evidence.solve()
    known = np.isfinite(evidence.variance) & (evidence.variance > 0)
    V = evidence.variance[known]
    return float(np.sum(found.z[known] ** 2 / V)), float(np.sum(1 - np.diag(found.covariance)[known] / V))


def widened(finding: Finding, estimated: Mask, total: Array, doubted: bool = False) -> Array:
    """Covariance (C, C) of all common unknowns with what could be wrong beside what was allowed for.

    estimated (C,): what the answer estimates; the rest it leaves at rest. total (C, C): with the priors allowed.
    doubted: whether numbers that the data hardly see are covered, too, where they are wrong with a small probability.
    """
    hypotheses = finding.hypotheses()
    ev, allowed = finding.evidence, finding.allowed
    out, considered = total.copy(), np.zeros(len(allowed))
    free = np.where(estimated, allowed, 0.0)
    base = ev.solve(free)
    for trial, posterior in hypotheses:
        if trial is None and finding.culprit is None:
            continue
        doubt = doubted and posterior > DOUBTED and trial is not None and trial.hardly_seen
        cover = trial in finding.alike or doubt
        probability = max(posterior, 1 / COVERED**2) if cover else posterior
        if trial is not None and trial.suspect.parameter == SCATTERED:
            continue
        whole = trial is not None and trial.suspect.parameter == UNCERTAINTY
        variance = ev.variance.copy()
        if trial is not None and whole:
            variance[trial.where] = trial.sigma**2
        elif trial is not None:
            variance = ev.relaxed(trial)
        if trial is not None and not np.all(estimated[trial.where]):
            size = trial.sigma**2 if whole else np.sum(trial.size**2) / len(trial.size)
            considered[trial.where] += probability * np.maximum(size - allowed[trial.where], 0.0)
            continue
        other = ev.solve(np.where(estimated, variance, 0.0))
        shift = other.z - base.z
        out += probability * _positive(other.covariance - base.covariance + np.outer(shift, shift), base.covariance)
    if np.any(considered):
        bias = -base.covariance @ (ev.unscaled()[:, considered > 0])
        bias[considered > 0] += np.eye(int(np.sum(considered > 0)))
        out += bias @ np.diag(considered[considered > 0]) @ bias.T
    return out


def _positive(matrix: Array, base: Array) -> Array:
    """The part of a symmetric matrix that widens; ``base`` gives the scale of its components."""
    scale = np.sqrt(np.where(np.diag(base) > 0, np.diag(base), 1.0))
    values, vectors = np.linalg.eigh(matrix / np.outer(scale, scale))
    return np.asarray((vectors * np.maximum(values, 0.0)) @ vectors.T * np.outer(scale, scale))
