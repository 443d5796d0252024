"""Measured points against their truth: one matcher and its figures, for validation, window, tuning and campaigns."""

from workbench.compare.matching import (
    GATE_MM,
    GATE_PX,
    VISIBLE,
    Comparison,
    KnownString,
    Match,
    NamedPoints,
    TrueString,
    match,
    named_points,
    true_strings,
)
from workbench.compare.statistics import Statistics, errors_mm, summarise

__all__ = [
    "GATE_MM",
    "GATE_PX",
    "VISIBLE",
    "Comparison",
    "KnownString",
    "Match",
    "NamedPoints",
    "Statistics",
    "TrueString",
    "errors_mm",
    "match",
    "named_points",
    "summarise",
    "true_strings",
]
