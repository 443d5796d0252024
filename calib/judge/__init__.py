"""The judgement on data and answer: verdicts, culprits, which model predicts, what can not be told apart."""

from calib.judge.alike import equal_weights
from calib.judge.beside import FalseRow, evidence_contradicts, worst_row
from calib.judge.causes import cause_of, with_own_poses
from calib.judge.contradiction import frames_contradict
from calib.judge.culprits import culprit, strangers
from calib.judge.culprits_jig import wrong_jig
from calib.judge.facts import bundle_estimate, bundle_facts
from calib.judge.finding import UNCERTAINTY, find
from calib.judge.jackknife import FEWEST_LEFT_OUT, at_least, jackknife_covariance, weak_by_jackknife
from calib.judge.model_choice import UNCHECKED, table_advice
from calib.judge.parts import left_out
from calib.judge.verdict import RIVAL_CHI2, Facts, Motion, frames_motion, judge, judge_motion, misfit_limit

__all__ = [
    "FEWEST_LEFT_OUT",
    "RIVAL_CHI2",
    "UNCERTAINTY",
    "UNCHECKED",
    "Facts",
    "FalseRow",
    "Motion",
    "at_least",
    "bundle_estimate",
    "bundle_facts",
    "cause_of",
    "culprit",
    "equal_weights",
    "evidence_contradicts",
    "find",
    "frames_contradict",
    "frames_motion",
    "jackknife_covariance",
    "judge",
    "judge_motion",
    "left_out",
    "misfit_limit",
    "strangers",
    "table_advice",
    "weak_by_jackknife",
    "with_own_poses",
    "worst_row",
    "wrong_jig",
]
