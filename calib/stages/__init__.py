"""The stages of a calibration: prepare (labels, first bundle), size, judged answer or the paper's, conclusion."""

from calib.stages.by_paper import paper_answer
from calib.stages.conclude import concluded
from calib.stages.evidence import sound_evidence, sound_readings
from calib.stages.judged import judged_answer
from calib.stages.preparation import prepare, with_model
from calib.stages.setup import Prepared, Setup, by_target, one_or_more
from calib.stages.size import of_true_size

__all__ = [
    "Prepared",
    "Setup",
    "by_target",
    "concluded",
    "judged_answer",
    "of_true_size",
    "one_or_more",
    "paper_answer",
    "prepare",
    "sound_evidence",
    "sound_readings",
    "with_model",
]
