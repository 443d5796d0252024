"""The judgement on data and answer: verdicts, culprits, which model predicts, what can not be told apart."""

from calib.judge.contradiction import frames_contradict
from calib.judge.culprits import culprit
from calib.judge.culprits_jig import wrong_jig
from calib.judge.facts import bundle_estimate, bundle_facts
from calib.judge.model_choice import choose_model, left_out_rms
from calib.judge.verdict import Facts, frames_motion, judge, judge_motion, misfit_limit

__all__ = [
    "Facts",
    "bundle_estimate",
    "bundle_facts",
    "choose_model",
    "culprit",
    "frames_contradict",
    "frames_motion",
    "judge",
    "judge_motion",
    "left_out_rms",
    "misfit_limit",
    "wrong_jig",
]
