"""The method of Jeong & Kang as published, its misprints mended, with a true covariance."""

from calib.paper.check import checked
from calib.paper.estimate import Starts, paper_estimate, paper_frames
from calib.paper.scp import PaperProblem, differences, scaled_condition, solve_paper

__all__ = [
    "PaperProblem",
    "Starts",
    "checked",
    "differences",
    "paper_estimate",
    "paper_frames",
    "scaled_condition",
    "solve_paper",
]
