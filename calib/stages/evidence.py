"""Rows of the evidence that all the rest contradicts: left out and named before they pull the answer."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from calib import engine
from calib.bundle import Bundle, DistanceBetween, Evidence, Hands, Solution, other_linearisations
from calib.judge import UNCERTAINTY, FalseRow, evidence_contradicts, worst_row
from calib.result import Verdict
from calib.stages.preparation import prepare
from calib.stages.setup import Prepared, Setup, Solved
from calib.stages.solve import solve, try_suspects
from geometry import State, Unknowns

_MOST_FALSE = 0.25  # share of the rows of one file that may be false; beyond it the file is, and nothing is left out


def sound_readings(setup: Setup) -> tuple[Setup, tuple[str, ...]]:
    """The setup less what the tracker's and the sockets' rows contradict among themselves, and sentences on it.

    By the evidence alone, the robot's errors within their priors: a row that is metres off would have the frames
    accused of it. Evidence that would lose too many rows is not used at all.
    """
    less, words, given = setup, list[str](), setup.evidence
    while (false := _worst_alone(less)) is not None:
        rest = _without(less.evidence, false)
        if rest is None or _too_many(rest[false.evidence], given[false.evidence]):
            given, rest = _but(given, false.evidence), _but(less.evidence, false.evidence)
            words.append(_refused(false))
        else:
            words.append(_said(false, "the other rows"))
        less = replace(less, evidence=rest)
    return less, tuple(words)


def sound_evidence(prepared: Prepared) -> tuple[Prepared, tuple[str, ...]]:
    """The same less the rows that frames and evidence together contradict, and sentences on them; all where many do."""
    given = prepared.setup.evidence
    less, words = prepared, list[str]()
    while less.solved.solution is not None and (false := _worst(less.setup.evidence, less.solved.solution)) is not None:
        rest = _without(less.setup.evidence, false)
        if rest is None or _too_many(rest[false.evidence], given[false.evidence]):
            return prepared, ()
        less = prepare(replace(less.setup, evidence=rest), less.given)
        words.append(_said(false, "the frames and the other rows"))
    return less, tuple(words)


def told_by_evidence_alone(prepared: Prepared, judged: Solved) -> Verdict | None:
    """The verdict on a row of the evidence, where one false row explains what [uncertainty] as a whole was accused of.

    A wrong distance is one number; robots whose every number is off by many times what is stated are rarer. The row is
    named where the frames fit the robot as stated without it.
    """
    first = prepared.solved.solution
    accused = judged.estimate is not None and any(c.parameter == UNCERTAINTY for c in judged.estimate.culprit[:1])
    if first is None or not accused:
        return None
    verdict, false = evidence_contradicts(first), _worst(prepared.setup.evidence, first)
    if verdict is None or false is None:
        return None
    rest = _without(prepared.setup.evidence, false) or _but(prepared.setup.evidence, false.evidence)
    less = try_suspects(
        replace(prepared.setup, evidence=rest),
        prepared.labelled,
        solve(replace(prepared.setup, evidence=rest), prepared.labelled, first.T_hand_sensor),
    )
    return verdict if less.verdict.code in ("ok", "weak") else None


def _said(false: FalseRow, rest: str) -> str:
    return (
        f"{false.called} ([evidence] of cell.toml) lies {false.off_mm:.2f} mm from where {rest} have it, "
        f"{false.times_sigma:.0f} times its σ: it was left out; measure it again"
    )


def _refused(false: FalseRow) -> str:
    return (
        f"{false.called} ([evidence] of cell.toml) lies {false.off_mm:.2f} mm from where the other rows have it, and "
        "so many others do likewise that none of them was used: check the joint columns, the units, and which reading "
        "each row belongs to"
    )


def _too_many(less: Evidence, given: Evidence) -> bool:
    """Whether more rows are gone than can be false."""
    return given.rows - less.rows > _MOST_FALSE * given.rows


def _but(evidence: tuple[Evidence, ...], number: int) -> tuple[Evidence, ...]:
    return tuple(e for k, e in enumerate(evidence) if k != number)


def _worst(evidence: tuple[Evidence, ...], solution: Solution) -> FalseRow | None:
    """The worst row by frames and evidence together."""
    speaking = [k for k, e in enumerate(evidence) if e.term(solution.bundle) is not None]
    mine = [evidence[k] for k in speaking]
    false = worst_row(mine, other_linearisations(solution.every), solution.every) if mine else None
    return None if false is None else replace(false, evidence=speaking[false.evidence])


def _without(evidence: tuple[Evidence, ...], false: FalseRow) -> tuple[Evidence, ...] | None:
    """The evidence less a row, None where its file would tell nothing any more."""
    less = evidence[false.evidence].without(false.group)
    return None if less is None else tuple(less if k == false.evidence else e for k, e in enumerate(evidence))


def _worst_alone(setup: Setup) -> FalseRow | None:
    """The worst row by the readings' own agreement, None where none is false or they tell too little."""
    readings = [k for k, e in enumerate(setup.evidence) if not isinstance(e, DistanceBetween)]
    if not readings or setup.robot is None:
        return None
    mine = [setup.evidence[k] for k in readings]
    nothing = Hands(setup.robot, np.zeros((0, setup.robot.n_joints)))
    bundle = Bundle.of([], [], setup.target, nothing).estimating(np.ones(len(nothing.sigma), dtype=bool))
    bundle = bundle.with_evidence(mine)
    rest = State({"robot": bundle.unknowns.block("robot").at_rest()})
    begun = {name: value for e in mine for name, value in e.start(bundle, rest).items()}
    unknowns = Unknowns(tuple(b for b in bundle.unknowns.blocks if b.name not in ("scp", "sensor")))
    try:
        result = engine.solve(bundle.further, unknowns, State({**rest.values, **begun}))
    except np.linalg.LinAlgError:  # they leave their own unknowns open: the frames will tell
        return None
    false = worst_row(mine, result.linearised, result)
    return None if false is None else replace(false, evidence=readings[false.evidence])
