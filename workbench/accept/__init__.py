"""Acceptance tests by the metrologist's usual standards: from profiles, images or a table to a record."""

from workbench.accept.ball import BallStandard, accept_ball
from workbench.accept.figures import RULES, Bounds, Check, Conformity, Figure, Limit, Rule
from workbench.accept.flatness import accept_flatness
from workbench.accept.gauge import accept_gauge
from workbench.accept.gauge_study import GaugeStudy, study_gauge
from workbench.accept.gauge_table import GaugeColumns, GaugeTable, read_gauge_table
from workbench.accept.page import shown, write_record_page
from workbench.accept.record import RULE_WORDS, Record, make_record, record_object
from workbench.accept.recorded import PlacedProfile, ProfileRecording, Recorded, read_recorded
from workbench.accept.repeat import Series, accept_repeat, read_series, series_of
from workbench.accept.spacing import accept_spacing

__all__ = [
    "RULES",
    "RULE_WORDS",
    "BallStandard",
    "Bounds",
    "Check",
    "Conformity",
    "Figure",
    "GaugeColumns",
    "GaugeStudy",
    "GaugeTable",
    "Limit",
    "PlacedProfile",
    "ProfileRecording",
    "Record",
    "Recorded",
    "Rule",
    "Series",
    "accept_ball",
    "accept_flatness",
    "accept_gauge",
    "accept_repeat",
    "accept_spacing",
    "make_record",
    "read_gauge_table",
    "read_recorded",
    "read_series",
    "record_object",
    "series_of",
    "shown",
    "study_gauge",
    "write_record_page",
]
