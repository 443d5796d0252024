"""The paper's own answer, on frames that the bundle has prepared."""

from __future__ import annotations

from calib.judge import frames_motion, judge, judge_motion
from calib.paper import Starts, checked, paper_estimate, paper_frames
from calib.result import CalibrationResult
from calib.stages.judged import answered
from calib.stages.setup import Prepared, Solved
from geometry import InputError
from jig_cad import Jig


def paper_answer(prepared: Prepared) -> CalibrationResult:
    """The paper's answer to the prepared frames; the bundle's tells mirrors and outliers and judges it."""
    setup, labelled, solved = prepared.setup, prepared.labelled, prepared.solved
    if not isinstance(setup.target, Jig):
        raise InputError("the paper's method measures a pillar of strings: use --method bundle for other targets")
    trusted = solved.estimate if solved.verdict.trustworthy else None
    outlying = {**trusted.reasons, **trusted.outliers} if trusted is not None else {}
    used = tuple(f for f in labelled if f.role == "calibrate" and f.usable)
    frames = paper_frames(used, setup.target, outlying)
    moved = frames_motion(frames.frames)
    early = judge_motion(moved, setup.config)
    if early is not None:
        return answered(setup, labelled, Solved(early))
    if setup.design is None:
        raise InputError("the paper's method begins at the sensor's place by its drawing: give [scp_initial]")
    starts = Starts(setup.design, setup.design if trusted is None else trusted.T_hand_sensor)
    estimate, facts = paper_estimate(frames, setup.target, setup.robot, starts, setup.config)
    verdict = checked(judge(facts, moved, setup.config), estimate, solved.verdict, solved.estimate)
    return answered(setup, labelled, Solved(verdict, estimate))
