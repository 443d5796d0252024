"""Acceptance tests by the metrologist's usual standards: from profiles, images or a table to a record."""

from workbench.accept.figures import RULES, Bounds, Check, Figure, Limit, Rule, Verdict
from workbench.accept.gauge import accept_gauge
from workbench.accept.gauge_study import GaugeStudy, study_gauge
from workbench.accept.gauge_table import GaugeColumns, GaugeTable, read_gauge_table
from workbench.accept.page import write_record_page
from workbench.accept.record import RULE_WORDS, Record, make_record, record_object

__all__ = [
    "RULES",
    "RULE_WORDS",
    "Bounds",
    "Check",
    "Figure",
    "GaugeColumns",
    "GaugeStudy",
    "GaugeTable",
    "Limit",
    "Record",
    "Rule",
    "Verdict",
    "accept_gauge",
    "make_record",
    "read_gauge_table",
    "record_object",
    "study_gauge",
    "write_record_page",
]
