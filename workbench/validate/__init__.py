"""Extraction against truth: detection, false alarms, labels, bias, scatter, honest σ, and the statistical bound."""

from workbench.validate.page import WORDS, write_pages
from workbench.validate.run import validate_dataset, validate_drawn
from workbench.validate.summary import Thresholds, failures, figures, in_words, read_thresholds

__all__ = [
    "WORDS",
    "Thresholds",
    "failures",
    "figures",
    "in_words",
    "read_thresholds",
    "validate_dataset",
    "validate_drawn",
    "write_pages",
]
